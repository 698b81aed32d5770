"""Sums of many terms, which lose digits; references are of terms that have lost none."""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np
import torch
from numpy.typing import DTypeLike

from experiments.studies.correlation.pairs import mean_pair_correlations
from experiments.studies.limits.stability.case import Case, largest
from scenes.sensor.camera import Camera, MountedCamera


def phases_of_many_turns(most: float = 1e7) -> Any:
    """A frame of the camera in mean intensities. The exact one is of phases without their whole
    turns, by the mantissa of ``numpy.longdouble``; the read noise is the error that it may have."""
    camera = Camera()
    mounted = MountedCamera(camera, torch.device("cpu"))
    drawn = np.random.default_rng(0).uniform(-most, most, (1, camera.path_count))
    turn = 8 * np.arctan(np.longdouble(1))
    reduced = np.fmod(drawn.astype(np.longdouble), turn).astype(np.float64)
    phases = torch.from_numpy(drawn)
    return (
        partial(mounted.intensity, phases.float().double()),
        partial(mounted.intensity, phases),
        mounted.intensity(torch.from_numpy(reduced)),
        camera.read_noise / camera.grey,
    )


def correlations_of_flat_frames(n: int = 20, d: int = 25_000) -> Any:
    """The mean correlation of frames of 65,000 with one pixel in 236 brighter by one, half of them
    shared: the mean is 10⁶ deviations, which take as many of float64's digits. The exact one is
    that of the zeros and ones alone."""
    rare = np.random.default_rng(0).integers(0, 236, (n, d)) == 0
    rare[:, ::2] = rare[0, ::2]
    frames = (65_000 + rare).astype(np.uint16)

    def by_numpy(values: Any, dtype: DTypeLike) -> float:
        pairs = np.corrcoef(values, dtype=dtype)
        return float(pairs[np.triu_indices(n, 1)].mean())

    return (
        partial(by_numpy, frames, np.float32),
        partial(mean_pair_correlations, frames, frames),
        by_numpy(rare, np.float64),
        1e6 * 2.0**-53,
    )


CASES = [
    Case("sums", "phases of 10^7 rad", "62,856 phases of a million turns, of which a part counts",
         "phases in float32", "scenes.sensor.camera.Camera", "mean intensities",
         largest, phases_of_many_turns),
    Case("sums", "correlations, mean 10^6 × deviation",
         "frames of 65,000 with one pixel in 236 brighter by one",
         "numpy.corrcoef in float32", "Eq. 4 by class sums", "correlation",
         largest, correlations_of_flat_frames),
]  # fmt: skip
