"""Our routes beside the peers', on the same bytes in one run: times, memory, growth.

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
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
from rich.console import Console
from rich.progress import Progress

from experiments import record
from experiments.benchmark_cases import Case
from experiments.benchmark_memory import give_back, peak_bytes
from experiments.benchmark_results import Row, closest, markdown_table, show, to_csv
from experiments.benchmark_routes import OURS, OURS_COMPILED, READ, ROUTES, Form, Route
from experiments.clock import synchronise
from hdc import bits

__all__ = ["markdown_table", "run"]

console = Console()

_SAMPLE = 2e-3  # seconds that one time sample takes at least: shorter calls are repeated in it
_LONG = 4.0  # seconds from which a call is timed once, not at least three times
_PACKAGES = ("torch", "numpy", "numba", "numkong", "torch-hd", "faiss-cpu", "scikit-learn")


def run(
    n: Sequence[int] = (40, 400, 4000),
    d: Sequence[int] = (10_000, 250_000),
    l: Sequence[int] = (5, 51),  # noqa: E741
    queries: int = 100,
    device: str = "cpu",
    limit_s: float = 20.0,
    limit_bytes: float = 1.7e9,
    budget_s: float = 0.6,
    seed: int = 0,
    routes: Sequence[Route] | None = None,
) -> Path:
    """Measure all routes at all sizes, write the CSV, and print what it says.

    Args:
        n, d, l: numbers of frames, pixels, classes.
        queries: of the Hamming distances.
        device: where torch routes run; on an accelerator the CSV is benchmark_gpu.csv.
        limit_s, limit_bytes: a call that is expected to need more, with its frames, is skipped.
        budget_s: about how long a route is timed (three times at least; once if it takes seconds).
        seed: of the frames.
        routes: instead of all that are registered.

    Raises:
        RuntimeError: at the end, if a route gave another result or failed.
    """
    rows: list[Row] = []
    bench = _Bench(limit_s, limit_bytes, budget_s, rows)
    sizes = list(_sizes(sorted(n), sorted(d), sorted(l), queries))
    with Progress(console=console, transient=True) as progress:
        bar = progress.add_task("", total=len(sizes))
        for operation, case in sizes:
            progress.update(
                bar, description=f"{operation} N={case[0]} D={case[1]} L={case[2]}", advance=1
            )
            chosen = [r for r in routes or ROUTES if r.operation == operation]
            bench.measure(chosen, Case(*case, device=device, seed=seed))
    rows += _storage_rows(*closest(rows))
    environment = record.environment(device, torch.get_num_threads(), {})
    for row in rows:
        row.device, row.threads, row.cpu = (environment[k] for k in ("device", "threads", "cpu"))
        row.versions = _versions()
    path = record.results_dir() / f"benchmark{'' if device == 'cpu' else '_gpu'}.csv"
    record.write_atomically(path, to_csv(rows))
    show(rows, path, console)
    wrong = [r for r in rows if r.status == "wrong result" or r.status.startswith("failed")]
    if wrong:
        listed = ", ".join(f"{r.operation} by {r.route} ({r.status})" for r in wrong)
        raise RuntimeError(f"benchmark: {len(wrong)} measurements without a valid result: {listed}")
    return path


def _sizes(
    n: Sequence[int],
    d: Sequence[int],
    l: Sequence[int],  # noqa: E741
    queries: int,
) -> Iterator[tuple[str, tuple[int, int, int]]]:
    """Operations and their cases, small ones first: they predict what the large ones need."""
    for dimension in d:
        for frames in n:
            yield "encode", (frames, dimension, l[0])
        for operation in ("bundle", "train"):
            for classes in l:
                for frames in n:
                    yield operation, (frames, dimension, classes)
        for operation, frames in (("hamming", queries), ("predict", 1)):
            for classes in l:
                yield operation, (frames, dimension, classes)


# Measuring ---------------------------------------------------------------------------------------


@dataclass
class _Bench:
    limit_s: float
    limit_bytes: float
    budget_s: float
    rows: list[Row]

    def measure(self, routes: Sequence[Route], case: Case) -> None:
        """Check and time all routes of an operation at one size; ours comes first."""
        ours: _Timed | None = None
        our_row: Row | None = None
        for route in sorted(routes, key=lambda r: r.name != OURS):
            row = Row(route.operation, route.name, case.n, case.d, case.n_classes)
            self.rows.append(row)
            row.status = self._reason_to_skip(route, case) or "ok"
            if row.status != "ok":
                continue
            give_back()  # a route does not stand on what others left
            try:
                row.peak_bytes = peak_bytes(route, case)
                timed = self._checked(route, case, row)
                if timed is None:
                    continue
                if route.name == OURS:
                    ours, our_row = timed, row
                    our_samples = [ours.sample() for _ in range(3)]
                    _set_times(row, our_samples)
                else:
                    samples, ratios = self._in_turns(timed, ours, case)
                    _set_times(row, samples)
                    if ours and our_row:
                        row.ratio_to_ours = float(np.median(ratios))
                        our_samples += ours.samples
                        ours.samples.clear()
                        _set_times(our_row, our_samples)
            except Exception as error:
                message = " ".join(str(error).split())
                row.status = f"failed: {type(error).__name__}: {message}"[:200]
        if our_row:
            our_row.ratio_to_ours = 1.0

    def _reason_to_skip(self, route: Route, case: Case) -> str | None:
        if importlib.util.find_spec(route.module) is None:
            return "not installed"
        if case.device != "cpu" and not route.anywhere:
            return "skipped: runs on the CPU only"
        if route.operation in ("bundle", "train") and case.n < case.n_classes:
            return f"skipped: {case.n} frames for {case.n_classes} classes"
        seconds = 0.0
        memory: dict[int, float] = {}  # expected, from the sizes measured of each D
        for row in self.rows:
            if (row.operation, row.route) != (route.operation, route.name):
                continue
            factor = case.n * case.d / (row.n * row.d)
            if route.operation == "hamming":
                factor *= case.n_classes / row.l
            if "skipped: about" in row.status and factor >= 1:
                return "skipped: a smaller size was"
            # Small sizes are all overhead; only a sizeable call tells what a larger one costs.
            if (row.median_s or 0) > 0.01:
                seconds = max(seconds, (row.median_s or 0) * factor)
            if (row.peak_bytes or 0) > 1e7:
                memory[row.d] = max(memory.get(row.d, 0), (row.peak_bytes or 0) * factor)
        if seconds > self.limit_s:
            return f"skipped: about {seconds:.0f} s expected, limit {self.limit_s:g} s"
        # The same D tells best: a Gram matrix, of N squared, does not grow with it.
        needed = case.n * case.d + memory.get(case.d, max(memory.values(), default=0))
        if needed > self.limit_bytes:
            limit = self.limit_bytes / 1e9
            return f"skipped: about {needed / 1e9:.1f} GB expected, limit {limit:g} GB"
        return None

    def _checked(self, route: Route, case: Case, row: Row) -> _Timed | None:
        """Run the route once and compare; None if the result is another."""
        call, form = route.build(case)
        first = self._compare(call, form, route, case, row)
        return None if row.status == "wrong result" else _Timed(call, case.device, first)

    def _compare(
        self, call: Callable[[], Any], form: Form, route: Route, case: Case, row: Row
    ) -> float:
        """What a route's first result is worth goes into its row; the seconds it took."""
        start = time.perf_counter()
        output = call()
        synchronise(case.device)
        first = time.perf_counter() - start
        if route.name != READ:
            result = form(output)
            row.equal_result = "no" if result is None else case.verdict(route.operation, result)
            if route.name in (OURS, OURS_COMPILED) and "aside" in row.equal_result:
                row.equal_result = "no"  # ours is specified to the last bit
            if row.equal_result == "no":
                row.status = "wrong result"
        return first

    def _in_turns(
        self, peer: _Timed, ours: _Timed | None, case: Case
    ) -> tuple[list[float], list[float]]:
        """Time samples of a peer, each followed by one of ours, and their ratios."""
        samples: list[float] = []
        ratios: list[float] = []
        deadline = time.perf_counter() + self.budget_s
        least = 3 if peer.first < _LONG else 1
        while len(samples) < least or (len(samples) < 30 and time.perf_counter() < deadline):
            samples.append(peer.sample())
            if ours:
                ratios.append(samples[-1] / ours.sample(keep=True))
        return samples, ratios


class _Timed:
    """A call that is timed, repeated within one sample where it is short.

    Args:
        first: seconds that the first call took.
    """

    def __init__(self, call: Callable[[], Any], device: str, first: float):
        self.call, self.device, self.first, self.repeats = call, device, first, 1
        self.samples: list[float] = []
        # A first call may be slow for reasons of its own; one that takes seconds is not made twice.
        seconds = first if first > 1 else min(self.sample() for _ in range(3))
        self.repeats = max(1, math.ceil(_SAMPLE / max(seconds, 1e-7)))

    def sample(self, keep: bool = False) -> float:
        """Seconds a call."""
        synchronise(self.device)
        start = time.perf_counter()
        for _ in range(self.repeats):
            self.call()
        synchronise(self.device)
        seconds = (time.perf_counter() - start) / self.repeats
        if keep:
            self.samples.append(seconds)
        return seconds


def _set_times(row: Row, samples: list[float]) -> None:
    row.median_s, row.min_s = float(np.median(samples)), min(samples)
    row.samples = len(samples)


def _storage_rows(n: int, d: int, l: int) -> list[Row]:  # noqa: E741
    """Bytes of N hypervectors, packed and as torchhd keeps them."""
    packed = bits.pack(torch.zeros(1, d, dtype=torch.bool)).nbytes
    ours = Row("store", OURS, n, d, l, ratio_to_ours=1.0, peak_bytes=n * packed)
    peer = Row("store", "torchhd.BSCTensor", n, d, l)
    if importlib.util.find_spec("torchhd") is None:
        peer.status = "not installed"
    else:
        import torchhd

        each = torchhd.random(1, d, "BSC").nbytes
        peer.peak_bytes, peer.ratio_to_ours = n * each, each / packed
    return [ours, peer]


@functools.cache
def _versions() -> str:
    known = ((name, record._version(name)) for name in _PACKAGES)
    return " ".join(f"{name} {version}" for name, version in known if version)
