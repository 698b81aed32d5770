"""A bank of frames: the words of the library, and of 8- and 16-bit frames alone."""

import numpy as np
import pytest
import torch

from baselines.bank import Bank
from hdc.encoders import Median


def test_products_of_bits_are_those_of_hypervectors_in_signs(small):
    frames, labels = small
    held = Bank(frames, labels, 4)
    flat = frames.flatten(1).double()
    signs = torch.where(flat > flat.median(dim=1, keepdim=True).values, 1.0, -1.0)
    assert torch.equal(held.words().packed, Median().encode(frames))
    exact = (signs.sum(dim=1) == 0).nonzero().flatten()  # without ties at the median
    assert len(exact) > 5
    chosen = np.ix_(exact, exact)
    assert (held.bits[chosen] == (signs @ signs.T)[chosen]).all()


@pytest.mark.parametrize(
    ("ask", "message"),
    [
        (lambda x, y: Bank(x.float(), y, 4), r"uint8 or uint16, found torch\.float32"),
        (lambda x, y: Bank(x, y[:3], 4), "labels: expected 40, one a frame, found 3"),
        (
            lambda x, y: Bank(x, y, 4).kernel(y, y, "log"),
            "pixels: expected one of unit,",
        ),
    ],
)
def test_what_a_bank_refuses(small, ask, message):
    with pytest.raises(ValueError, match=message):
        ask(*small)
