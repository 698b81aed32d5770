"""The routes of every operation, on the same bytes, in interleaved repetitions.

Each result is compared with a reference before its route is timed; a route with another result is
not timed, and fails the benchmark at its end. The routes of an operation at one size then run in
turns (A B C A B C), so that a busy machine slows all alike: a ratio to ours is the median over the
turns.
"""

import gc
import importlib.util
import itertools
import math
import time
import timeit

import numpy as np
import pandas as pd

from tests.benchmark import routes
from tests.benchmark.routes import OURS, OURS_COMPILED, OURS_GPU

SIZE = ("operation", "n", "d", "l")
HEADLINE = {"n": 400, "d": 250_000, "l": 5}
STEPS = (  # each in every combination of its lists
    (["encode", "train"], [40, 400], [10_000, 250_000], [5]),
    (["bundle"], [40, 400], [10_000, 250_000], [5]),
    (["bundle"], [400], [10_000, 250_000], [51]),
    (["hamming"], [100], [10_000, 250_000], [5, 51]),  # queries
    (["predict"], [1], [10_000, 250_000], [5, 51]),
    (["encode"], [4], [12_000_000], [5]),  # 4000 × 3000 pixels
    (["predict"], [1], [12_000_000], [5]),
    (["folder"], [400], [250_000], [5]),  # 500 × 500 pixels, on disk
)
GOALS = (
    # operation, numerator, denominator, bound, limit
    ("bundle", routes.TORCHHD_BUNDLE, OURS_COMPILED, "≥", 200),
    ("train", routes.TORCHHD_TRAIN, OURS_COMPILED, "≥", 80),
    ("train", OURS_COMPILED, routes.READ, "≤", 1.3),
    ("hamming", OURS_COMPILED, routes.NUMKONG, "≤", 1.1),
    ("folder", routes.DECODE_IMAGES, OURS_COMPILED, "≥", 0.9),
)
# Shorter calls are repeated, so that each finds its own data in the caches.
_SAMPLE_S = 20e-3
BUDGET_S = 0.4  # of a route at a size; seven turns at least


def sizes():
    """Operation and size of each step."""
    for step in STEPS:
        for size in itertools.product(*step):
            yield dict(zip(SIZE, size, strict=True))


def measure(case, budget_s=BUDGET_S):
    """A row for each route of the case's operation: ``route``, ``median_s`` and ``min_s`` of
    ``samples`` turns, ``ratio_to_ours``, ``equal_result`` and ``status``."""
    rows, samplers = [], {}
    gc.collect()  # memory of the size before
    size = {key: getattr(case, key) for key in SIZE}
    for route in routes.OPERATIONS[case.operation](case):
        row = {**size, "route": route.name, **check(route, case)}
        rows.append(row)
        if row["status"] == "ok":
            samplers[route.name] = sampler(route.call)
    times = _timed(samplers, budget_s * len(samplers))
    for row in rows:
        if (seconds := times.get(row["route"])) is not None:
            row |= {"median_s": np.median(seconds), "min_s": seconds.min()}
            row["samples"] = len(seconds)
            if OURS in times:
                row["ratio_to_ours"] = np.median(seconds / times[OURS])
    return rows


def _timed(samplers, budget_s):
    """Seconds of each route in interleaved repetitions: at least seven, and up to thirty within
    the budget. All routes so meet the same states of the machine."""
    turns = []
    deadline = time.perf_counter() + budget_s
    while len(turns) < 30:
        if len(turns) >= 7 and time.perf_counter() >= deadline:
            break
        turns.append([sample() for sample in samplers.values()])
    return dict(zip(samplers, np.array(turns).T, strict=True))


def check(route, case):
    """Whether a route can be timed: its status, and how its result compares with the reference."""
    if importlib.util.find_spec(route.module) is None:
        return {"status": "not installed", "equal_result": ""}
    if route.name in routes.NO_RESULT:
        return {"status": "ok", "equal_result": ""}
    verdict = case.verdict(routes.common_form(case, route.call))
    is_ours = route.name in (OURS, OURS_COMPILED, OURS_GPU)
    exact = verdict != "yes, ties aside" or not is_ours
    right = verdict != "no" and exact  # ours is specified to the last bit
    return {"status": "ok" if right else "wrong result", "equal_result": verdict}


def sampler(call):
    """A function that gives the seconds of a call, the mean over 20 ms of short ones."""
    timer = timeit.Timer(call)
    shortest = max(min(timer.repeat(3, 1)), 1e-7)
    repeats = max(1, math.ceil(_SAMPLE_S / shortest))
    return lambda: timer.timeit(repeats) / repeats


def goals(rows):
    """A line for each goal that was measured: what was wanted, what came, whether it was met."""
    found = []
    single = of_route(rows, "predict", OURS_COMPILED)
    if single is not None:
        value = 1e3 * single.median_s
        found.append(("predict one frame: hdc, compiled, ms", "≤", 0.12, value))
    for operation, over, under, bound, limit in GOALS:
        # Both were timed in interleaved repetitions with ours.
        one, other = (of_route(rows, operation, route) for route in (over, under))
        if one is not None and other is not None:
            value = one.ratio_to_ours / other.ratio_to_ours
            found.append((f"{operation}: {over}, × {under}", bound, limit, value))
    table = []
    for goal, bound, limit, value in found:
        met = value >= limit if bound == "≥" else value <= limit
        wanted, measured = f"{bound} {limit:g}", f"{value:.3g}"
        row = (goal, wanted, measured, "yes" if met else "no")
        table.append(dict(zip(("Goal", "Wanted", "Measured", "Met"), row, strict=True)))
    return pd.DataFrame(table)


def of_route(rows, operation, route):
    """The row of a route at the headline's size, or at the only one that was measured."""
    rows = rows[(rows.operation == operation) & (rows.route == route)]
    for key, value in HEADLINE.items():
        if rows[key].nunique() > 1:
            rows = rows[rows[key] == value]
    return rows.iloc[0] if len(rows) else None
