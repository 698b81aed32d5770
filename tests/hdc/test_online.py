"""Online updates: the arithmetic of ±1 on packed bits, and what every model promises."""

from __future__ import annotations

import tracemalloc
from pathlib import Path

import numpy as np
import pytest
import torch
from hydra.utils import instantiate
from omegaconf import OmegaConf
from sklearn.base import clone

from experiments.protocol.model import Model
from hdc import HDCClassifier, bits, classifier
from hdc.encode import encode
from hdc.online import OnlineHDCClassifier

CONFIG = Path(__file__).parents[2] / "configs" / "model" / "hdc_online.yaml"


def touches(n=60, classes=4, shape=(9, 15), noise=300, seed=1):
    """Frames uint8 so noisy that some are taken for another class, and their labels."""
    rng = np.random.default_rng(seed)
    labels = rng.permutation(np.arange(n) % classes)
    base = rng.integers(0, 150, (classes, *shape))
    frames = base[labels] + rng.integers(0, noise, (n, *shape))
    return torch.from_numpy((frames // 2).astype(np.uint8)), labels


def in_floats(frames, labels, bundle, correction):
    """The update rule in ±1 as AdaptHD has it: prototypes bool [L, D], number of mistakes."""
    n_classes, dimension = labels.max() + 1, frames[0].numel()
    samples = 2.0 * bits.unpack(encode(frames), dimension).numpy() - 1
    sums, seen, mistakes = np.zeros((n_classes, dimension)), np.zeros(n_classes, bool), 0
    for sample, label in zip(samples, labels, strict=True):
        if not seen[label]:
            sums[label] += max(1, bundle) * sample
            seen[label] = True
            continue
        scores = np.where(sums > 0, 1, -1) @ sample
        taken = int(np.where(seen, scores, -np.inf).argmax())
        sums[label] += bundle * sample
        if taken != label:
            mistakes += 1
            sums[label] += correction * sample
            sums[taken] -= correction * sample
    return sums > 0, mistakes


@pytest.mark.parametrize(("bundle", "correction"), [(2, 1), (1, 1), (0, 1), (1, 3), (4, 1)])
def test_prototypes_are_those_of_the_rule_in_floats(bundle, correction, monkeypatch):
    frames, labels = touches()
    expected, mistakes = in_floats(frames, labels, bundle, correction)
    assert 4 < mistakes < 55
    model = OnlineHDCClassifier(bundle, correction)
    for chunk in (classifier.CHUNK, 7):
        monkeypatch.setattr(classifier, "CHUNK", chunk)
        model.fit(frames, labels)
        found = bits.unpack(model.prototypes_, frames[0].numel())
        assert (found.numpy() == expected).all()
    expected_n = np.bincount(labels) * bundle + (bundle == 0)
    assert model.counts_.sum() == expected_n.sum() + 2 * correction * mistakes


@pytest.mark.parametrize("ties", ["zero", "one", "random"])
@pytest.mark.parametrize("bundle", [1, 3])
def test_without_corrections_it_is_the_classifier_it_extends(ties, bundle):
    frames, labels = touches()
    plain = HDCClassifier(ties=ties, seed=5).fit(frames, labels)
    online = OnlineHDCClassifier(bundle, 0, ties=ties, seed=5).fit(frames, labels)
    assert torch.equal(plain.prototypes_, online.prototypes_)
    assert (plain.distances(frames) == online.distances(frames)).all()


def test_no_bit_lies_beyond_the_last_pixel():
    frames, labels = touches()
    model = OnlineHDCClassifier().fit(frames, labels)
    beyond = bits.unpack(model.counters_.planes, frames[0].numel())
    assert torch.equal(bits.pack(beyond), model.counters_.planes)


def test_batches_and_a_file_between_them_change_nothing(tmp_path):
    frames, labels = touches()
    names = np.array(["b", "d", "a", "c"])[labels]  # classes come out of order
    whole = OnlineHDCClassifier().fit(frames, names)
    parts = OnlineHDCClassifier()
    for start in range(0, 60, 20):
        parts.partial_fit(frames[start : start + 20], names[start : start + 20])
        parts.save(tmp_path / "model.safetensors")
        parts = OnlineHDCClassifier.load(tmp_path / "model.safetensors")
    assert parts.classes_.tolist() == list("abcd")
    assert torch.equal(whole.prototypes_, parts.prototypes_)
    assert torch.equal(whole.counters_.planes, parts.counters_.planes)
    assert repr(parts) == repr(whole)
    assert repr(whole).startswith("OnlineHDCClassifier(bundle=2, correction=1,")


class Lazy:
    """A FrameSource that makes its frames only when indexed."""

    def __init__(self, images):
        self._images, self.shape = images, tuple(images.shape)

    def __len__(self):
        return len(self._images)

    def __getitem__(self, index):
        return self._images[index].clone()


def test_contract_of_a_model(monkeypatch):
    monkeypatch.setattr(classifier, "CHUNK", 16)
    frames, labels = touches()
    model = OnlineHDCClassifier()
    assert isinstance(model, Model)
    model.fit(*touches(12, 3, (5, 9)))  # is forgotten
    seen = []
    for report in model.train(Lazy(frames), labels):
        seen.append(report["samples_seen"])
        assert model.predict(frames[:3]).shape == (3,)
    assert seen == sorted(set(seen))
    assert seen[-1] == 60
    again = clone(model).fit(frames, labels)
    assert again.get_params() == model.get_params()
    assert torch.equal(again.state_tensors()["prototypes"], model.state_tensors()["prototypes"])
    assert (model.predict(frames) == labels).mean() > 0.6
    before = model.distances(frames)
    model.state_tensors()["prototypes"].view(-1).bitwise_not_()
    assert (model.distances(frames) != before).any()


def test_the_config_builds_it():
    config = OmegaConf.create(
        {"seed": {"init": 5}, "device": "cpu", "model": OmegaConf.load(CONFIG).model}
    )
    model = instantiate(config.model, _convert_="all")
    assert isinstance(model, OnlineHDCClassifier)
    assert (model.bundle, model.correction, model.seed) == (2, 1, 5)


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"bundle": -1}, "bundle: expected an integer from 0, found -1"),
        ({"correction": 0.5}, "correction: expected an integer from 0, found 0.5"),
        ({"bundle": True}, "bundle: expected an integer from 0, found True"),
        ({"bundle": 0, "correction": 0}, "expected one above 0"),
        ({"ties": "heads"}, "ties: expected one of zero, one, random, found 'heads'"),
    ],
)
def test_weights_are_checked(given, message):
    with pytest.raises(ValueError, match=message):
        OnlineHDCClassifier(**given).fit(*touches())


def test_memory_does_not_grow_with_the_number_of_frames(monkeypatch):
    monkeypatch.setattr(classifier, "CHUNK", 8)
    peaks = []
    for n in (32, 256):
        frames, labels = touches(n, 2, (100, 100))
        tracemalloc.start()
        OnlineHDCClassifier().fit(frames, labels)
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
    assert peaks[1] < peaks[0] + 10 * 1250 + 50_000  # a few planes more for larger counts


def test_what_is_no_sum_is_not_merged():
    frames, labels = touches()
    model = OnlineHDCClassifier().fit(frames, labels)
    with pytest.raises(ValueError, match="merge: expected models whose training is a sum"):
        model.merge(OnlineHDCClassifier().fit(frames, labels))


def test_told_classes_are_not_what_a_sample_is_taken_for():
    frames, labels = touches()
    told = OnlineHDCClassifier().partial_fit(frames, labels, classes=range(9))
    plain = OnlineHDCClassifier().fit(frames, labels)
    assert torch.equal(told.prototypes_[:4], plain.prototypes_)
    assert (told.predict(frames) == plain.predict(frames)).all()
