"""The intensity of a frame by its definition, beside the camera that computes it."""

from __future__ import annotations

import numpy as np
import torch
from numpy.typing import NDArray

from scenes.sensor.camera import Camera, MountedCamera


def camera_of(camera: Camera) -> MountedCamera:
    """The camera on the CPU."""
    return MountedCamera(camera, torch.device("cpu"))


def exact_intensity(
    camera: Camera,
    phases: NDArray[np.float64],
) -> NDArray[np.float64]:
    """I/⟨I⟩ float64 [crop, crop] of phases [P] in rad: |F[A·e^{iφ}]|², summed over polarisations,
    times the illumination; cosines have the mantissa of ``numpy.longdouble``, the rest float64."""
    long = phases.astype(np.longdouble).reshape(camera.polarisations, -1)
    field = (np.cos(long) + 1j * np.sin(long)).astype(np.complex128)
    total = np.zeros((camera.crop, camera.crop))
    for paths in field:
        pupil = np.zeros((camera.grid, camera.grid), np.complex128)
        pupil[: camera.pupil, : camera.pupil][camera.disc] = paths
        speckle = np.fft.fft2(pupil)[: camera.crop, : camera.crop]
        total += np.abs(speckle) ** 2
    return total * camera.illumination / camera.path_count
