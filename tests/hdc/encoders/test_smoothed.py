"""Smoothing in integers: against the double sum."""

from math import exp

import numpy as np
import pytest
import torch

from hdc import HDCClassifier
from hdc.encoders import Deviation, Levels, Median, Reference, Smoothed

pytestmark = pytest.mark.filterwarnings("ignore:.*order of pixels")
BASES = [Median(), Levels(3), Levels(2, lit=0.5), Reference("levels"), Deviation()]


def weights_of(deviation):
    """Of the pixels up to three deviations away, in 1/4096; the middle one takes the rest."""
    reach = 3 * deviation
    heights = [exp(-0.5 * (k / deviation) ** 2) for k in range(-reach, reach + 1)]
    found = [round(4096 * height / sum(heights)) for height in heights]
    found[reach] += 4096 - sum(found)
    return found


def plainly(image, deviation):
    """The double sum over an image of integers, rounded to 1/1024."""
    height, width = image.shape
    weights = weights_of(deviation)
    around = np.pad(image.astype(np.int64), 3 * deviation, mode="reflect")
    total = 0
    for y, a in enumerate(weights):
        for x, b in enumerate(weights):
            total = total + a * b * around[y : y + height, x : x + width]
    return ((2 * total + 2**14) // 2**15).tolist()


@pytest.mark.parametrize("dtype", ["uint8", "int16", "uint16"])
@pytest.mark.parametrize("shape", [(1, 1), (1, 9), (2, 2), (6, 11)])
@pytest.mark.parametrize("deviation", [1, 2])
def test_sums_by_their_definition(shape, deviation, dtype):
    rng = np.random.default_rng(0)
    info = np.iinfo(dtype)
    images = rng.integers(info.min, info.max, (3, *shape), dtype, endpoint=True)
    images[1] = info.max
    encoder = Smoothed(smooth=deviation).fit(images)
    found = encoder.images(torch.from_numpy(images))
    assert found.dtype == torch.int32
    assert found.tolist() == [plainly(image, deviation) for image in images]


@pytest.mark.parametrize("base", BASES, ids=repr)
def test_words_are_those_of_the_base(base, kinds_of_frames):
    """Which stays untrained: two models may share it."""
    flat = torch.from_numpy(kinds_of_frames(21 * 13))
    frames = flat.view(-1, 21, 13)
    encoder = Smoothed(base, 2).fit(frames)
    Smoothed(base, 2).fit(frames[:2])
    images = encoder.images(frames)
    other = base.unlearned().fit(images)
    words = encoder.encode(frames)
    assert encoder.dimension(273) == other.dimension(273)
    assert torch.equal(words, other.encode(images))
    assert torch.equal(encoder.encode(flat), words)


def test_what_is_no_image_or_no_deviation_is_refused():
    frames = np.random.default_rng(0).integers(0, 99, (6, 8, 9)).astype(np.uint8)
    with pytest.raises(ValueError, match=r"smooth: expected images \[N, H, W\], found"):
        HDCClassifier(Smoothed()).fit(frames.reshape(6, -1), [0, 1] * 3)
    encoder = Smoothed().fit(frames)
    bad = frames.astype(float)
    bad[5, 2, 3] = np.nan
    with pytest.raises(ValueError, match=r"frames\[105\]: expected finite pixels"):
        encoder.encode(torch.from_numpy(bad), 100)
