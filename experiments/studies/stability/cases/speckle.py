"""Speckle statistics against the closed forms of the theory of speckle."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from scipy import ndimage, stats

from experiments.studies.stability.case import Trial, case
from scenes.sensor.camera import Camera
from scenes.sensor.environment import Thermal
from scenes.sensor.seeds import stream

Array = NDArray[np.float64]

sensor_case = partial(case, "sensor")

CPU = torch.device("cpu")
SMALLER: dict[str, Any] = {"small": {"frames": 20, "side": 128}}


def intensities(camera: Camera, n: int) -> Array:
    """Independent noiseless frames float64 [n, H, W], of mean one."""
    phases = stream(0, "speckle").uniform(0, 2 * np.pi, (n, camera.path_count))
    return camera.on(CPU).intensity(torch.from_numpy(phases)).double().numpy()


@sensor_case(
    extreme="M = 1 and 2 polarisations",
    expected="contrast 1/√M to 1 %; fields added instead of intensities always give 1",
    reference="1/√M",
    unit="contrast",
    naive="|E_1 + E_2|²",
    ours="Camera",
    tolerance=0.01,
    **SMALLER,
)
def contrast(frames: int = 60, side: int = 256) -> Trial:
    def contrasts(add: Callable[[int], Array]) -> list[float]:
        return [float(i.std() / i.mean()) for i in map(add, (1, 2))]

    def camera(m: int) -> Camera:
        pupil = side * 80 // 256
        return Camera(grid=side, crop=side, pupil=pupil, polarisations=m, unevenness=0)

    def coherent(m: int) -> Array:
        disc = camera(1).disc
        shape = (frames, m, int(disc.sum()))
        pupil = np.zeros((frames, *disc.shape), complex)
        pupil[:, disc] = np.exp(1j * stream(0, "stability").uniform(0, 2 * np.pi, shape)).sum(1)
        return np.abs(np.fft.fft2(pupil, (side, side))) ** 2

    return Trial(
        naive=lambda: contrasts(coherent),
        ours=lambda: contrasts(lambda m: intensities(camera(m), frames)),
        error=lambda c: max(abs(c[0] - 1), abs(c[1] - 1 / math.sqrt(2))),
    )


@sensor_case(
    extreme="the whole distribution of the intensity, its tails included",
    expected="a gamma distribution of shape M; a Gaussian of the same moments is negative",
    reference="Gamma(2), scale 1/2",
    unit="Kolmogorov-Smirnov distance",
    naive="1 + ξ/√2",
    ours="Camera",
    tolerance=0.015,
    **SMALLER,
)
def gamma_intensities(frames: int = 60, side: int = 256) -> Trial:
    camera = Camera(grid=side, crop=side, pupil=side * 80 // 256, unevenness=0)
    apart = side // 21  # more than a grain, so that the samples are nearly independent
    count = frames * len(range(0, side, apart)) ** 2
    return Trial(
        naive=lambda: 1 + stream(0, "stability").standard_normal(count) / math.sqrt(2),
        ours=lambda: intensities(camera, frames)[:, ::apart, ::apart].ravel(),
        error=lambda i: float(stats.kstest(i, stats.gamma(2, scale=0.5).cdf).statistic),
    )


@sensor_case(
    extreme="lags from 0 to 8 pixels, out to the side lobes",
    expected="|FT of the pupil|² to 0.015; blurred noise of the same width has no side lobes",
    reference="transform of the disc",
    unit="of the variance",
    naive="complex noise, Gaussian blur",
    ours="Camera",
    tolerance=0.015,
    **SMALLER,
)
def autocovariance(frames: int = 60, side: int = 256) -> Trial:
    camera = Camera(grid=side, crop=side, pupil=side * 100 // 256, polarisations=1, unevenness=0)
    pupil = np.zeros((side, side))
    pupil[: camera.pupil, : camera.pupil] = camera.disc
    theory = np.abs(np.fft.ifft2(pupil))[0, :9] ** 2
    theory /= theory[0]
    # Noise blurred with standard deviation s has the covariance e^{−x²/4s²}, its intensity
    # e^{−x²/2s²}; s makes it right at one pixel.
    width = 1 / math.sqrt(-2 * math.log(theory[1]))

    def covariance(i: Array) -> Array:
        power = np.mean(np.abs(np.fft.fft2(i / i.mean() - 1)) ** 2, 0)
        found = np.fft.ifft2(power).real[0, :9]
        return found / found[0]

    def blurred() -> Array:
        white = stream(0, "stability").standard_normal((2, frames, side, side))
        field = ndimage.gaussian_filter(white, (0, 0, width, width), mode="wrap")
        return covariance((field**2).sum(0))

    return Trial(
        naive=blurred,
        ours=lambda: covariance(intensities(camera, frames)),
        error=lambda found: float(np.abs(found - theory).max()),
    )


@sensor_case(
    extreme="a temperature step that leaves 40 % of the field's correlation",
    expected="the intensity keeps the square of it (Siegert), 16 %, to 0.015",
    reference="(E cos SΔT)², S the paths' sensitivities",
    unit="correlation",
    naive="the field's correlation",
    ours="Camera, Thermal",
    tolerance=0.015,
    small={"frames": 6},
)
def siegert_relation(frames: int = 12, step: float = 0.02) -> Trial:
    camera = Camera(grid=256, crop=256, pupil=128, unevenness=0)
    mounted = camera.on(CPU)
    count = frames * camera.path_count
    s = Thermal().draw(count, stream(2, "stability")).reshape(frames, -1)
    start = stream(1, "stability").uniform(0, 2 * np.pi, s.shape)
    field = float(np.mean(np.cos(s * step)))

    def ours() -> float:
        pair = [
            mounted.intensity(torch.from_numpy(p)).numpy().ravel()
            for p in (start, start + s * step)
        ]
        return float(np.corrcoef(pair)[0, 1])

    return Trial(naive=lambda: field, ours=ours, error=lambda found: abs(found - field**2))
