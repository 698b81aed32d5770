"""Frames like those of a camera, and a plain reference for their hypervectors."""

from __future__ import annotations

import numpy as np
import pytest


def camera_frames(
    n: int, side: int = 500, seed: int = 0, dtype: str = "uint8"
) -> np.ndarray:
    """Speckle of six scenes in random order, [n, side, side], with medians of 33 to 132 of 255.

    Each scene has its own exposure; from frame to frame the light flickers by some per cent, the
    illumination leans to one side, and read noise of two grey levels is added. Bright speckles are
    saturated. Types of more than 8 bits have levels between those of 8 bits.
    """
    rng = np.random.default_rng(seed)
    exposures = np.linspace(33, 132, 6)
    across = np.linspace(0.7, 1.3, side)
    frames = np.empty((n, side, side), dtype)
    scale = 256 if np.dtype(dtype).itemsize > 1 else 1
    for frame in frames:
        pupil = np.zeros((side, side), np.complex64)
        cut = max(2, side // 8)  # speckles of some eight pixels
        pupil[:cut, :cut] = rng.normal(size=(cut, cut)) + 1j * rng.normal(
            size=(cut, cut)
        )
        light = np.abs(np.fft.ifft2(pupil)) ** 2 * across
        light *= rng.choice(exposures) * rng.uniform(0.95, 1.05) / np.median(light)
        light = (light + rng.normal(0, 2, light.shape)) * scale
        frame[:] = np.clip(light, 0, 255 * scale)
    return frames


def kinds_of_frames(d: int, dtype: str = "uint8", seed: int = 0) -> np.ndarray:
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


def upper_half(frames: np.ndarray) -> np.ndarray:
    """Mask [N, D] of the ⌊D/2⌋ largest pixels of each frame, equal ones in raster order.

    By a stable sort of the frame read backwards: the last of equal pixels is the first in raster.
    """
    backwards = frames.reshape(len(frames), -1)[:, ::-1]
    d = backwards.shape[1]
    order = np.argsort(backwards, axis=1, kind="stable")
    mask = np.zeros(backwards.shape, bool)
    np.put_along_axis(mask, d - 1 - order[:, d - d // 2 :], True, axis=1)
    return mask


@pytest.fixture(name="camera_frames")
def _camera_frames():
    return camera_frames


@pytest.fixture(name="kinds_of_frames")
def _kinds_of_frames():
    return kinds_of_frames


@pytest.fixture(name="upper_half")
def _upper_half():
    return upper_half
