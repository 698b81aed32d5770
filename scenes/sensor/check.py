"""The sensor against theory: ``python -m scenes.sensor.check``.

Writes ``results/sensor_check.csv`` (one law a row: theory, measured, tolerance, verdict),
``results/sensor_precision.csv`` with a figure (error against run time of every knob that buys
accuracy, and run time against size), and ``results/sensor_footprint.csv`` (what each scene imports,
allocates and takes a frame). Exits with 1 if a law does not hold.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import torch
from scipy import stats

from scenes.sensor import precision
from scenes.sensor.calibrate import RESULTS, write
from scenes.sensor.camera import Camera
from scenes.sensor.elastomer import Layer, half_space
from scenes.sensor.environment import Thermal
from scenes.sensor.seeds import stream

CPU = torch.device("cpu")
A = 2.45e-3
Law = tuple[str, str, float, float, float]  # part, law, theory, measured, tolerance


def intensities(camera: Camera, n: int, seed: int = 0) -> np.ndarray:
    """Independent noiseless frames float64 [n, H, W]."""
    phases = stream(seed, "check").uniform(0, 2 * np.pi, (n, camera.path_count))
    return camera.on(CPU).intensity(torch.from_numpy(phases)).double().numpy()


def contrast() -> Iterator[Law]:
    for modes in (1, 2):
        i = intensities(Camera(grid=256, crop=256, pupil=80, polarisations=modes, unevenness=0), 60)
        name = f"contrast of {modes} polarisation{'s' * (modes > 1)}: 1/√M"
        yield "speckle", name, 1 / np.sqrt(modes), float(i.std() / i.mean()), 0.01
        apart = stats.kstest(i[:, ::12, ::12].ravel(), stats.gamma(modes, scale=1 / modes).cdf)
        name = f"intensity is gamma distributed, M = {modes}: Kolmogorov-Smirnov distance"
        yield "speckle", name, 0.0, float(apart.statistic), 0.015


def autocovariance() -> Iterator[Law]:
    camera = Camera(grid=256, crop=256, pupil=100, polarisations=1, unevenness=0)
    i = intensities(camera, 60) - 1
    found = np.fft.ifft2(np.mean(np.abs(np.fft.fft2(i)) ** 2, 0)).real
    pupil = np.zeros((256, 256))
    pupil[:100, :100] = camera.disc
    theory = np.abs(np.fft.ifft2(pupil)) ** 2
    for lag in (1, 2, 4):
        name = f"autocovariance at {lag} px: |FT(pupil)|²"
        pair = float(theory[0, lag] / theory[0, 0]), float(found[0, lag] / found[0, 0])
        yield "speckle", name, *pair, 0.015


def decorrelation() -> Iterator[Law]:
    """A pure temperature step: Siegert relation, for a Gaussian S the closed form."""
    camera = Camera(grid=256, crop=256, pupil=128, unevenness=0)
    mounted = camera.on(CPU)
    frames = 12
    start = stream(1, "check").uniform(0, 2 * np.pi, (frames, camera.path_count))
    before = mounted.intensity(torch.from_numpy(start)).numpy().ravel()
    for thermal, steps in ((Thermal(124, 0, 1e9), (0.004, 0.01)), (Thermal(), (0.02, 0.2, 0.55))):
        s = thermal.draw(frames * camera.path_count, stream(2, "check")).reshape(start.shape)
        for step in steps:
            after = mounted.intensity(torch.from_numpy(start + s * step)).numpy().ravel()
            found = float(np.corrcoef(before, after)[0, 1])
            if thermal.spread == 0:
                name, theory = "Gaussian S: e^{−(σT)²}", float(np.exp(-((124 * step) ** 2)))
            else:
                name, theory = "calibrated S: (E cos ST)²", float(np.mean(np.cos(s * step)) ** 2)
            yield "speckle", f"decorrelation by {step:g} K, {name}", theory, found, 0.015


def floor() -> Iterator[Law]:
    i = intensities(Camera(), 8).reshape(8, -1)
    found = float(np.corrcoef(i)[np.triu_indices(8, 1)].mean())
    w, c = 0.275**2, 0.5
    yield "speckle", "correlation of unrelated frames", w / (w + c * (1 + w)), found, 0.01


def bits() -> Iterator[Law]:
    """Correlation of bits over that of intensities, for gamma intensities of shape M.

    To first order in the correlation (Laguerre expansion of Kibble's bivariate gamma distribution)
    the ratio is 4·(m^M·e^{−m}/Γ(M))²/M, m the median: 0.48, 0.55, 0.59 for M = 1, 2, 4, and 2/π
    (the arcsine law) for many. It grows with the correlation.
    """
    camera = Camera(grid=256, crop=256, pupil=128, unevenness=0)
    start = stream(4, "check").uniform(0, 2 * np.pi, (40, camera.path_count))
    other = stream(5, "check").uniform(0, 2 * np.pi, start.shape)
    shared = stream(6, "check").random(start.shape) < 0.3  # field correlation 0.3, intensity 0.09
    mounted = camera.on(CPU)
    pair = [
        mounted.intensity(torch.from_numpy(phases)).numpy().reshape(40, -1)
        for phases in (start, np.where(shared, start, other))
    ]
    ones = [frames > np.median(frames, axis=1, keepdims=True) for frames in pair]
    found = float(np.corrcoef(ones[0].ravel(), ones[1].ravel())[0, 1])
    found /= float(np.corrcoef(pair[0].ravel(), pair[1].ravel())[0, 1])
    m = stats.gamma(2).median()
    yield (
        "hypervector",
        "bit / intensity correlation at 0.09",
        2 * (m**2 * np.exp(-m)) ** 2,
        found,
        0.03,
    )


def elasticity() -> Iterator[Law]:
    r = np.array([0.0, 0.5, 2.0, 20.0]) * A
    outer = np.maximum(r, A)
    tail = (2 * A**2 - outer**2) * np.arcsin(A / outer) + A * np.sqrt(outer**2 - A**2)
    hertz = np.where(r <= A, 1 - r**2 / (2 * A**2), tail / (np.pi * A**2))
    surface = half_space(r, np.array(0.0), A)[0]
    for at, theory, found in zip(r / A, hertz, surface / surface[0], strict=True):
        yield "layer", f"half-space at r = {at:g} a: Hertz", float(theory), float(found), 1e-8
    _, thick = Layer(thickness=100.0).displacement(np.array([20 * A]), np.array([100.0]), A)
    boussinesq = 4 / (3 * np.pi) / 20
    yield "layer", "thick layer at r = 20 a: Boussinesq", boussinesq, -float(thick[0, 0]), 2e-4
    radii = np.linspace(0, 0.12, 6001)
    layer = Layer()
    flow = layer.displacement(radii, np.array([layer.thickness]), A)[1][:, 0] * radii
    kept = float(np.trapezoid(flow, radii) / np.trapezoid(np.abs(flow), radii))
    yield "layer", "volume squeezed out / volume moved", 0.0, kept, 1e-4
    base = np.abs(layer.displacement(radii[::50], np.zeros(1), A)).max()
    yield "layer", "displacement at the base", 0.0, float(base), 1e-12
    for thickness in (1e-5, 1e-3, 1.0):
        sunk = -Layer(thickness=thickness).displacement(np.zeros(1), np.array([thickness]), A)[1]
        yield "layer", f"indentation, layer of {thickness:g} m", 1.0, float(sunk[0, 0]), 1e-5


LAWS: tuple[Callable[[], Iterator[Law]], ...] = (
    contrast,
    autocovariance,
    decorrelation,
    floor,
    bits,
    elasticity,
)


def laws() -> list[dict[str, Any]]:
    """Every law with its verdict."""
    lines = []
    for law in LAWS:
        start = time.perf_counter()
        found = list(law())
        spent = (time.perf_counter() - start) / len(found)
        for part, name, theory, measured, tolerance in found:
            lines.append(
                {
                    "part": part,
                    "law": name,
                    "theory": f"{theory:.6g}",
                    "measured": f"{measured:.6g}",
                    "tolerance": f"{tolerance:g}",
                    "holds": "yes" if abs(theory - measured) <= tolerance else "no",
                    "time_s": f"{spent:.3g}",
                    "command": "python -m scenes.sensor.check",
                }
            )
    return lines


def main() -> None:
    argparse.ArgumentParser(description=(__doc__ or "").split("\n\n")[0]).parse_args()
    found = laws()
    write(RESULTS / "sensor_check.csv", found)
    for line in found:
        print(f"{line['law']:68} {line['theory']:>12} {line['measured']:>12} {line['holds']}")
    precision.report(RESULTS)
    sys.exit(any(line["holds"] == "no" for line in found))


if __name__ == "__main__":
    main()
