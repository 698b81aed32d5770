"""Our routes beside the peers', on the same bytes in one run: times and memory.

Every operation is measured at small sizes first, which foretell what the large ones need
(:mod:`experiments.studies.benchmark.bench`); a line a size tells on the terminal what was found.
"""

from __future__ import annotations

import importlib.util
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import torch
from rich.console import Console

from experiments.records.measurement import Row, measure
from experiments.studies.benchmark.bench import Bench, invalid
from experiments.studies.benchmark.cases import HELD_OUT, Case
from experiments.studies.benchmark.names import OURS, OURS_COMPILED, READ, typed
from experiments.studies.benchmark.routes import ROUTES
from hdc import bits


def run(
    n: Sequence[int],
    d: Sequence[int],
    l: Sequence[int],  # noqa: E741
    many: int,
    large: Sequence[int],
    frames: Sequence[str],
    frames_n: int,
    files: int,
    queries: int,
    limit_s: float,
    limit_bytes: float,
    budget_s: float,
    seed: int,
    device: str = "cpu",
    force: bool = False,
) -> Path:
    """Measure all routes at all sizes, and write ``measured/benchmark/``.

    Args:
        n, d, l: numbers of frames, pixels, classes.
        many: a number of classes with which ours alone predicts, and learns frames one by one.
        large: numbers of pixels of which four frames are encoded, and one is predicted, but not by
            scikit-learn.
        frames: kinds of frames (:data:`experiments.studies.benchmark.cases.FRAMES`) of which
            `frames_n` are encoded, of the largest `d`.
        files: images of the folder that is trained on.
        queries: number of queries of the Hamming distances.
        limit_s, limit_bytes: a call that is expected to need more, with its frames, is skipped.
        budget_s: about how long a route is timed (three times at least; once if it takes seconds).
        seed: seed of the frames.
        device: where torch routes run; of an accelerator, it is ``measured/benchmark_gpu/``.
        force: measure again.

    Returns:
        Path: the folder, in which rows are kept as they come: the next call goes on from them. The
        columns: ``operation``, ``frames`` (kind), ``route`` and the ``package`` behind it; ``n``
        frames (``hamming``, ``predict``, ``predict_all``: queries), ``d``, ``l``; ``median_s`` and
        ``min_s`` of so many ``samples``; ``ratio_to_ours`` of times (``store``: of bytes);
        ``peak_bytes`` that one call takes beyond its inputs (``store``: those of the hypervectors);
        ``equal_result``; ``status``.

    Raises:
        RuntimeError: at the end, if a route gave another result or failed.
    """
    console = Console(highlight=False)
    bench = Bench(limit_s, limit_bytes, budget_s)
    config = {
        "_target_": f"{__name__}.run",
        "n": n,
        "d": d,
        "l": l,
        "many": many,
        "large": large,
        "frames": frames,
        "frames_n": frames_n,
        "files": files,
        "queries": queries,
        "limit_s": limit_s,
        "limit_bytes": limit_bytes,
        "budget_s": budget_s,
        "seed": seed,
    }

    def compute(begun: list[Row]) -> Iterator[Row]:
        made: dict[tuple[Any, ...], list[Row]] = {}
        for row in begun:
            if row["operation"] != "store":
                row = typed(row)
                size = tuple(row[key] for key in ("n", "d", "l"))
                made.setdefault((row["operation"], size, row["frames"]), []).append(row)
        begun.clear()
        steps = sizes(
            sorted(n), sorted(d), sorted(l), many, large, frames, frames_n, files, queries
        )
        for operation, size, kind in steps:
            chosen = [
                route
                for route in ROUTES
                if route.operation == operation
                and (size[2] < many or route.name in (OURS, OURS_COMPILED, READ))
                # Before it is asked, scikit-learn has to fit some frames: to 12 million pixels
                # each, in 6 GB.
                and not (size[1] in large and route.module == "sklearn")
            ]
            known = made.get((operation, size, kind), [])
            if len(known) == len(chosen) and not any(map(invalid, known)):
                bench.rows += known
                yield from known
                continue
            memory = kind == "speckle" and size[2] == min(l)
            case = Case(*size, device=device, seed=seed, kind=kind)
            rows = bench.measure(chosen, case, memory)
            yield from rows
            console.print(_line(rows), soft_wrap=True)
        for dimension in d:
            yield from storage(dimension)
        bench.check()

    name = "benchmark" if device == "cpu" else "benchmark_gpu"
    return measure(name, config, compute, device=device, force=force, resumed=True, console=console)


def sizes(
    n: Sequence[int],
    d: Sequence[int],
    l: Sequence[int],  # noqa: E741
    many: int,
    large: Sequence[int],
    frames: Sequence[str],
    frames_n: int,
    files: int,
    queries: int,
) -> Iterator[tuple[str, tuple[int, int, int], str]]:
    """Operations, their N, D and L, and the kind of frames; small ones first: they predict what
    the large ones need."""
    for dimension in d:
        for count in n:
            for operation in ("encode", "train"):
                yield operation, (count, dimension, l[0]), "speckle"
            for classes in l:
                yield "bundle", (count, dimension, classes), "speckle"
        for classes in l:
            yield "hamming", (queries, dimension, classes), "speckle"
        for operation, count in (("predict", 1), ("predict_all", HELD_OUT), ("learn_one", 1)):
            for classes in (*l, many):
                yield operation, (count, dimension, classes), "speckle"
    for kind in frames:
        yield "encode", (frames_n, d[-1], l[0]), kind
    yield "folder", (files, d[-1], l[0]), "speckle"
    for dimension in large:
        yield "encode", (4, dimension, l[0]), "speckle"
        yield "predict", (1, dimension, l[0]), "speckle"


def storage(dimension: int) -> list[Row]:
    """Bytes of one hypervector, packed and as torchhd keeps it."""
    size: Row = {"operation": "store", "n": 1, "d": dimension}
    packed = bits.pack(torch.zeros(1, dimension, dtype=torch.bool)).nbytes
    ours = {**size, "route": OURS, "ratio_to_ours": 1.0, "peak_bytes": packed, "status": "ok"}
    peer = {**size, "route": "torchhd.BSCTensor", "status": "not installed"}
    if importlib.util.find_spec("torchhd") is not None:
        import torchhd

        each = torchhd.random(1, dimension, "BSC").nbytes
        peer |= {"ratio_to_ours": each / packed, "peak_bytes": each, "status": "ok"}
    return [ours, peer]


def _line(rows: Sequence[Row]) -> str:
    """What was found at one size, for the terminal."""
    first = rows[0]
    kind = "" if first["frames"] == "speckle" else f" of {first['frames']}"
    size = f"N={first['n']} D={first['d']} L={first['l']}"
    cells = []
    for row in rows:
        ratio = "" if row["ratio_to_ours"] is None else f" ({row['ratio_to_ours']:.3g} ×)"
        missing = row["median_s"] is None
        found = row["status"] if missing else f"{1e3 * row['median_s']:.3g} ms{ratio}"
        cells.append(f"{row['route']} {found}")
    return f"{first['operation']}{kind} {size}: {'; '.join(cells)}"
