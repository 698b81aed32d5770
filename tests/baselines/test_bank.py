"""A bank of frames: the words of the library, and of 8- and 16-bit frames alone."""

import numpy as np
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
