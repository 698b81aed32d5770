"""Levels in deviations from a reference: against fractions."""

from fractions import Fraction
from math import isqrt

import numpy as np
import pytest
import torch

from hdc import bits
from hdc.encoders import Deviation
from hdc.encoders.relative import standardised
from tests.hdc.own import BACKENDS, by

pytestmark = pytest.mark.filterwarnings("ignore:.*constant frame")

DEFAULT = [-1.5, -1, -0.5, 0, 0.5, 1, 1.5]
ODD = [-2.25, "-1/3", 0.1, 3]


def plainly(frames, thresholds):
    """Bits [N, T·D] by their definition, of standardised frames, in Python's integers."""
    steps = np.array(standardised(torch.from_numpy(frames)).tolist())
    n, size = steps.shape
    d = steps - steps.sum(0) // n
    variances = (size * (d**2).sum(1) - d.sum(1) ** 2) // size**2
    rows = []
    for frame, variance in zip(d.tolist(), variances.tolist(), strict=True):
        limits = [Fraction(str(t)) * isqrt(variance) for t in thresholds]
        rows.append([x > limit for limit in limits for x in frame])
    return np.array(rows)


@pytest.mark.parametrize(
    ("d", "dtype"), [(1, "uint8"), (2, "int16"), (65, "float64"), (300, "uint8")]
)
@pytest.mark.parametrize("thresholds", [DEFAULT, ODD], ids=repr)
@pytest.mark.parametrize("backend", BACKENDS)
def test_bits_by_their_definition(backend, d, dtype, thresholds, kinds_of_frames):
    """Constant frames, two grey levels, few, and saturated ones among them."""
    frames = kinds_of_frames(d, dtype)
    encoder = Deviation(thresholds).fit(frames)
    assert encoder.dimension(d) == len(thresholds) * d
    words = by(backend, encoder.encode, torch.from_numpy(frames))
    found = bits.unpack(words, encoder.dimension(d)).numpy()
    assert np.array_equal(found, plainly(frames, thresholds))


@pytest.mark.parametrize("backend", BACKENDS)
def test_no_sum_overflows_at_many_pixels(backend):
    """Two frames of 2²⁴ + 1 pixels whose one bright pixel stands apart by all that can be."""
    d = 2**24 + 1
    frames = torch.zeros(2, d, dtype=torch.uint8)
    frames[0, 5], frames[1, d - 1] = 255, 255
    encoder = Deviation([-1, 0, 4000]).fit(frames)
    words = by(backend, encoder.encode, frames)
    # x is √D at one pixel, so d is ±√D/2 at two, and σ is 1/√2: √D/√2 = 2896 σ.
    ones = bits.unpack(words[0], 3 * d).nonzero().flatten()
    levels = torch.bincount(ones // d, minlength=3).tolist()
    assert levels == [d - 1, 1, 0]
    assert ones[-1] == d + 5
