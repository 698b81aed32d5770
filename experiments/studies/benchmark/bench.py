"""How a route is checked and timed.

Every result is compared with a reference before its route is timed; a route that gives another
result is not timed, and fails the run at its end. A peer is timed in turns with our route (A B A
B), and its ratio is the median over the turns, so that a busy machine slows both. A combination
that would take too long or too much memory, seen from smaller sizes, gets a row that says so.
"""

from __future__ import annotations

import functools
import importlib.util
import math
import time
import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from importlib import metadata
from typing import Any

import numpy as np

from experiments.protocol.clock import synchronise, timed
from experiments.records.measurement import Row
from experiments.studies.benchmark.cases import Case
from experiments.studies.benchmark.memory import call_bytes, give_back
from experiments.studies.benchmark.names import DECODED, OURS, OURS_COMPILED, READ
from experiments.studies.benchmark.route import Route

# Seconds that one time sample takes at least. Shorter calls are repeated in it, so that what a
# route finds in the caches is what it left there itself, not the route before it.
_SAMPLE = 20e-3
_LONG = 4.0  # seconds from which a call is timed once, not at least three times


@dataclass
class Bench:
    """Checks and times routes, and remembers what they needed.

    Args:
        limit_s, limit_bytes: a call that is expected to need more, with its frames, is skipped.
        budget_s: about how long a route is timed.
        rows: what was measured so far, from which it foretells.
    """

    limit_s: float
    limit_bytes: float
    budget_s: float
    rows: list[Row] = field(default_factory=list)

    def measure(self, routes: Sequence[Route], case: Case, memory: bool = True) -> list[Row]:
        """A row for each route of an operation at one size; ours comes first.

        Without `memory` the peak of a call, which takes a process of its own, is left out.
        """
        ours: _Timed | None = None
        rows: list[Row] = []
        for route in sorted(routes, key=lambda route: route.name != OURS):
            row = _row(route, case)
            row["status"] = self.reason_to_skip(route, case) or "ok"
            rows.append(row)
            self.rows.append(row)
            if row["status"] != "ok":
                continue
            give_back()  # a route does not stand on what others left
            try:
                with warnings.catch_warnings():
                    warnings.simplefilter("ignore")  # constant frames carry no information
                    row["peak_bytes"] = call_bytes(route, case) if memory else None
                    peer = _checked(route, case, row)
                    if peer is None:
                        continue
                    if route.name == OURS:
                        ours = peer
                        row["ratio_to_ours"] = 1.0
                        for _ in range(3):
                            ours.sample()
                    else:
                        ratios = self._in_turns(peer, ours)
                        row["ratio_to_ours"] = float(np.median(ratios)) if ratios else None
                        row |= peer.times()
            except Exception as error:
                message = " ".join(str(error).split())
                row["status"] = f"failed: {type(error).__name__}: {message}"[:200]
        if ours:  # with the samples that were taken in turns
            rows[0] |= ours.times()
        return rows

    def check(self) -> None:
        """Raise if there are rows without a valid result."""
        wrong = [
            f"{row['operation']} by {row['route']} ({row['status']})"
            for row in self.rows
            if invalid(row)
        ]
        if wrong:
            listed = ", ".join(wrong)
            raise RuntimeError(f"benchmark: {len(wrong)} rows without a valid result: {listed}")

    def reason_to_skip(self, route: Route, case: Case) -> str | None:
        """Why a route cannot, or should not, be measured at a size; None if it can."""
        if importlib.util.find_spec(route.module) is None:
            return "not installed"
        if case.device != "cpu" and not route.anywhere:
            return "skipped: runs on the CPU only"
        if str(case.dtype) not in route.types:
            return f"skipped: takes {', '.join(route.types)}"
        if route.operation in ("bundle", "train", "folder") and case.n < case.n_classes:
            return f"skipped: {case.n} frames for {case.n_classes} classes"
        seconds = 0.0
        memory: dict[int, float] = {}  # expected, from the sizes measured of each D
        for row in self.rows:
            known = (row["operation"], row["route"], row["frames"])
            if known != (route.operation, route.name, case.kind):
                continue
            factor = case.n * case.d / (row["n"] * row["d"])
            if route.operation == "hamming":
                factor *= case.n_classes / row["l"]
            if "skipped: about" in row["status"] and factor >= 1:
                return "skipped: a smaller size was"
            # Small sizes are all overhead; only a sizeable call tells what a larger one costs.
            if (row["median_s"] or 0) > 0.01:
                seconds = max(seconds, row["median_s"] * factor)
            if (row["peak_bytes"] or 0) > 1e7:
                memory[row["d"]] = max(memory.get(row["d"], 0), row["peak_bytes"] * factor)
        if seconds > self.limit_s:
            return f"skipped: about {seconds:.0f} s expected, limit {self.limit_s:g} s"
        # The same D tells best: a Gram matrix, of N squared, does not grow with it.
        expected = memory.get(case.d, max(memory.values(), default=0.0))
        needed = case.n * case.d * case.dtype.itemsize + expected
        if needed > self.limit_bytes:
            limit = self.limit_bytes / 1e9
            return f"skipped: about {needed / 1e9:.1f} GB expected, limit {limit:g} GB"
        return None

    def _in_turns(self, peer: _Timed, ours: _Timed | None) -> list[float]:
        """Time a peer, each time followed by ours, and the ratios of both."""
        ratios: list[float] = []
        deadline = time.perf_counter() + self.budget_s
        least = 3 if peer.first < _LONG else 1
        while len(peer.samples) < least or (
            len(peer.samples) < 30 and time.perf_counter() < deadline
        ):
            seconds = peer.sample()
            if ours:
                ratios.append(seconds / ours.sample())
        return ratios


def invalid(row: Row) -> bool:
    """Whether a row was to have a result and has none that is right."""
    return row["status"] == "wrong result" or str(row["status"]).startswith("failed")


class _Timed:
    """A call that is timed, repeated within one sample where it is short.

    Args:
        call: what is timed.
        device: synchronised on both sides.
        first: seconds that the first call took.
    """

    def __init__(self, call: Callable[[], Any], device: str, first: float):
        self.call, self.device, self.first, self.repeats = call, device, first, 1
        # A first call may be slow for reasons of its own; one that takes seconds is not made twice.
        self.samples: list[float] = []
        seconds = first if first > 1 else min(self.sample() for _ in range(3))
        self.repeats = max(1, math.ceil(_SAMPLE / max(seconds, 1e-7)))
        self.samples.clear()

    def sample(self) -> float:
        """Seconds a call, which are kept."""

        def repeated() -> None:
            for _ in range(self.repeats):
                self.call()

        self.samples.append(timed(repeated, self.device) / self.repeats)
        return self.samples[-1]

    def times(self) -> Row:
        """What a row says of the samples."""
        return {
            "median_s": float(np.median(self.samples)),
            "min_s": min(self.samples),
            "samples": len(self.samples),
        }


def _row(route: Route, case: Case) -> Row:
    """The row of a route before it was measured."""
    return {
        "operation": route.operation,
        "frames": case.kind,
        "route": route.name,
        "package": _package(route.module),
        "n": case.n,
        "d": case.d,
        "l": case.n_classes,
        "median_s": None,
        "min_s": None,
        "samples": None,
        "ratio_to_ours": None,
        "peak_bytes": None,
        "equal_result": None,
    }


def _checked(route: Route, case: Case, row: Row) -> _Timed | None:
    """Run the route once and compare; None if the result is another."""
    call, form = route.build(case)
    start = time.perf_counter()
    output = call()
    synchronise(case.device)
    first = time.perf_counter() - start
    if route.name not in (READ, DECODED):
        result = form(output)
        verdict = "no" if result is None else case.verdict(route.operation, result)
        if route.name in (OURS, OURS_COMPILED) and "aside" in verdict:
            verdict = "no"  # ours is specified to the last bit
        row["equal_result"] = verdict
        if verdict == "no":
            row["status"] = "wrong result"
            return None
    return _Timed(call, case.device, first)


@functools.cache
def _package(module: str) -> str:
    """Name and version of what has to be installed for a module; nothing where it is not."""
    names = _distributions().get(module, [])
    return f"{names[0]} {metadata.version(names[0])}" if names else ""


@functools.cache
def _distributions() -> Mapping[str, list[str]]:
    return metadata.packages_distributions()
