"""Error against CPU time of phases of many turns and of mean correlations."""

from __future__ import annotations

import math
import time
import timeit
from collections.abc import Callable, Iterator
from decimal import Decimal, localcontext
from functools import partial
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits
from torch import Tensor

from experiments.protocol.correlations import (
    mean_pair_correlations,
    pair_correlations_double_sum,
)
from experiments.protocol.experiment import Row, Run, experiment
from scenes.sensor.camera import Camera
from scenes.sensor.seeds import stream

Samples = NDArray[Any]


@experiment(revision=1)
def numerics(
    run: Run, samples: int = 100, pixels: int = 25_000, repeats: int = 3
) -> Iterator[Row]:
    """One row: a method on one input. Columns: ``input``, ``method``, ``number`` (its precision),
    ``error`` against an exact reference, ``time_s``, and ``tolerance``, the error that it may have.
    Arguments: configs/experiment/numerics.yaml.
    """
    with threadpool_limits(
        1
    ):  # of numpy and torch: waiting threads would count as CPU time
        for row, call in (*phases(), *correlations(samples, pixels)):
            call()
            times = timeit.repeat(
                call, timer=time.process_time, number=1, repeat=repeats
            )
            yield row | {"time_s": min(times)}


def phases() -> Iterator[tuple[Row, Callable[[], object]]]:
    """Root mean square error of e^{iφ} for 62,856 phases of 10⁵, 10⁶ and 10⁷ rad.

    An error ε of each path changes an intensity by √2·ε of its mean; the tolerance is where that is
    the camera's read noise. The reference has the mantissa of ``numpy.longdouble``.
    """
    camera = Camera()
    for largest in (1e5, 1e6, 1e7):
        drawn = stream(2, "numerics").uniform(-largest, largest, 62_856)
        phase, long = torch.from_numpy(drawn), drawn.astype(np.longdouble)
        for number, form in FIELDS.items():
            value = form(phase).numpy()
            square = (value.real - np.cos(long)) ** 2 + (value.imag - np.sin(long)) ** 2
            row: Row = {
                "input": "phases",
                "method": f"to {largest:.0e} rad",
                "number": number,
            }
            row["error"] = float(np.sqrt(square.mean()))
            row["tolerance"] = camera.read_noise / camera.grey / math.sqrt(2)
            yield row, partial(form, phase)


def field(phase: Tensor) -> Tensor:
    """e^{iφ} as complex64, in the precision of the phases."""
    return torch.complex(phase.cos().float(), phase.sin().float())


def mixed(phase: Tensor) -> Tensor:
    """The same of phases reduced modulo 2π in float64, the remainder in float32."""
    turns = phase * (1 / (2 * math.pi))
    return field((turns - turns.floor()).mul_(2 * math.pi).float())


FIELDS: dict[str, Callable[[Tensor], Tensor]] = {
    "float32": lambda phase: field(phase.float()),
    "mixed": mixed,
    "float64": field,
}


def correlations(n: int, d: int) -> Iterator[tuple[Row, Callable[[], object]]]:
    """Error of C_ll; the tolerance is half of the last digit that the paper prints."""
    for name, frames in (
        ("8-bit speckle", speckle(n, d)),
        ("mean 10⁶ × deviation", flat(n, d)),
    ):
        exact = exact_mean(frames)
        for method, number, form in FORMS:
            row = {"input": name, "method": method, "number": number, "tolerance": 5e-4}
            yield row | {"error": abs(form(frames) - exact)}, partial(form, frames)


def speckle(n: int, d: int) -> Samples:
    """Frames uint8 [n, d] of mean 50 that share a fifth of their variance."""
    rng = stream(0, "numerics")
    common, single = rng.gamma(0.4, 25, d), rng.gamma(1.6, 25, (n, d))
    return (common + single).round().clip(0, 255).astype(np.uint8)


def flat(n: int, d: int) -> Samples:
    """Frames uint16 [n, d] of 65,000 with one pixel in 236 brighter by one, half of them shared."""
    rng = stream(1, "numerics")
    rare = rng.integers(0, 236, (n, d)) == 0
    rare[:, ::2] = rare[0, ::2]
    return (65_000 + rare).astype(np.uint16)


def exact_mean(frames: Samples) -> float:
    """C_ll of integer frames [N_s, D] by integer sums and roots of 50 digits."""
    rows = frames.astype(np.int64) - frames.min(
        1, keepdims=True
    )  # changes no covariance
    sums = rows.sum(1).astype(object)
    covariance = rows.shape[1] * (rows @ rows.T).astype(object) - np.outer(sums, sums)
    with localcontext(prec=50):
        root = [Decimal(variance).sqrt() for variance in covariance.diagonal()]
        pairs = zip(*np.triu_indices(len(rows), 1), strict=True)
        values = [Decimal(covariance[i, j]) / (root[i] * root[j]) for i, j in pairs]
        return float(sum(values) / len(values))


FORMS: tuple[tuple[str, str, Callable[[Samples], float]], ...] = (
    ("double sum", "float32", lambda x: pair_correlations_double_sum(x, x, np.float32)),
    ("double sum", "float64", lambda x: pair_correlations_double_sum(x, x)),
    ("class sum", "float32", lambda x: mean_pair_correlations(x, x, np.float32)),
    ("class sum", "float64", lambda x: mean_pair_correlations(x, x)),
)
