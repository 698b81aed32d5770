"""A bank encodes once what is the same for all subsets, and models take words from it."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from hdc import HDCClassifier, HDCRegressor, bits
from hdc.bank import Bank
from hdc.encoders import Deviation, Encoder, Levels, Quantile, Smoothed

LABELS = np.arange(60) % 3
TRAIN, QUERIES = np.r_[20:50, 20:23], np.arange(50, 60)


@pytest.fixture
def frames():
    """60 frames of 3 classes."""
    rng = np.random.default_rng(0)
    images = rng.integers(0, 256, (3, 9, 15))[np.arange(60) % 3] // 2
    return torch.from_numpy((images + rng.integers(0, 128, (60, 9, 15))).astype("u1"))


@pytest.mark.parametrize(
    ("encoder", "times"),
    [(Smoothed("median", 1), 1), (Deviation(), 2), (Smoothed("deviation", 1), 2)],
)
def test_other_training_frames_encode_a_frame_anew_if_they_teach_another_state(
    frames, encoder, times, monkeypatch
):
    kind = type(encoder)
    calls = []
    encode = kind.encode

    def count(self, part, *others):
        calls.append(len(part))
        return encode(self, part, *others)

    monkeypatch.setattr(kind, "encode", count)
    held = Bank(frames, LABELS, 3)
    for train in (TRAIN, QUERIES):
        found = held.words(QUERIES, encoder, train)
        learned = encoder.unlearned().fit(frames[train])
        assert torch.equal(found.packed, encode(learned, frames[QUERIES]))
    assert sum(calls) == times * len(QUERIES)


@pytest.mark.parametrize("encoder", ["median", "deviation"])
def test_models_learn_the_same_from_words_as_from_frames(frames, encoder):
    held = Bank(frames, LABELS, 3)
    numbers = np.linspace(0, 1, len(TRAIN))
    for kind, targets in ((HDCClassifier, LABELS[TRAIN]), (HDCRegressor, numbers)):
        model = kind(encoder)
        part = model.fresh("encoder")
        model.fit(held.words(TRAIN, part, TRAIN), targets)
        plain = kind(encoder).fit(frames[TRAIN], targets)
        assert model.frame_shape_ == (9, 15)
        asked = held.words(QUERIES, part, TRAIN)
        assert (model.predict(asked) == plain.predict(frames[QUERIES])).all()
        assert (model.predict(frames[QUERIES]) == plain.predict(asked)).all()
        model.recalibrate(asked, LABELS[QUERIES])
        plain.recalibrate(frames[QUERIES], LABELS[QUERIES])
        assert (model.predict(frames) == plain.predict(frames)).all()


def test_words_of_another_encoder_are_refused(frames):
    model = HDCClassifier("deviation").fit(frames, LABELS)
    for other in (HDCClassifier("deviation").fit(frames[5:], LABELS[5:]),
                  HDCClassifier("levels").fit(frames, LABELS)):  # fmt: skip
        with pytest.raises(ValueError, match="hypervectors: expected"):
            model.predict(other.encode(frames))
    with pytest.raises(ValueError, match=r"hypervectors: expected D = 945, found 135"):
        model.predict(HDCClassifier().fit(frames, LABELS).encode(frames))
    with pytest.raises(ValueError, match="hypervectors: expected encoder"):
        HDCClassifier("levels").fit(model.encode(frames), LABELS)


class Above(Encoder):
    """Pixels above those of a frame."""

    def __init__(self, frame=None):
        self.frame = frame

    def encode(self, frames):
        return bits.pack(frames.flatten(1) > torch.as_tensor(self.frame).flatten())


def test_a_bank_holds_words_of_equal_encoders_once(frames):
    held = Bank(frames, LABELS, 3)
    low, high = (Above(np.full(frames.shape[1:], grey)) for grey in (50, 150))
    # Though their texts are equal.
    assert not torch.equal(held.words(None, low).packed, held.words(None, high).packed)
    for encoder in (low, high, Quantile("1/3"), Levels(3)):
        assert torch.equal(held.words(None, encoder).packed, encoder.encode(frames))
