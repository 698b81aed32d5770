"""A bank encodes once what is the same for all subsets."""

import numpy as np
import pytest
import torch

from baselines.bank import Bank
from hdc import bits
from hdc.encoders import Deviation, Encoder, Levels, Quantile, Smoothed
from tests.hdc.net.frames import frames_of

FRAMES, LABELS = frames_of("uint8", 60)
TRAIN, QUERIES, ALL = np.r_[20:50, 20:23], np.arange(50, 60), np.arange(60)


@pytest.fixture
def bank():
    return Bank(torch.from_numpy(FRAMES), LABELS, 3)


@pytest.mark.parametrize("encoder", [Smoothed("median", 1), Deviation()], ids=repr)
def test_frames_are_encoded_once_by_the_encoder_of_their_training(
    bank, encoder, monkeypatch
):
    kind = type(encoder)
    calls = []
    encode = kind.encode

    def count(self, part, *others):
        calls.append(len(part))
        return encode(self, part, *others)

    monkeypatch.setattr(kind, "encode", count)
    for train in (TRAIN, TRAIN, QUERIES):
        found = bank.words(QUERIES, encoder, train)
        learned = encoder.unlearned().fit(FRAMES[train])
        expected = encode(learned, bank.frames[QUERIES])
        assert torch.equal(found.packed, expected)
    assert sum(calls) == 2 * len(QUERIES)


class Above(Encoder):
    """Pixels above those of a frame."""

    def __init__(self, frame=None):
        self.frame = frame

    def encode(self, frames):
        return bits.pack(frames.flatten(1) > torch.as_tensor(self.frame).flatten())


def test_a_bank_holds_words_of_equal_encoders_once(bank):
    low, high = (Above(np.full(FRAMES.shape[1:], grey)) for grey in (50, 150))
    # Though their texts are equal.
    assert not torch.equal(
        bank.words(ALL, low, TRAIN).packed, bank.words(ALL, high, TRAIN).packed
    )
    for encoder in (low, high, Quantile("1/3"), Levels(3)):
        expected = encoder.encode(bank.frames)
        assert torch.equal(bank.words(ALL, encoder, TRAIN).packed, expected)
