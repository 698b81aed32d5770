"""The routes of every operation, on the same bytes, in interleaved repetitions.

Each result is compared with a reference before its route is timed; a route with another result is
not timed, and fails the experiment at its end. The routes of an operation at one size then run in
turns (A B C A B C), so that a busy machine slows all alike: a ratio to ours is the median over the
turns. With ``device=cuda`` there are routes on the GPU beside them.
"""

from __future__ import annotations

import functools
import gc
import importlib.util
import itertools
import math
import time
import timeit
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from experiments.protocol.experiment import Row, Run, experiment
from experiments.studies.benchmark.cases import Case
from experiments.studies.benchmark.names import NO_RESULT, OURS, OURS_COMPILED, OURS_GPU
from experiments.studies.benchmark.routes import OPERATIONS, Route, common_form

SIZE = ("operation", "n", "d", "l")
# Shorter calls are repeated, so that each finds its own data in the caches.
_SAMPLE_S = 20e-3


@experiment(revision=2, uses=("hdc.HDCClassifier",), timed=True)
def benchmark(
    run: Run,
    steps: Sequence[Mapping[str, Any]],
    budget_s: float,
    seed: int,
) -> Iterator[Row]:
    """One row: a route at one size.

    ``operation``, ``route``; ``n`` frames (of ``hamming``, queries), ``d``, ``l``; ``median_s`` and
    ``min_s`` of ``samples`` turns; ``ratio_to_ours``; ``equal_result``; ``status``.
    Arguments: configs/experiment/benchmark.yaml.

    Raises:
        RuntimeError: at the end, if a route gave another result.
    """
    wrong = []
    for step in steps:
        for size in itertools.product(*(step[key] for key in SIZE)):
            key = dict(zip(SIZE, size, strict=True))
            case = Case(**key, seed=seed, device=run.device)
            compute = functools.partial(measure, case, budget_s)
            for row in run.part(key, compute):
                yield row
                if row["status"] == "wrong result":
                    wrong.append(f"{row['operation']} by {row['route']}")
    if wrong:
        raise RuntimeError(
            f"benchmark: expected right results, found wrong ones of {wrong}"
        )


def measure(case: Case, budget_s: float) -> list[Row]:
    """A row for each route of the case's operation."""
    rows: list[Row] = []
    samplers: dict[str, Callable[[], float]] = {}
    gc.collect()  # memory of the size before
    for route in OPERATIONS[case.operation](case):
        row = {key: getattr(case, key) for key in SIZE}
        row |= {"route": route.name, **check(route, case)}
        rows.append(row)
        if row["status"] == "ok":
            samplers[route.name] = sampler(route.call)
    times = _timed(samplers, budget_s * len(samplers))
    for row in rows:
        if row["route"] in samplers:
            seconds = times[row["route"]]
            row["median_s"] = float(np.median(seconds))
            row["min_s"] = float(seconds.min())
            row["samples"] = len(seconds)
            if OURS in samplers:
                ratios = seconds / times[OURS]
                row["ratio_to_ours"] = float(np.median(ratios))
    return rows


def _timed(
    samplers: Mapping[str, Callable[[], float]], budget_s: float
) -> dict[str, np.ndarray]:
    """Seconds of each route in interleaved repetitions: at least seven, and up to thirty within
    the budget. All routes so meet the same states of the machine."""
    turns: list[list[float]] = []
    deadline = time.perf_counter() + budget_s
    while len(turns) < 30:
        if len(turns) >= 7 and time.perf_counter() >= deadline:
            break
        turns.append([sample() for sample in samplers.values()])
    return dict(zip(samplers, np.array(turns).T, strict=True))


def check(route: Route, case: Case) -> Row:
    """Whether a route can be timed: its status, and how its result compares with the reference."""
    if importlib.util.find_spec(route.module) is None:
        return {"status": "not installed", "equal_result": ""}
    if route.name in NO_RESULT:
        return {"status": "ok", "equal_result": ""}
    verdict = case.verdict(common_form(case, route.call))
    is_ours = route.name in (OURS, OURS_COMPILED, OURS_GPU)
    exact = verdict != "yes, ties aside" or not is_ours
    right = verdict != "no" and exact  # ours is specified to the last bit
    return {"status": "ok" if right else "wrong result", "equal_result": verdict}


def sampler(call: Callable[[], Any]) -> Callable[[], float]:
    """A function that gives the seconds of a call, the mean over 20 ms of short ones."""
    timer = timeit.Timer(call)
    shortest = max(min(timer.repeat(3, 1)), 1e-7)
    repeats = max(1, math.ceil(_SAMPLE_S / shortest))
    return lambda: timer.timeit(repeats) / repeats
