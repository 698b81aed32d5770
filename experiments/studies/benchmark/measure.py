"""The routes of every operation beside one another, on the same bytes, in turns.

Each result is compared with a reference before its route is timed; a route with another result is
not timed, and fails the experiment at its end. The routes of an operation at one size then run in
turns (A B C A B C), so that a busy machine slows all alike: a ratio to ours is the median over the
turns. It measures the CPU.
"""

from __future__ import annotations

import contextlib
import ctypes
import functools
import gc
import importlib.util
import itertools
import math
import time
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from importlib import metadata
from pathlib import Path
from typing import Any

import numpy as np

from experiments.protocol.clock import timed
from experiments.protocol.experiment import Row, Run, experiment
from experiments.protocol.machine import peak_bytes, resident_bytes
from experiments.studies.benchmark import routes
from experiments.studies.benchmark.cases import Case
from experiments.studies.benchmark.routes import OPERATIONS, OURS, OURS_COMPILED, READ, Route

SIZE = ("operation", "n", "d", "l", "frames")
_SAMPLE_S = 20e-3  # shorter calls are repeated, so that each finds its own data in the caches
_START_PEAK_ANEW = Path("/proc/self/clear_refs")


@experiment
def benchmark(
    run: Run, steps: Sequence[Mapping[str, Any]], budget_s: float, seed: int
) -> Iterator[Row]:
    """One row: a route at one size.

    ``operation``, ``frames`` (their kind), ``route``, ``package``; ``n`` frames (of ``hamming``,
    queries), ``d``, ``l``; ``median_s`` and ``min_s`` of ``samples`` turns; ``ratio_to_ours``;
    ``peak_bytes`` that a call takes beyond its inputs; ``equal_result``; ``status``.
    Arguments: configs/experiment/benchmark.yaml; with ``peers: false`` a size is measured of ours
    and of one read of the bytes alone.

    Raises:
        RuntimeError: at the end, if a route failed or gave another result.
    """
    wrong = []
    for step in steps:
        lists = [step.get(key, ["speckle"]) for key in SIZE]
        for size in itertools.product(*lists):
            key = dict(zip(SIZE, size, strict=True))
            case, peers = Case(**key, seed=seed), step.get("peers", True)
            compute = functools.partial(measure, case, budget_s, peers)
            for row in run.part(key, compute):
                yield row
                if row["status"].startswith(("wrong", "failed")):
                    wrong.append(f"{row['operation']} by {row['route']} ({row['status']})")
    if wrong:
        raise RuntimeError(f"benchmark: expected right results, found {', '.join(wrong)}")


def measure(case: Case, budget_s: float, peers: bool = True) -> list[Row]:
    """A row for each route of the case's operation."""
    rows: list[Row] = []
    samplers: dict[str, Callable[[], float]] = {}
    gc.collect()  # memory of the size before
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # constant frames carry no information
        for route in OPERATIONS[case.operation](case):
            if not peers and route.name not in (OURS, OURS_COMPILED, READ):
                continue
            row = {key: getattr(case, key) for key in SIZE}
            row |= {"route": route.name, "package": package(route.module), **check(route, case)}
            rows.append(row)
            if row["status"] == "ok":
                row["peak_bytes"] = call_bytes(route.call)
                samplers[route.name] = sampler(route.call)
        turns: list[dict[str, float]] = []
        deadline = time.perf_counter() + budget_s * len(samplers)
        while len(turns) < 3 or (len(turns) < 30 and time.perf_counter() < deadline):
            turns.append({name: sample() for name, sample in samplers.items()})
    for row in rows:
        if row["route"] in samplers:
            seconds = np.array([turn[row["route"]] for turn in turns])
            row |= {"median_s": float(np.median(seconds)), "min_s": float(seconds.min())}
            row["samples"] = len(turns)
            if OURS in samplers:
                ours = np.array([turn[OURS] for turn in turns])
                row["ratio_to_ours"] = float(np.median(seconds / ours))
    return rows


def check(route: Route, case: Case) -> Row:
    """Whether a route can be timed: its status, and how its result compares with the reference."""
    if importlib.util.find_spec(route.module) is None:
        return {"status": "not installed", "equal_result": ""}
    try:
        if route.name in routes.LIMITS:
            result = route.call()
            if route.name == routes.DECODED and result != case.n:
                raise ValueError(f"expected {case.n} frames, found {result}")
            return {"status": "ok", "equal_result": ""}
        verdict = case.verdict(routes.common_form(case, route.call))
    except Exception as error:
        message = " ".join(str(error).split())
        return {"status": f"failed: {type(error).__name__}: {message}"[:200], "equal_result": ""}
    exact = verdict != "yes, ties aside" or route.name not in (OURS, OURS_COMPILED)
    right = verdict != "no" and exact  # ours is specified to the last bit
    return {"status": "ok" if right else "wrong result", "equal_result": verdict}


def sampler(call: Callable[[], Any]) -> Callable[[], float]:
    """A function that gives the seconds of a call, the mean over 20 ms of short ones."""
    first = min(timed(call) for _ in range(3))
    repeats = max(1, math.ceil(_SAMPLE_S / max(first, 1e-7)))

    def repeated() -> None:
        for _ in range(repeats):
            call()

    return lambda: timed(repeated) / repeats


def call_bytes(call: Callable[[], Any]) -> int | None:
    """Memory that a call takes beyond its inputs, its result included; None without /proc."""
    if not _START_PEAK_ANEW.exists():
        return None
    with contextlib.suppress(OSError, AttributeError):
        ctypes.CDLL(None).malloc_trim(0)  # so that the call cannot take freed memory unseen
    _START_PEAK_ANEW.write_text("5")
    before = resident_bytes() or 0
    result = call()
    taken = peak_bytes() - before
    del result
    return max(0, taken)


@functools.cache
def package(module: str) -> str:
    """Name and version of the distribution that brings a module, if it is installed."""
    names = metadata.packages_distributions().get(module, [])
    return f"{names[0]} {metadata.version(names[0])}" if names else ""
