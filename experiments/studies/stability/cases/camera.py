"""The camera: phases of many turns, light of all strengths, pupils of all sizes."""

from __future__ import annotations

from functools import partial
from typing import Any

import mpmath
import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from experiments.studies.stability.case import Trial, case
from experiments.studies.stability.cases.prototypes import touch
from experiments.studies.stability.cases.speckle import CPU, intensities
from hdc import HDCClassifier
from scenes.sensor.camera import Camera
from scenes.sensor.seeds import stream

sensor_case = partial(case, "sensor")

# Phases -------------------------------------------------------------------------------------------


def phases(largest: float, side: int) -> Trial:
    """Intensities of one frame from phases of this size, beside cosines and sines by mpmath."""
    camera = Camera(grid=side, crop=side, pupil=side * 2 // 5, unevenness=0)
    drawn = stream(2, "stability").uniform(-largest, largest, camera.path_count)
    mounted = camera.on(CPU)

    def intensity(field: NDArray[Any]) -> NDArray[Any]:
        pupil = np.zeros((2, *camera.disc.shape), field.dtype)
        pupil[:, camera.disc] = field.reshape(2, -1)
        speckle = np.fft.fft2(pupil, (side, side))
        return (np.abs(speckle) ** 2).sum(0) / camera.path_count

    exact = intensity(
        np.array([complex(mpmath.cos(p), mpmath.sin(p)) for p in map(mpmath.mpf, drawn.tolist())])
    )

    def naive() -> NDArray[Any]:
        single = drawn.astype(np.float32)
        return intensity(np.cos(single) + 1j * np.sin(single))

    return Trial(
        naive=naive,
        ours=lambda: mounted.intensity(torch.from_numpy(drawn[None]))[0].numpy(),
        error=lambda found: float(np.abs(found - exact).max()),
    )


PHASES: dict[str, Any] = {
    "expected": "six digits of the mean: float64 phases lose nothing, the transform is in float32",
    "reference": "mpmath, transformed in float64",
    "unit": "of the mean intensity",
    "naive": "phases in float32",
    "ours": "MountedCamera.intensity",
    "tolerance": 1e-5,
    "small": {"side": 32},
}


@sensor_case(extreme="phases up to 10^5 rad: float32 keeps 0.004 rad", **PHASES)
def phases_of_a_hundred_thousand_rad(side: int = 256) -> Trial:
    return phases(1e5, side)


@sensor_case(extreme="phases up to 10^6 rad: float32 keeps 0.03 rad", **PHASES)
def phases_of_a_million_rad(side: int = 256) -> Trial:
    return phases(1e6, side)


@sensor_case(extreme="phases up to 10^8 rad: float32 keeps 4 rad, all of a turn", **PHASES)
def phases_of_a_hundred_million_rad(side: int = 256) -> Trial:
    return phases(1e8, side)


# Camera -------------------------------------------------------------------------------------------


def stretched(image: Tensor) -> Tensor:
    """An image scaled to its own range, as is usual before it is made 8-bit."""
    return (image - image.min()) / (image.max() - image.min())


@sensor_case(
    extreme="one path: a frame without speckle",
    expected="intensity 1 everywhere; an image stretched to its range is 0/0",
    reference="|e^{iφ}|² = 1",
    unit="of the mean intensity",
    naive="stretched to its own range",
    ours="MountedCamera.intensity",
    tolerance=1e-6,
)
def one_path() -> Trial:
    camera = Camera(grid=64, crop=64, pupil=1, polarisations=1, unevenness=0)
    phase = torch.tensor([[123.456]], dtype=torch.float64)
    mounted = camera.on(CPU)
    return Trial(
        naive=lambda: stretched(mounted.intensity(phase)),
        ours=lambda: mounted.intensity(phase),
        error=lambda found: float((found - 1).abs().max()),
    )


@sensor_case(
    extreme="no light, no read noise",
    expected="zero everywhere; a stretched image is 0/0",
    reference="zero",
    unit="wrong pixels",
    naive="stretched to its own range",
    ours="MountedCamera.expose",
)
def no_light(side: int = 64) -> Trial:
    camera = Camera(grid=side, crop=side, pupil=25, photons=0, read_noise=0, unevenness=0)
    mounted = camera.on(CPU)
    light = torch.ones(1, side, side)
    return Trial(
        naive=lambda: stretched(0 * light),
        ours=lambda: mounted.expose(light, [stream(0, "stability")]),
        error=lambda image: int((image != 0).sum()),
    )


@sensor_case(
    extreme="exposed 80 times too long: grey levels up to 10^5",
    expected="255 where the electrons say so; a cast to 8 bits wraps",
    reference="the same Poisson numbers, clipped as integers",
    unit="grey levels",
    naive="round, cast to uint8",
    ours="MountedCamera.expose",
)
def saturation(side: int = 256, photons: float = 3000.0, grey: float = 4000.0) -> Trial:
    camera = Camera(grid=side, crop=side, pupil=80, photons=photons, grey=grey, read_noise=0)
    mounted = camera.on(CPU)
    light = torch.from_numpy(intensities(camera, 1)).float()
    electrons = stream(0, "stability").poisson(light[0].double().numpy() * photons)
    levels = np.rint(electrons * (grey / photons))
    return Trial(
        naive=lambda: levels.astype(np.int64).astype(np.uint8),
        ours=lambda: mounted.expose(light, [stream(0, "stability")])[0].numpy(),
        error=lambda image: float(np.abs(image - np.minimum(levels, 255)).max()),
    )


@sensor_case(
    extreme="one photon a pixel, speckle of two polarisations",
    expected="4/9 of the pixels dark (Mandel's formula); Gaussian shot noise is not Poisson's",
    reference="(1 + ⟨n⟩/M)^-M at ⟨n⟩ = 1, M = 2",
    unit="share of dark pixels",
    naive="round(I + √I·ξ)",
    ours="MountedCamera.expose",
    tolerance=0.005,
    small={"frames": 20},
)
def one_photon_a_pixel(frames: int = 60) -> Trial:
    camera = Camera(grid=256, crop=256, pupil=80, unevenness=0, photons=1, grey=1, read_noise=0)
    mounted = camera.on(CPU)
    light = torch.from_numpy(intensities(camera, frames)).float()

    def naive() -> Tensor:
        noise = stream(0, "stability").standard_normal(light.shape, np.float32)
        return (light + light.sqrt() * torch.from_numpy(noise)).round().clamp(0, 255)

    return Trial(
        naive=naive,
        ours=lambda: mounted.expose(light, [stream(0, "stability", i) for i in range(frames)]),
        error=lambda image: abs(float((image == 0).double().mean()) - 4 / 9),
    )


@sensor_case(
    extreme="frames of 1 × 1 pixel, from a pupil of one",
    expected="made, learnt (⌊1/2⌋ = 0 ones), and all of one class; standardised they are 0/0",
    reference="the lowest class",
    unit="queries",
    naive="(frame − mean) / std, nearest mean",
    ours="SpeckleScene, HDCClassifier",
)
def frames_of_one_pixel() -> Trial:
    def made() -> tuple[Tensor, NDArray[Any]]:
        scene = touch(0, grid=1, crop=1, pupil=1)
        return scene.frames(np.arange(100)), scene.labels[:100]

    def naive() -> NDArray[Any]:
        x = made()[0].flatten(1).numpy().astype(float)
        with np.errstate(all="ignore"):
            z = (x - x.mean(1, keepdims=True)) / x.std(1, keepdims=True)
        return np.where(np.isnan(z[:, 0]), -1, 0)  # no class is nearest to NaN

    def ours() -> NDArray[Any]:
        frames, labels = made()
        return HDCClassifier().fit(frames, labels).predict(frames)

    return Trial(naive=naive, ours=ours, error=lambda found: int((found != 0).sum()))
