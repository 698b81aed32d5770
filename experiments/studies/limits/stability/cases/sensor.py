"""The simulated camera; the reference is its definition in extended precision."""

from __future__ import annotations

from functools import partial
from typing import Any

import torch

from experiments.studies.limits.numerics.intensity import camera_of, exact_intensity
from experiments.studies.limits.stability.case import case
from scenes.sensor.camera import Camera
from scenes.sensor.seeds import stream


@case(
    "sensor",
    "phases of up to 10^7 rad, a million turns: float32 resolves 1 rad there",
    "phases in float32",
    "MountedCamera.intensity",
    "mean intensities",
    tolerance=1e-4,
)
def phases_of_a_million_turns() -> Any:
    camera = Camera(grid=64, crop=60, pupil=24)
    drawn = stream(3, "numerics").uniform(-1e7, 1e7, camera.path_count)
    phases = torch.from_numpy(drawn)[None]
    intensity = camera_of(camera).intensity
    return (
        lambda: intensity(phases.float().double()),
        partial(intensity, phases),
        exact_intensity(camera, drawn)[None],
    )
