"""Inner products of a bank: exact, and of 8- and 16-bit frames alone."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from baselines.bank import Bank
from hdc.encoders import Median


@pytest.fixture
def frames():
    """60 frames of 3 classes."""
    rng = np.random.default_rng(0)
    images = rng.integers(0, 256, (3, 9, 15))[np.arange(60) % 3] // 2
    return torch.from_numpy((images + rng.integers(0, 128, (60, 9, 15))).astype("u1"))


LABELS = np.arange(60) % 3
TRAIN, QUERIES = np.r_[20:50, 20:23], np.arange(50, 60)


def test_products_of_bits_are_those_of_hypervectors_in_signs(frames):
    held = Bank(frames, LABELS, 3)
    flat = frames.flatten(1).double()
    signs = torch.where(flat > flat.median(dim=1, keepdim=True).values, 1.0, -1.0)
    words = Median().encode(frames)
    assert torch.equal(held.words().packed, words)
    assert (held.bits.diagonal() == 135).all()
    exact = (signs.sum(dim=1) == -1).nonzero().flatten()  # without ties at the median
    assert len(exact) > 5
    chosen = np.ix_(exact, exact)
    assert (held.bits[chosen] == (signs @ signs.T)[chosen]).all()


def test_what_a_bank_refuses(frames):
    with pytest.raises(ValueError, match=r"uint8 or uint16, found torch\.float32"):
        Bank(frames.float(), LABELS, 3)
    with pytest.raises(ValueError, match="labels: expected 60, one a frame, found 3"):
        Bank(frames, LABELS[:3], 3)
    with pytest.raises(
        ValueError, match=r"pixels: expected one of unit, .* 'standard'"
    ):
        Bank(frames, LABELS, 3).kernel(TRAIN, QUERIES, "standard")
