"""Frames like those of a camera, and typed commands."""

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


@pytest.fixture(name="kinds_of_frames")
def _kinds_of_frames():
    return kinds_of_frames


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
