"""The order of ties: by its definition, and even over a frame."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from hdc import bits
from hdc.encoders.ties import TIES, first_ties


@pytest.mark.parametrize("ties", TIES)
@pytest.mark.parametrize("d", [1, 2, 63, 64, 65, 130, 700])
def test_the_first_ties_by_plain_loops(d, ties, order_of_pixels):
    order = order_of_pixels(d, ties)
    rng = np.random.default_rng(d)
    masks = rng.random((40, d)) < rng.random((40, 1))
    masks[0], masks[1] = False, True
    masks[4:6] = np.arange(d) % 64 < rng.integers(1, 64, (2, 1))  # uneven rounds
    masks[6:8] = np.arange(d) >= d - 64
    counts = masks.sum(1).tolist()
    missing = [int(rng.integers(0, n + 1)) for n in counts]
    missing[2:4] = counts[2:4]
    packed = bits.pack(torch.from_numpy(masks)).numpy()
    for mask, n, wanted, words in zip(masks, counts, missing, packed, strict=True):
        found = first_ties(words, n, wanted, ties)
        equal = [j for j in range(d) if mask[j]]
        if ties == "below" and wanted < len(equal):
            chosen = []
        else:
            chosen = sorted(equal, key=order.__getitem__)[:wanted]
        expected = [j in chosen for j in range(d)]
        assert bits.unpack(torch.from_numpy(found), d).tolist() == expected


def test_the_key_of_a_pixel_is_as_stated(order_of_pixels):
    """Pixels of the first two words: h(0) = 0, and h(1) = 0x9E3779B1 >> 26 = 39."""
    order = order_of_pixels(128, "spread")
    assert order[:3].tolist() == [0, 2, 4]
    assert order[64 + 25] == 1  # (25 + 39) mod 64 = 0
    assert order[64 + 26] == 3
    assert order_of_pixels(128, "raster").tolist() == list(range(128))
