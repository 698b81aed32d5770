"""What cannot be counted, and random bits of recalibrations."""

import pytest
import torch

from hdc import bits
from hdc.prototypes import Counters, replaced_bits

ONE = torch.zeros(1, 1, dtype=torch.int64)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda c: c.add(ONE, torch.tensor([-1])), r"class indices in \[0, 2\), fo.* -1"),
        (lambda c: c.add(ONE, torch.tensor([2])), r"class indices in \[0, 2\), found 2"),
        (lambda c: c.add(ONE, torch.tensor([0, 0])), "expected 1, one a sample, found 2"),
        (lambda c: c.add(ONE[:, [0, 0]], torch.tensor([0])), "1 words for D = 64, found 2"),
        (lambda c: replaced_bits(2, 64, float("nan"), 0), "p: expected a share .*nan"),
    ],
)  # fmt: skip
def test_what_cannot_be_counted_is_named_and_not_counted(call, message):
    counters = Counters(2, 64)
    with pytest.raises(ValueError, match=message):
        call(counters)
    assert counters.n.tolist() == [0, 0]


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
