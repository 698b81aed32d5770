"""Smoothing in integers: against the double sum, and against a Gaussian in floats."""

from __future__ import annotations

from math import exp, floor

import numpy as np
import pytest
import torch

from hdc import HDCClassifier
from hdc.encoders import Deviation, Levels, Median, Reference, Smoothed

pytestmark = pytest.mark.filterwarnings("ignore:.*constant frame", "ignore:.*ties=")
BASES = [Median(), Levels(3), Levels(2, lit=0.5), Reference("levels"), Deviation()]


def weights_of(deviation: int) -> dict[int, int]:
    reach = 3 * deviation
    heights = {k: exp(-0.5 * k**2 / deviation**2) for k in range(-reach, reach + 1)}
    found = {k: round(4096 * h / sum(heights.values())) for k, h in heights.items()}
    found[0] += 4096 - sum(found.values())
    return found


def mirrored(place: int, n: int) -> int:
    while not 0 <= place < n:
        place = -place if place < 0 else 2 * (n - 1) - place
        if n == 1:
            return 0
    return place


def plainly(image: np.ndarray, deviation: int) -> list[list[int]]:
    """The double sum over an image of integers, rounded to 1/1024."""
    height, width = image.shape
    weights = weights_of(deviation)
    rows = []
    for y in range(height):
        row = []
        for x in range(width):
            total = 0
            for dy, a in weights.items():
                for dx, b in weights.items():
                    pixel = image[mirrored(y + dy, height), mirrored(x + dx, width)]
                    total += a * b * int(pixel)
            unit = 2**14
            row.append(floor((2 * total + unit) / (2 * unit)))
        rows.append(row)
    return rows


@pytest.mark.parametrize(("dtype", "bits"), [("uint8", 8), ("uint16", 16)])
@pytest.mark.parametrize("shape", [(1, 1), (1, 9), (2, 2), (6, 11)])
@pytest.mark.parametrize("deviation", [1, 2])
def test_sums_by_their_definition(shape, deviation, dtype, bits):
    rng = np.random.default_rng(0)
    images = rng.integers(0, 2**bits, (3, *shape)).astype(dtype)
    images[1] = 2**bits - 1
    encoder = Smoothed(smooth=deviation).fit(images)
    found = encoder.images(torch.from_numpy(images))
    assert found.dtype == torch.int32
    assert found.tolist() == [plainly(image, deviation) for image in images]


@pytest.mark.parametrize("base", BASES, ids=repr)
def test_words_are_those_of_the_base(base, kinds_of_frames):
    flat = kinds_of_frames(21 * 13)
    frames = torch.from_numpy(flat.reshape(-1, 21, 13))
    encoder = Smoothed(base, 2).fit(frames)
    images = encoder.images(frames)
    other = base.unlearned().fit(images)
    words = encoder.encode(frames)
    assert encoder.dimension(273) == other.dimension(273)
    assert torch.equal(words, other.encode(images))
    assert torch.equal(encoder.encode(torch.from_numpy(flat)), words)


@pytest.mark.parametrize("base", BASES, ids=repr)
def test_equal_greys_have_equal_bits_in_every_type(base, kinds_of_frames):
    frames = kinds_of_frames(21 * 13).reshape(-1, 21, 13)
    encoder = Smoothed(base, 1).fit(frames)
    words = encoder.encode(torch.from_numpy(frames))
    for dtype in ("uint16", "int16"):
        same = torch.from_numpy(frames.astype(dtype))
        assert torch.equal(encoder.encode(same), words)


def test_what_is_no_image_or_no_deviation_is_refused():
    frames = np.random.default_rng(0).integers(0, 99, (6, 8, 9)).astype(np.uint8)
    with pytest.raises(ValueError, match=r"smooth: expected images \[N, H, W\], found"):
        HDCClassifier(Smoothed()).fit(frames.reshape(6, -1), [0, 1] * 3)
    encoder = Smoothed().fit(frames)
    with pytest.raises(ValueError, match="shape: expected that of 71 pixels"):
        Smoothed().restore(encoder.state(), 71)
    bad = frames.astype(float)
    bad[5, 2, 3] = np.nan
    with pytest.raises(ValueError, match=r"frames\[105\]: expected finite pixels"):
        encoder.encode(torch.from_numpy(bad), 100)


def test_the_base_of_an_encoder_stays_untrained():
    """Two models that share the object of a base learn references of their own."""
    frames = np.random.default_rng(0).integers(0, 255, (6, 8, 9)).astype(np.uint8)
    base = Deviation([0])
    one = Smoothed(base, 1).fit(frames)
    before = one.state()["reference"].clone()
    Smoothed(base, 1).fit(frames[:2])
    assert torch.equal(one.state()["reference"], before)
    assert not hasattr(base, "reference_")
