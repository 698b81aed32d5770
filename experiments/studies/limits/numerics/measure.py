"""Error against CPU time of phases of many turns and of mean correlations."""

from __future__ import annotations

import time
import timeit
from collections.abc import Callable, Iterator
from decimal import Decimal, localcontext
from functools import partial
from typing import Any, ClassVar, NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from experiments.protocol.task import Context, Row, Task
from experiments.studies.correlation.pairs import (
    mean_pair_correlations,
    pair_correlations_double_sum,
)
from scenes.sensor.camera import Camera, MountedCamera
from scenes.sensor.seeds import stream

Samples = NDArray[Any]
PRECISIONS = "float32", "float64"


class Numerics(Task, frozen=True):
    """One row: a method on one input. Columns: ``input``, ``method``, ``number`` (its precision),
    ``error`` against an exact reference, ``time_s``, ``tolerance``, the error that it may have, and
    of what this project uses ``verdict``: whether it ``holds`` or ``fails``.
    Arguments: configs/experiment/numerics.yaml.
    """

    revision: ClassVar = 1

    samples: int
    pixels: int
    repeats: int

    def rows(self, context: Context) -> Iterator[Row]:
        # Of numpy and torch: waiting threads would count as CPU time.
        with threadpool_limits(1):
            for way in (*phases(), *correlations(self.samples, self.pixels)):
                row = way.row()
                times = timeit.repeat(
                    way.call, timer=time.process_time, number=1, repeat=self.repeats
                )
                yield row | {"time_s": min(times)}


class Way(NamedTuple):
    """A method on one input in one precision, the exact result, and the error that it may have."""

    input: str
    method: str
    number: str
    exact: Any
    tolerance: float
    call: Callable[[], Any]

    def row(self) -> Row:
        """The root mean square error, and the verdict."""
        apart = np.asarray(self.call()) - self.exact
        error = float(np.sqrt(np.mean(apart**2)))
        verdict = "holds" if error <= self.tolerance else "fails"
        is_ours = self.number == "float64" and self.method != DOUBLE_SUM
        return {
            "input": self.input,
            "method": self.method,
            "number": self.number,
            "error": error,
            "tolerance": self.tolerance,
            "verdict": verdict if is_ours else "",
        }


def phases() -> Iterator[Way]:
    """A frame of the camera, whose 62,856 phases reach 10⁵, 10⁶ and 10⁷ rad, in mean intensities;
    the camera itself is asked, by phases in two precisions, of which the scenes use float64.

    The tolerance is the camera's read noise. The reference is the definition with the mantissa of
    ``numpy.longdouble``.
    """
    camera = Camera()
    mounted = MountedCamera(camera, torch.device("cpu"))
    noise = camera.read_noise / camera.grey
    for largest in (1e5, 1e6, 1e7):
        drawn = stream(2, "numerics").uniform(-largest, largest, camera.path_count)
        exact = exact_intensity(camera, drawn)
        for number in PRECISIONS:
            given = torch.from_numpy(drawn.astype(number).astype(np.float64))
            call = partial(mounted.intensity, given[None])
            yield Way("phases", f"to {largest:.0e} rad", number, exact, noise, call)


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


def correlations(n: int, d: int) -> Iterator[Way]:
    """C_ll; the tolerance is half of the last digit that the paper prints."""
    frames = flat(n, d)
    exact = exact_mean(frames)
    for method, form in FORMS.items():
        for number in PRECISIONS:
            call = partial(form, frames, frames, number)
            yield Way("mean 10⁶ × deviation", method, number, exact, 5e-4, call)


def flat(n: int, d: int) -> Samples:
    """Frames uint16 [n, d] of 65,000 with one pixel in 236 brighter by one, half of them shared."""
    rng = stream(1, "numerics")
    rare = rng.integers(0, 236, (n, d)) == 0
    rare[:, ::2] = rare[0, ::2]
    return (65_000 + rare).astype(np.uint16)


def exact_mean(frames: Samples) -> float:
    """C_ll of integer frames [N_s, D] by integer sums and roots of 50 digits."""
    # Less its minimum, a frame has the same covariances.
    rows = frames.astype(np.int64) - frames.min(1, keepdims=True)
    sums = rows.sum(1).astype(object)
    products = (rows @ rows.T).astype(object)
    covariance = rows.shape[1] * products - np.outer(sums, sums)
    with localcontext(prec=50):
        root = np.array([Decimal(one).sqrt() for one in covariance.diagonal()])
        of_pairs = (covariance / np.outer(root, root))[np.triu_indices(len(rows), 1)]
        return float(of_pairs.sum() / len(of_pairs))


DOUBLE_SUM = "double sum"
FORMS: dict[str, Callable[..., float]] = {
    DOUBLE_SUM: pair_correlations_double_sum,
    "class sum": mean_pair_correlations,
}
