"""Frames like those of a camera, and a plain reference for their hypervectors."""

from fractions import Fraction

import numpy as np
import pytest

from hdc.command import main


def kinds_of_frames(d, dtype="uint8", seed=0):
    """One frame [D] of each kind that a camera or a program gives, in random order.

    Constant, of two values at several shares, saturated at either end or both, rising, falling,
    in blocks of a word, of few levels, of all levels, and all equal but for one pixel.
    """
    rng = np.random.default_rng([seed, d])
    low, high = (0, 255)
    if np.dtype(dtype).kind == "i":
        low, high = -100, 100
    elif np.dtype(dtype).kind == "f":
        low, high = -1, 1
    elif np.dtype(dtype).itemsize > 1:
        high = 60_000
    wide = rng.normal((low + high) / 2, (high - low) / 8, (4, d))
    middle = (low + high) // 2
    odd = np.full((2, d), middle)
    odd[0, 0], odd[1, -1] = high, low
    frames = [
        np.full((3, d), [[low], [high], [middle]]),
        np.where(rng.random((5, d)) < [[0.02], [0.3], [0.5], [0.7], [0.98]], high, low),
        wide,
        np.sort(wide)[:2],
        np.sort(wide)[:2, ::-1],
        (wide - middle) * 20 + middle,
        wide + (high - low) / 3,
        wide - (high - low) / 3,
        np.repeat(wide, 64, axis=1)[:2, :d],
        middle + rng.integers(0, 3, (3, d)),
        odd,
    ]
    return rng.permutation(np.concatenate(frames).clip(low, high)).astype(dtype)


def order_of_pixels(d):
    """The place of each pixel [D] among equal ones: that of place 0 is the first to be a one."""
    keys = []
    for j in range(d):
        word, bit = divmod(j, 64)
        rotation = (word * 0x9E3779B1 % 2**32) >> 26
        keys.append(((bit + rotation) % 64, word))
    places = np.empty(d, int)
    for place, j in enumerate(sorted(range(d), key=keys.__getitem__)):
        places[j] = place
    return places


def brightest(frames, quantile="1/2"):
    """Mask [N, D] of the ⌊(1 − q)·D⌋ largest pixels of each frame, by sorting all of them.

    Of equal pixels the first in the order of ties comes first.
    """
    frames = frames.reshape(len(frames), -1)
    d = frames.shape[1]
    n_ones = int((1 - Fraction(quantile)) * d)
    places = order_of_pixels(d)
    mask = np.zeros(frames.shape, bool)
    for row, frame in zip(mask, frames, strict=True):
        falling = np.lexsort((-places, frame))[::-1]
        row[falling[:n_ones]] = True
    return mask


@pytest.fixture(name="kinds_of_frames")
def _kinds_of_frames():
    return kinds_of_frames


@pytest.fixture(name="brightest")
def _brightest():
    return brightest


@pytest.fixture
def typed(capsys):
    """typed(*words) → exit status, output and errors of a command line."""

    def run(*words):
        with pytest.raises(SystemExit) as caught:
            main([str(word) for word in words])
        return caught.value.code, *capsys.readouterr()

    return run


@pytest.fixture
def hdc(typed):
    """:func:`typed`, in lines."""

    def run(*words):
        status, out, err = typed(*words)
        return status, out.splitlines(), err.splitlines()

    return run
