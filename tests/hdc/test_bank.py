"""A bank computes once what is the same for all subsets, and estimators take words from it."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from hdc import HDCClassifier, HDCRegressor
from hdc.bank import Bank
from hdc.encoders import Median
from hdc.readouts import Majority


@pytest.fixture
def frames():
    """60 frames of 3 classes."""
    rng = np.random.default_rng(0)
    images = rng.integers(0, 256, (3, 9, 15))[np.arange(60) % 3] // 2
    return torch.from_numpy((images + rng.integers(0, 128, (60, 9, 15))).astype("u1"))


LABELS = np.arange(60) % 3
TRAIN, QUERIES = np.r_[20:50, 20:23], np.arange(50, 60)


def test_every_frame_is_encoded_once_for_each_encoder(frames, monkeypatch):
    calls = []
    encode = Median.encode

    def count(self, part, *others):
        calls.append(len(part))
        return encode(self, part, *others)

    monkeypatch.setattr(Median, "encode", count)
    held = Bank(frames, LABELS, 3)
    for _ in range(3):
        held.words()
        held.words(Median())
    assert sum(calls) == 60
    held.words(Median(ties="raster"))
    assert sum(calls) == 120


@pytest.mark.parametrize(
    "model",
    [
        HDCClassifier(),
        HDCClassifier(readout=Majority("random", balance=False, seed=3)),
        HDCClassifier(readout="counts"),
        HDCClassifier(readout="ridge"),
        HDCClassifier(backend="compiled"),
    ],
    ids=str,
)
def test_an_estimator_learns_the_same_from_a_bank_as_from_frames(frames, model):
    held = Bank(frames, LABELS, 3)
    plain = model.unlearned().fit(frames[TRAIN], LABELS[TRAIN])
    model.fit(held.at(TRAIN), LABELS[TRAIN])
    for name, tensor in plain.state_tensors().items():
        assert torch.equal(model.state_tensors()[name], tensor)
    assert model.frame_shape_ == (9, 15)
    assert (model.distances(held.at(QUERIES)) == plain.distances(frames[QUERIES])).all()
    for one, source in ((model, held.at(QUERIES)), (plain, frames[QUERIES])):
        by_votes = {"method": "merge"} if "method" in one.readout_.adapts_by else {}
        one.recalibrate(source, LABELS[QUERIES], **by_votes)
    assert (model.predict(held.at(TRAIN)) == plain.predict(frames[TRAIN])).all()


def test_a_regressor_learns_from_a_bank(frames):
    held, numbers = Bank(frames, LABELS, 3), np.linspace(0, 1, len(TRAIN))
    model = HDCRegressor().fit(held.at(TRAIN), numbers)
    plain = HDCRegressor().fit(frames[TRAIN], numbers)
    assert (model.predict(held.at(QUERIES)) == plain.predict(frames[QUERIES])).all()


def test_a_selection_is_a_source_of_frames(frames):
    selection = Bank(frames, LABELS, 3).at(TRAIN)
    assert selection.shape == (33, 9, 15)
    assert torch.equal(selection[30:], frames[[20, 21, 22]])
    assert torch.equal(selection[torch.tensor([0, 32])], frames[[20, 22]])
    with pytest.raises(ValueError, match=r"expected D = 8 pixels .* found 135"):
        HDCClassifier().fit(torch.rand(4, 8), [0, 1, 0, 1]).predict(selection)
