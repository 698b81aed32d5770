"""From the phases of the paths to eight bits; docs/sensor.md has the equations.

Each pixel of the pupil and each polarisation is one path. The lens turns the pupil's field into the
speckle field, one Fourier transform per polarisation, and the sensor adds their intensities.

With a read noise of many electrons the sum of the Poisson number and the Gaussian has no visible
steps and a small skewness γ: it is drawn as one Gaussian variate z, pushed through the first
Cornish-Fisher term, grey = m + s·(z + γ·(z² − 1)/6), which the tests compare with the exact
convolution. Below ``CONTINUOUS`` electrons of read noise the Poisson number is drawn.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import torch
from torch import Tensor

from hdc.parameters import check_integer
from scenes.validate import require_number

KEY = "scene.sensor.camera"
CONTINUOUS = 20.0


@dataclass(frozen=True)
class Camera:
    """Pupil, illumination and pixels; the defaults are the calibrated sensor.

    Args:
        grid: side of the Fourier grid in pixels.
        crop: side of the frame in pixels (the paper: approximately 500 × 500).
        pupil: diameter of the pupil in grid pixels; a speckle grain is about 1.2·grid/pupil pixels
            (fitted: accuracy at few samples).
        polarisations: 1 or 2 (the ratio of published contrasts excludes 1).
        unevenness: C_W (fitted: the correlation that all pairs of frames share).
        photons: N_ph, electrons per pixel at the mean intensity (assumed).
        grey: G, grey level at the mean intensity (assumed).
        read_noise: standard deviation in grey levels (assumed).
    """

    grid: int = 512
    crop: int = 500
    pupil: int = 200
    polarisations: int = 2
    unevenness: float = 0.275
    photons: float = 3000.0
    grey: float = 50.0
    read_noise: float = 0.7

    def __post_init__(self) -> None:
        check_integer(f"{KEY}.grid", self.grid, 1)
        for name, high in (
            ("pupil", self.grid),
            ("crop", self.grid),
            ("polarisations", 2),
        ):
            check_integer(f"{KEY}.{name}", getattr(self, name), 1, high)
        for name in ("unevenness", "read_noise"):
            require_number(f"{KEY}.{name}", getattr(self, name), 0)
        for name in ("photons", "grey"):
            require_number(f"{KEY}.{name}", getattr(self, name), 0, strict=True)

    @cached_property
    def disc(self) -> np.ndarray:
        """A, bool [pupil, pupil]."""
        along = np.arange(self.pupil) - (self.pupil - 1) / 2
        square = along[:, None] ** 2 + along**2
        radius = max(self.pupil / 2, 0.5)
        return np.asarray(square <= radius**2)

    @property
    def path_count(self) -> int:
        """One path for each polarisation and pupil pixel."""
        return self.polarisations * int(self.disc.sum())

    @cached_property
    def illumination(self) -> np.ndarray:
        """W float64 [crop, crop], mean 1 and standard deviation ``unevenness``."""
        along = (np.arange(self.crop) + 0.5) / self.crop - 0.5
        # Squared distance from the middle of the beam, in widths of the frame.
        square = (along[:, None] + 0.05) ** 2 + (along - 0.1) ** 2
        if self.unevenness == 0 or self.crop == 1:
            return np.ones_like(square)

        low, high = 0.2, 50.0  # a wider beam is more even
        while high - low > 1e-12:
            width = (low + high) / 2
            light = np.exp(-square / (2 * width**2))
            if light.std() > self.unevenness * light.mean():
                low = width
            else:
                high = width
        return np.asarray(light / light.mean())


class MountedCamera:
    """Phases in, frames out: a camera with its arrays on a device."""

    def __init__(self, camera: Camera, device: torch.device) -> None:
        self.camera = camera
        inside = np.flatnonzero(camera.disc)
        self._inside = torch.from_numpy(inside).to(device)
        # Mean intensity of F[A·e^{iφ}] is the number of pupil pixels, a polarisation.
        gain = torch.from_numpy(camera.illumination / camera.path_count)
        self._gain = gain.to(device, torch.float32)

    def intensity(self, phases: Tensor) -> Tensor:
        """I/⟨I⟩ float32 [n, crop, crop] from phases float64 [n, P] in rad."""
        camera = self.camera
        n, side = len(phases), camera.pupil
        phases = phases.reshape(n * camera.polarisations, -1)
        shape = len(phases), side * side, 2
        field = torch.zeros(shape, dtype=torch.float32, device=phases.device)
        # In float64, as float32 resolves 0.01 rad at 1e5 rad; it takes no longer than reducing the
        # phases to one turn and going on in float32 (experiment=numerics).
        real, imaginary = phases.cos(), phases.sin()
        field[:, self._inside, 0] = real.to(torch.float32)
        field[:, self._inside, 1] = imaginary.to(torch.float32)
        pupil = torch.view_as_complex(field).reshape(-1, side, side)
        # Most of the grid is dark and its rim is cropped: transform only the lit part.
        rows = torch.fft.fft(pupil, n=camera.grid, dim=-1)
        rows = rows[..., : camera.crop]
        field = torch.fft.fft(rows, n=camera.grid, dim=-2)
        field = field[:, : camera.crop]
        power = field.real * field.real
        power += field.imag * field.imag
        power = power.reshape(n, camera.polarisations, *power.shape[1:])
        total = power[:, 0]
        if camera.polarisations == 2:
            total = total + power[:, 1]
        return total.mul_(self._gain)

    def expose(
        self, intensity: Tensor, streams: Sequence[np.random.Generator]
    ) -> Tensor:
        """uint8 [n, crop, crop], with one random stream per frame."""
        camera = self.camera
        per_electron = camera.grey / camera.photons
        if camera.read_noise / per_electron < CONTINUOUS:
            electrons = intensity.to("cpu", torch.float64) * camera.photons
            counts = []
            for stream, mean in zip(streams, electrons.numpy(), strict=True):
                counts.append(stream.poisson(mean))
            grey = torch.from_numpy(np.stack(counts) * per_electron).to(intensity)
            if camera.read_noise:
                grey = grey + camera.read_noise * self._normal(intensity, streams)
            return _quantise(grey)
        z = self._normal(intensity, streams)
        mean = intensity * camera.grey
        shot = mean * per_electron  # variance of the shot noise in grey²
        variance = shot + camera.read_noise**2
        # s·γ/6 = κ3/(6·s²), κ3 = shot·per_electron.
        bend = shot.mul_(per_electron / 6).div_(variance)
        mean += variance.sqrt_().mul_(z)
        mean += bend.mul_(z.square_().sub_(1))
        return _quantise(mean)

    def _normal(
        self,
        like: Tensor,
        streams: Sequence[np.random.Generator],
    ) -> Tensor:
        """Standard normal, drawn on the CPU so that every device shows the same noise."""
        noise = np.empty(like.shape, dtype=np.float32)
        for out, stream in zip(noise, streams, strict=True):
            stream.standard_normal(dtype=np.float32, out=out)
        return torch.from_numpy(noise).to(like.device)


def _quantise(grey: Tensor) -> Tensor:
    return grey.round_().clamp_(0, 255).to(torch.uint8)
