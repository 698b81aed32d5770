"""Online updates: the arithmetic of ±1 on packed bits, and what every model promises."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import torch

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


def test_what_is_no_sum_is_not_merged():
    frames, labels = touches()
    model = OnlineHDCClassifier().fit(frames, labels)
    with pytest.raises(ValueError, match="merge: expected models whose training is a sum"):
        model.merge(OnlineHDCClassifier().fit(frames, labels))
