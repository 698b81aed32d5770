"""What the benchmark measured: the routes at the headline size, and everything."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from experiments.records.measurement import Measured
from experiments.records.results import Group, Results
from experiments.reporting.measured import machine
from experiments.reporting.study import Study
from experiments.reporting.table import Table, frame, number, size
from experiments.studies.benchmark.names import OPERATIONS

ORDINARY = "HDC by ordinary routes"
_ORDINARY_ROUTE = "torch.median, torchhd.multiset"
ORDINARY_NOTE = (
    f"{ORDINARY}: prototypes of as many frames by {_ORDINARY_ROUTE}, timed on the same processor "
    "and threads by experiment=benchmark; a dash where they were not."
)
HEADLINE = {"n": 400, "d": 250_000, "l": 5}  # hamming and predict: their own n
_NUMBERS = {
    **dict.fromkeys(("n", "d", "l", "samples", "peak_bytes"), int),
    **dict.fromkeys(("median_s", "min_s", "ratio_to_ours"), float),
}
NOTE = (
    "Both sides of a ratio ran in turns in one process; × hdc is the median over the turns, of "
    "times (store: of bytes). Peak memory: what one call takes beyond its inputs, in a process of "
    "its own (store: a hypervector). Same result, compared before any timing with a reference in "
    "plain numpy: ties aside, but for bits that the median or the majority leaves open; same "
    "labels, those of frames that were not learnt. Frames: speckle in uint8, its medians near one "
    'another, unless another kind is named. “hdc, compiled” is HDCClassifier(backend="compiled").'
)


def tables(results: Results) -> Iterator[Table]:
    """The headline size and everything, of this machine's processor and of its accelerator."""
    for name in ("benchmark", "benchmark_gpu"):
        if (measured := results.measured(name)) is not None:
            rows = [_typed(row) for row in measured.rows]
            yield headline(name, measured, rows)
            yield Table(
                f"{name}_all",
                f"Every route at every size. {machine(measured)}.",
                frame(rows),
                {"N": _integer("n"), "D": _integer("d"), "L": _integer("l"), **COLUMNS},
                NOTE,
                [measured.record.command],
            )


def ordinary_training_s(results: Results, beside: Group) -> float | None:
    """Seconds in which ordinary routines make prototypes of as many frames as a group's, on its
    processor and as many threads; None where that was not measured."""
    measured = results.measured("benchmark")
    if measured is None or not beside.runs:
        return None
    made, record = measured.record.environment, beside.runs[0].record
    if (made.cpu, made.threads) != (record.environment.cpu, record.environment.threads):
        return None
    size = {"n": record.n_train, "d": math.prod(record.scene.shape), "l": len(beside.classes)}
    for row in map(_typed, measured.rows):
        if (row["operation"], row["route"]) == ("train", _ORDINARY_ROUTE) and _is_at(row, size):
            return row["median_s"] if row["status"] == "ok" else None
    return None


def headline(name: str, measured: Measured, rows: Sequence[Mapping[str, Any]]) -> Table:
    """The rows of N = 400, D = 250,000 and L = 5, or of the largest sizes measured instead."""
    at = {}
    for key, wanted in HEADLINE.items():
        found = {row[key] for row in rows if row["operation"] in ("bundle", "train")}
        at[key] = wanted if wanted in found or not found else max(found)
    shown = [
        row
        for operation in (*OPERATIONS, "store")
        for row in rows
        if row["operation"] == operation and _is_at(row, at)
    ]
    packages = ", ".join(dict.fromkeys(row["package"] for row in rows if "package" in row))
    return Table(
        name,
        f"Every route of the classifier beside its peers: N = {at['n']} frames of "
        f"D = {at['d']:,} pixels, L = {at['l']} classes. "
        f"{machine(measured)}.",
        frame(shown, list(dict.fromkeys(key for row in rows for key in row))),
        COLUMNS,
        f"{NOTE} {packages}.",
        [measured.record.command],
        key=("Operation", "Route"),
    )


def _is_at(row: Mapping[str, Any], size: Mapping[str, int]) -> bool:
    of_which = {"encode": ("n", "d"), "bundle": ("n", "d", "l"), "train": ("n", "d", "l")}
    keys = of_which.get(row["operation"], ("d", "l"))
    return all(row.get(key) in (None, size[key]) for key in keys)


def _typed(row: Mapping[str, str]) -> dict[str, Any]:
    return {key: _NUMBERS.get(key, str)(value) for key, value in row.items()}


def _integer(key: str) -> Any:
    return lambda row: "–" if row[key] is None else f"{row[key]:,}"


def _operation(row: Mapping[str, Any]) -> str:
    name = {"hamming": f"hamming, {row['n']} queries", "predict": "predict, one frame"}
    kind = row.get("frames") or "speckle"
    text = name.get(row["operation"], row["operation"])
    return text if kind == "speckle" else f"{text}, {kind}"


def _median(row: Mapping[str, Any]) -> str:
    if row["status"] != "ok":
        return str(row["status"])
    return number(None if row["median_s"] is None else 1e3 * row["median_s"])


COLUMNS = {
    "Operation": _operation,
    "Route": lambda row: row["route"],
    "Median, ms": _median,
    "× hdc": lambda row: number(row["ratio_to_ours"]),
    "Peak memory": lambda row: "–" if row["peak_bytes"] is None else size(int(row["peak_bytes"])),
    "Same result": lambda row: row["equal_result"] or "–",
}

STUDY = Study(
    "benchmark",
    "Speed and memory",
    "How fast is each step of the classifier, and what does it hold, beside other libraries that "
    "do the same on the same bytes?",
    12,
    tables,
)
