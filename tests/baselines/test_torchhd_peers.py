"""Torchhd's classifiers behind the adapter are torchhd's own, and predict without chance."""

import importlib.util

import numpy as np
import pytest
import torch

from baselines.pixels import signs
from baselines.torchhd_peers import TorchhdClassifier
from hdc import HDCClassifier

EPOCHS = 5


@pytest.fixture
def torchhd():
    return pytest.importorskip("torchhd")


def plainly(torchhd, name, frames, labels, queries):
    """Labels by torchhd as its documentation calls it, on hypervectors that it does not make."""
    kind = getattr(torchhd.classifiers, name)
    hypervectors = signs(frames).flatten(1).float()
    model = kind(1, hypervectors.shape[1], int(labels.max()) + 1, epochs=EPOCHS)
    model.encoder = torch.nn.Identity().forward
    targets = torch.from_numpy(labels)
    # The adapter's order of frames: torch's own permutations, a new one for each epoch.
    order = torch.Generator().manual_seed(0)

    class Batches:
        def __iter__(self):
            permutation = torch.randperm(len(targets), generator=order)
            for rows in permutation.split(12):
                yield hypervectors[rows], targets[rows]

    model.fit(Batches())
    return model.predict(signs(queries).flatten(1).float()).numpy()


@pytest.mark.parametrize("name", ["AdaptHD", "QuantHD"])
def test_the_adapter_says_what_a_plain_call_says(torchhd, speckle, name):
    frames, _ = speckle(60, (16, 12), 3)
    labels = np.random.default_rng(0).integers(0, 3, 40)  # hard to learn: many mistakes
    train, queries = frames[:40], frames[40:]
    model = TorchhdClassifier(classifier=name, epochs=EPOCHS)
    said = model.fit(train, labels).predict(queries)
    assert (said == plainly(torchhd, name, train, labels, queries)).all()
    after_one = TorchhdClassifier(classifier=name, epochs=1).fit(train, labels)
    prototypes = after_one.state_tensors()["prototypes"]
    assert not torch.equal(prototypes, model.state_tensors()["prototypes"])


def test_quanthd_of_one_epoch_is_the_published_classifier(torchhd, speckle):
    """Nothing is corrected yet: prototypes are majorities of the very same bits."""
    frames, labels = speckle(27, (16, 12), 3)  # an odd number of each class: no ties
    model = TorchhdClassifier(classifier="QuantHD", epochs=1).fit(frames, labels)
    hdc = HDCClassifier().fit(frames, labels)
    queries, _ = speckle(90, (16, 12), 3, seed=1)
    assert (model.predict(queries) == hdc.predict(queries)).all()


def test_without_torchhd_the_error_says_what_to_install(monkeypatch):
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    with pytest.raises(
        ValueError, match=r"torchhd \(pip install torch-hd\), found none"
    ):
        TorchhdClassifier(classifier="QuantHD")
