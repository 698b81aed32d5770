"""What accuracy costs: ``experiment=numerics`` measures error against CPU time, three ways each.

- the field of a path whose phase is many turns, in float32, float64, and reduced in between;
- the mean correlations of Eq. 4 by the double sum, the Gram matrix and one class sum;
- the displacement table of the elastic layer, finer and finer.

Errors are against an exact reference; a tolerance is what the result is needed for.
"""

from __future__ import annotations

import itertools
import math
import time
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import DTypeLike, NDArray
from threadpoolctl import threadpool_limits
from torch import Tensor

from experiments.records.measurement import Row, measure
from experiments.studies.correlation.sums import (
    mean_pair_correlations,
    pair_correlations_double_sum,
)
from experiments.studies.stability.cases.correlations import exact_mean
from scenes.sensor.camera import Camera
from scenes.sensor.contact import EXPANSION
from scenes.sensor.elastomer import Layer
from scenes.sensor.paths import Paths, Table
from scenes.sensor.seeds import stream

A, DEPTH = 2.45e-3, 1.8e-3  # m, contact radius and indentation of the scene touch
Samples = NDArray[Any]


def run(
    samples: int = 100,
    pixels: int = 25_000,
    intervals: Sequence[int] = (25, 50, 100, 200, 400, 800, 1600),
    repeats: int = 3,
    force: bool = False,
) -> Path:
    """Measure all three and write ``measured/numerics-HASH/``.

    Args:
        samples, pixels: N_s and D of the mean correlations.
        intervals: intervals of the displacement table.
        repeats: of which the least CPU time counts.
        force: measure even if the same code did so before.
    """
    config = {
        "_target_": f"{__name__}.run",
        "samples": samples,
        "pixels": pixels,
        "intervals": list(intervals),
        "repeats": repeats,
    }

    def rows() -> Iterator[Row]:
        before = torch.get_num_threads()
        torch.set_num_threads(1)
        try:
            with threadpool_limits(1):  # of numpy: threads that wait would count as CPU time
                yield from phases(repeats)
                yield from correlations(samples, pixels, repeats)
                yield from layer_table(intervals, repeats)
        finally:
            torch.set_num_threads(before)

    return measure("numerics", config, rows, force=force)


def cpu_time(call: Callable[[], object], repeats: int) -> float:
    """Least CPU seconds of one call; a busy machine does not show in them."""
    call()
    spent = []
    for _ in range(repeats):
        start = time.process_time()
        call()
        spent.append(time.process_time() - start)
    return min(spent)


# Phases -------------------------------------------------------------------------------------------


def phases(repeats: int) -> Iterator[Row]:
    """Root mean square error of e^{iφ} for 62,856 phases of 10⁵, 10⁶ and 10⁷ rad.

    An error ε of each path changes an intensity by √2·ε of its mean; the tolerance is where that
    is the read noise of the camera. The reference has the mantissa of ``numpy.longdouble``.
    """
    camera = Camera()
    for largest in (1e5, 1e6, 1e7):
        drawn = stream(2, "numerics").uniform(-largest, largest, 62_856)
        phase, long = torch.from_numpy(drawn), drawn.astype(np.longdouble)
        real, imaginary = np.cos(long), np.sin(long)
        for method, form in FIELDS.items():
            field = form(phase).numpy()
            square = (field.real - real) ** 2 + (field.imag - imaginary) ** 2
            yield {
                "problem": "phases",
                "method": method,
                "input": f"{largest:.0e} rad",
                "error": float(np.sqrt(square.mean())),
                "time_s": cpu_time(partial(form, phase), repeats),
                "tolerance": camera.read_noise / camera.grey / math.sqrt(2),
                "reference": "cosine and sine with a mantissa of 64 bits",
            }


def field_of(phase: Tensor) -> Tensor:
    """e^{iφ} as complex64, in the precision of the phases."""
    return torch.complex(phase.cos().float(), phase.sin().float())


def reduced(phase: Tensor) -> Tensor:
    """The phases to one turn in float64, the rest in float32."""
    turns = phase * (1 / (2 * math.pi))
    return (turns - turns.floor()).mul_(2 * math.pi).float()


FIELDS: dict[str, Callable[[Tensor], Tensor]] = {
    "float32": lambda phase: field_of(phase.float()),
    "mixed": lambda phase: field_of(reduced(phase)),
    "float64": field_of,
}


# Mean correlations --------------------------------------------------------------------------------


def correlations(n: int, d: int, repeats: int) -> Iterator[Row]:
    """Error of C_ll; the tolerance is half of the last digit that the paper prints."""
    for name, frames in (("8-bit speckle", speckle(n, d)), ("mean 10⁶ × deviation", flat(n, d))):
        exact = exact_mean(frames)
        for method, number, form in FORMS:
            yield {
                "problem": "correlations",
                "method": f"{method}, {number}",
                "input": name,
                "error": abs(form(frames) - exact),
                "time_s": cpu_time(partial(form, frames), repeats),
                "tolerance": 5e-4,
                "reference": "integer sums, roots by mpmath",
            }


def speckle(n: int, d: int) -> Samples:
    """Frames uint8 [n, d] of mean 50 that share a fifth of their variance."""
    rng = stream(0, "numerics")
    shared, own = rng.gamma(0.4, 25, d), rng.gamma(1.6, 25, (n, d))
    return (shared + own).round().clip(0, 255).astype(np.uint8)


def flat(n: int, d: int) -> Samples:
    """Frames uint16 [n, d] of 65,000 with one pixel in 236 brighter by one, half of them shared."""
    rng = stream(1, "numerics")
    rare = rng.integers(0, 236, (n, d)) == 0
    rare[:, ::2] = rare[0, ::2]
    return (65_000 + rare).astype(np.uint16)


def gram(frames: Samples, dtype: DTypeLike) -> float:
    """Mean of the Gram matrix of standardised frames, off its diagonal: O(N²·D) operations."""
    x = frames.astype(dtype)
    z = (x - x.mean(1, keepdims=True)) / x.std(1, keepdims=True)
    return float((z @ z.T)[np.triu_indices(len(z), 1)].mean() / x.shape[1])


def compensated(frames: Samples) -> float:
    """The class sum in float32, with what rounding drops carried along (Kahan; fsum for sums)."""
    total = np.zeros(frames.shape[1], np.float32)
    lost, same = np.zeros_like(total), 0.0
    for frame in frames:
        x = frame.astype(np.float32)
        mean = math.fsum(x.tolist()) / len(x)
        high = np.float32(mean)
        z = (x - high) - np.float32(mean - float(high))
        z /= np.float32(math.sqrt(math.fsum((z * z).tolist())))
        same += math.fsum((z * z).tolist())
        term = z - lost
        grown = total + term
        lost, total = (grown - total) - term, grown
    square = math.fsum((total.astype(np.float64) ** 2).tolist())
    return (square - same) / (len(frames) * (len(frames) - 1))


FORMS: tuple[tuple[str, str, Callable[[Samples], float]], ...] = (
    ("double sum", "float32", lambda x: pair_correlations_double_sum(x, x, np.float32).value),
    ("double sum", "float64", lambda x: pair_correlations_double_sum(x, x).value),
    ("Gram matrix", "float32", lambda x: gram(x, np.float32)),
    ("Gram matrix", "float64", lambda x: gram(x, np.float64)),
    ("class sum", "float32", lambda x: mean_pair_correlations(x, x, np.float32).value),
    ("class sum", "compensated", compensated),
    ("class sum", "float64", lambda x: mean_pair_correlations(x, x).value),
)


# Elastic layer ------------------------------------------------------------------------------------


def layer_table(intervals: Sequence[int], repeats: int) -> Iterator[Row]:
    """Error of the vertical displacement from a table, per indentation, at 2000 radii.

    The tolerance is a phase of 0.05 rad, the bound on the expansion of a repeated touch.
    """
    layer, paths = Layer(), Paths()
    r = stream(0, "numerics").uniform(0, 40e-3, 2000)
    exact = layer.displacement(r, layer.heights, A)[1]
    levels = range(len(layer.heights))
    fresh = itertools.count(1)

    def make(n: int) -> None:  # tables are kept, so that only another layer makes a new one
        Layer(thickness=layer.thickness * (1 + 1e-13 * next(fresh))).table(A, n)

    for n in intervals:
        table = Table(layer.table(A, n), torch.float64, torch.device("cpu"))
        found = np.stack(
            [
                table.look_up(torch.from_numpy(r), torch.full((len(r),), level))[1]
                for level in levels
            ],
            axis=1,
        )
        spent = cpu_time(partial(make, n), repeats)
        difference = np.abs(found - exact)
        for method, error in (
            ("largest", difference.max()),
            ("root mean square", np.sqrt(np.mean(difference**2))),
        ):
            yield {
                "problem": "layer",
                "method": method,
                "input": n,
                "error": float(error),
                "time_s": spent,
                "tolerance": EXPANSION / (paths.wavenumber * DEPTH),
                "reference": "Layer.displacement, integrated at each radius",
            }
