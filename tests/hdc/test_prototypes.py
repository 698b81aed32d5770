"""Random bits of recalibrations."""

import pytest
import torch

from hdc import bits
from hdc.prototypes import replaced_bits


def test_a_share_that_is_none_is_named():
    with pytest.raises(ValueError, match=r"p: expected a share .*nan"):
        replaced_bits(2, 64, float("nan"), 0)


def test_what_is_drawn_from_one_seed_is_drawn_apart():
    d = 64 * 40
    drawn = [
        *(
            bits.random_hypervector(d, seed)
            for seed in (-1, -5, 2**32 + 5, 2**62, 2**64 - 5)
        ),
        *replaced_bits(3, d, 0.5, seed=0),
        *replaced_bits(3, d, 0.5, seed=1),
        *replaced_bits(3, d, 0.5, seed=1, number=1),
        bits.random_hypervector(d, 0),
    ]
    distances = bits.hamming(torch.stack(drawn), torch.stack(drawn)) / d
    distances.fill_diagonal_(0.5)
    assert ((distances - 0.5).abs() < 0.06).all()  # six standard deviations
