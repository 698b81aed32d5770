"""What the benchmark measured: the routes at the headline size, and everything."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any

from experiments.records.measurement import Measured
from experiments.records.results import Group, Results
from experiments.reporting.measured import machine
from experiments.reporting.study import Study
from experiments.reporting.table import Table, frame, number, size
from experiments.studies.benchmark.names import (
    DECODED,
    NUMKONG,
    OPERATIONS,
    ORDINARY_ROUTES,
    OURS,
    OURS_COMPILED,
    READ,
    SHUFFLED,
    SORTED,
    TORCHHD_BUNDLE,
    TORCHHD_TRAIN,
    typed,
)

ORDINARY = "HDC by ordinary routes"
ORDINARY_NOTE = (
    f"{ORDINARY}: prototypes of as many frames by {' or '.join(ORDINARY_ROUTES)}, whichever is "
    "faster, timed on the same processor and threads by experiment=benchmark; a dash where they "
    "were not."
)
HEADLINE = {"n": 400, "d": 250_000, "l": 5}  # hamming and predict: their own n
NOTE = (
    "Both sides of a ratio ran in turns in one process; × hdc is the median over the turns, of "
    "times (store: of bytes). Peak memory: what one call takes beyond its inputs, in a process of "
    "its own (store: a hypervector). Same result, compared before any timing with a reference in "
    "plain numpy: ties aside, but for bits that the median or the majority leaves open; same "
    "labels, those of frames that were not learnt. Frames: speckle in uint8, its medians near one "
    'another, unless another kind is named. “hdc, compiled” is HDCClassifier(backend="compiled"), '
    'which backend="auto" is once its kernels are loaded, as they are for “hdc train FOLDER”.'
)
Rows = Sequence[Mapping[str, Any]]


def tables(results: Results) -> Iterator[Table]:
    """The headline size and everything, of this machine's processor and of its accelerator."""
    for name in ("benchmark", "benchmark_gpu"):
        if (measured := results.measured(name)) is not None:
            rows = [typed(row) for row in measured.rows]
            if goals := list(_goals(rows)):
                yield Table(
                    f"{name}_goals",
                    f"What the classifier was to reach, N = {HEADLINE['n']}, "
                    f"D = {HEADLINE['d']:,}. {machine(measured)}.",
                    frame(goals),
                    note=f"Ours is “{OURS_COMPILED}” unless another is named. {NOTE}",
                    commands=[measured.record.command],
                )
            yield headline(name, measured, rows)
            yield by_kind(name, measured, rows)
            yield by_classes(name, measured, rows)
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
    rows = [typed(row) for row in measured.rows]
    found = (_at(rows, "train", route, **size) for route in ORDINARY_ROUTES)
    return min((row["median_s"] for row in found if row and row["median_s"]), default=None)


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
    )


def _is_at(row: Mapping[str, Any], size: Mapping[str, int]) -> bool:
    of_which = {"encode": ("n", "d"), "bundle": ("n", "d", "l"), "train": ("n", "d", "l")}
    keys = of_which.get(row["operation"], ("d", "l"))
    if row.get("frames", "speckle") not in (None, "speckle"):
        return False
    return all(row.get(key) in (None, size[key]) for key in keys)


def by_kind(name: str, measured: Measured, rows: Rows) -> Table:
    """How long each route encodes a frame of each kind."""
    encoded = [row for row in rows if row["operation"] == "encode" and row["median_s"]]
    routes = list(dict.fromkeys(row["route"] for row in encoded))
    cells: dict[tuple[Any, ...], dict[str, Any]] = {}
    for row in encoded:
        key = (row.get("frames"), row["n"], row["d"])
        cells.setdefault(key, {})[row["route"]] = 1e6 * row["median_s"] / row["n"]
    shown = [
        {"Frames": kind, "N": n, "D": d} | {route: of.get(route) for route in routes}
        for (kind, n, d), of in cells.items()
    ]
    return Table(
        f"{name}_frames",
        f"Encoding, µs a frame, by the kind of frames. {machine(measured)}.",
        frame(shown, ["Frames", "N", "D", *routes]),
        note=f"{NOTE} Frames like a camera's have one of six exposures, whose medians are 100 grey "
        "levels apart, with 5 % of flicker, and are saturated where they are bright.",
        commands=[measured.record.command],
    )


def by_classes(name: str, measured: Measured, rows: Rows) -> Table:
    """What a frame costs that is predicted, or learnt, with few and many classes."""
    what = {
        "predict": "predict one",
        "predict_all": "predict, in a batch",
        "learn_one": "learn one of a stream",
    }
    shown = [
        {
            "": what[row["operation"]],
            "route": row["route"],
            "D": row["d"],
            "L": row["l"],
            "µs a frame": 1e6 * row["median_s"] / row["n"],
        }
        for row in rows
        if row["operation"] in what
        and row["median_s"]
        and row["route"] in (OURS, OURS_COMPILED, READ)
    ]
    return Table(
        f"{name}_classes",
        f"What a frame costs, by the number of classes. {machine(measured)}.",
        frame(shown, ["", "route", "D", "L", "µs a frame"]),
        note=f"{NOTE} A read is of the frame and of all prototypes, but for a frame that is "
        "learnt, which needs none.",
        commands=[measured.record.command],
    )


def _goals(rows: Rows) -> Iterator[dict[str, Any]]:
    """What was to be reached, and whether it was, as far as it was measured."""
    _, d, classes = HEADLINE.values()

    def ratio(operation: str, route: str, to: str, where: Any = HEADLINE) -> float | None:
        """Of two times that were each taken in turns with a third."""
        first, second = (_at(rows, operation, name, **where) for name in (route, to))
        if not (first and second and first["ratio_to_ours"] and second["ratio_to_ours"]):
            return None
        return float(first["ratio_to_ours"] / second["ratio_to_ours"])

    def of_kinds(route: str) -> float | None:
        kinds = [_at(rows, "encode", route, d=d, frames=k) for k in (SHUFFLED, SORTED)]
        return _quotient(*kinds)

    def of_classes(route: str) -> float | None:
        most = max((row["l"] or 0 for row in rows if row["operation"] == "learn_one"), default=0)
        learnt = [_at(rows, "learn_one", route, d=d, l=l) for l in (most, classes)]  # noqa: E741
        return _quotient(*learnt)

    single = _at(rows, "predict", OURS_COMPILED, **(HEADLINE | {"n": 1}))
    single_ms = 1e3 * single["median_s"] if single and single["median_s"] else None
    least, most = float.__ge__, float.__le__
    goals: list[tuple[str, float | None, Callable[[float, float], bool], float]] = [
        ("bundle: torchhd, × ours", ratio("bundle", TORCHHD_BUNDLE, OURS_COMPILED), least, 200),
        ("frames to prototypes: torchhd, × ours", ratio("train", TORCHHD_TRAIN, OURS_COMPILED),
         least, 80),
        ("frames to prototypes: ours, × one read of the frames",
         ratio("train", OURS_COMPILED, READ), most, 1.6),
        ("predict one frame: ours, ms", single_ms, most, 0.12),
        ("Hamming distances: ours, × NumKong",
         ratio("hamming", OURS, NUMKONG, {"d": d, "l": classes}), most, 1.1),
        (f"encode {SHUFFLED}, × {SORTED}: {OURS}", of_kinds(OURS), most, 1.3),
        (f"encode {SHUFFLED}, × {SORTED}: {OURS_COMPILED}", of_kinds(OURS_COMPILED), most, 1.3),
        (f"learn one frame with most classes, × fewest: {OURS}", of_classes(OURS), most, 1.3),
        (f"learn one frame with most classes, × fewest: {OURS_COMPILED}",
         of_classes(OURS_COMPILED), most, 1.3),
        (f"hdc train FOLDER: frames a second, × {DECODED}",
         ratio("folder", DECODED, OURS, {"d": d}), least, 0.9),
    ]  # fmt: skip
    for text, found, reaches, limit in goals:
        if found is not None:
            bound = f"{'≥' if reaches is least else '≤'} {limit:g}"
            met = "yes" if reaches(found, float(limit)) else "no"
            yield {"Goal": text, "Wanted": bound, "Measured": found, "Met": met}


def _quotient(*rows: Mapping[str, Any] | None) -> float | None:
    first, second = ((row or {}).get("median_s") for row in rows)
    return first / second if first and second else None


def _at(rows: Rows, operation: str, route: str, **where: Any) -> Mapping[str, Any] | None:
    """The row of a route whose other columns are these; frames are speckle unless named."""
    wanted = {"frames": "speckle", **where, "operation": operation, "route": route}
    found = (row for row in rows if all(row.get(key) == value for key, value in wanted.items()))
    return next(found, None)


def _integer(key: str) -> Any:
    return lambda row: "–" if row[key] is None else f"{row[key]:,}"


def _operation(row: Mapping[str, Any]) -> str:
    name = {
        "hamming": f"hamming, {row['n']} queries",
        "predict": "predict, one frame",
        "predict_all": f"predict, {row['n']} frames",
        "learn_one": "learn, one frame",
        "folder": f"hdc train FOLDER, {row['n']} images",
    }
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
