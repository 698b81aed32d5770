"""What the benchmark measured: the CSV, its headline table, targets and growth."""

from __future__ import annotations

import csv
import io
import os
from collections.abc import Sequence
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table

from experiments.benchmark_routes import OPERATIONS, OURS, OURS_COMPILED

_HEADLINE = {"n": 400, "d": 250_000, "l": 5}  # hamming and predict: their own n
# (operation, peer, what its time or bytes over ours should be at least), at the headline size
_TARGETS = (
    ("bundle", "torchhd.multiset", 100),
    ("hamming", "torchhd.hamming_similarity", 1000),
    ("train", "torch.median, torchhd.multiset", 40),
    ("train", "sklearn RidgeClassifier", 15),
    ("store", "torchhd.BSCTensor", 7.99),  # bytes; eight but for the last word
)
_TARGET_PREDICT = 0.5e-3  # seconds


@dataclass
class Row:
    """One line of the CSV; n counts the frames, or the queries of `hamming` and `predict`.

    `peak_bytes` is the memory that one call takes beyond its inputs (for `store`: the bytes of the
    hypervectors themselves), `ratio_to_ours` the route's time (`store`: bytes) over ours.
    """

    operation: str
    route: str
    n: int
    d: int
    l: int  # noqa: E741
    median_s: float | None = None
    min_s: float | None = None
    ratio_to_ours: float | None = None
    peak_bytes: int | None = None
    equal_result: str = ""
    status: str = "ok"
    samples: int = 0
    device: str = "cpu"
    threads: int = 0
    cpu: str = ""
    versions: str = ""


def to_csv(rows: Sequence[Row]) -> str:
    """The rows as the text of a CSV file."""
    text = io.StringIO()
    writer = csv.DictWriter(text, [f.name for f in fields(Row)], lineterminator="\n")
    writer.writeheader()
    writer.writerows(asdict(row) for row in rows)
    return text.getvalue()


def read(path: str | Path) -> list[Row]:
    """The rows of a CSV that :func:`run` wrote."""
    with open(path, newline="", encoding="utf-8") as file:
        return [_parse(line) for line in csv.DictReader(file)]


def _parse(line: dict[str, str]) -> Row:
    values: dict[str, Any] = dict(line)
    for key in ("n", "d", "l", "samples", "threads"):
        values[key] = int(values[key])
    for key in ("median_s", "min_s", "ratio_to_ours", "peak_bytes"):
        values[key] = float(values[key]) if values[key] else None
    if values["peak_bytes"] is not None:
        values["peak_bytes"] = int(values["peak_bytes"])
    return Row(**values)


def closest(rows: Sequence[Row]) -> tuple[int, int, int]:
    """The headline size, or the largest that was measured where it was not."""
    chosen = {}
    for key, wanted in _HEADLINE.items():
        found = {getattr(r, key) for r in rows if r.operation in ("encode", "bundle", "train")}
        chosen[key] = wanted if wanted in found else max(found, default=wanted)
    return chosen["n"], chosen["d"], chosen["l"]


def headline(rows: Sequence[Row]) -> list[Row]:
    """The rows of the headline size: N = 400, D = 250,000, L = 5 where it was measured."""
    n, d, l = closest(rows)  # noqa: E741
    own_n = ("hamming", "predict")
    return [
        r
        for operation in (*OPERATIONS, "store")
        for r in rows
        if (r.operation, r.d, r.l) == (operation, d, l) and (r.n == n or operation in own_n)
    ]


def markdown_table(path: str | Path) -> str:
    """The headline rows of a CSV as a Markdown table, generated so that no number is typed."""
    rows = headline(read(path))
    if not rows:
        raise ValueError(f"{path}: expected measurements, found none")
    n, d, l = closest(rows)  # noqa: E741
    lines = [
        f"N = {n} frames of D = {d:,} pixels, L = {l} classes; {rows[0].cpu}, "
        f"{rows[0].threads} threads; {rows[0].versions}.",
        "",
        "| operation | route | median | times ours | peak memory | same result |",
        "|---|---|---:|---:|---:|---|",
    ]
    for row in rows:
        cells = _cells(row)
        lines.append(f"| {' | '.join(cells)} |")
    return "\n".join(lines) + "\n"


def _cells(row: Row) -> list[str]:
    name = {"hamming": f"hamming, {row.n} queries", "predict": "predict, one frame"}
    return [
        name.get(row.operation, row.operation),
        row.route,
        _seconds(row.median_s) if row.status == "ok" else row.status,
        "" if row.ratio_to_ours is None else f"{row.ratio_to_ours:.3g}",
        "" if row.peak_bytes is None else _bytes(row.peak_bytes),
        row.equal_result,
    ]


def _seconds(value: float | None) -> str:
    if value is None:
        return ""
    return f"{value:.3g} s" if value >= 1 else f"{value * 1e3:.3g} ms"


def _bytes(value: float) -> str:
    for unit in ("B", "kB", "MB"):
        if value < 1000:
            return f"{value:.3g} {unit}"
        value /= 1000
    return f"{value:.3g} GB"


def growth(rows: Sequence[Row]) -> list[tuple[str, str, float | None, float | None, list[int]]]:
    """How our routes grow: (operation, variable, exponent of time, of memory, values).

    Exponents are slopes of log–log fits, the other two variables at their headline values (or the
    operation's own).
    """
    base = dict(zip("ndl", closest(rows), strict=True))
    out = []
    for operation in OPERATIONS:
        ours = [r for r in rows if (r.operation, r.route, r.status) == (operation, OURS, "ok")]
        for key in "ndl":
            fixed = {k: v for k, v in base.items() if k != key}
            if operation in ("hamming", "predict"):
                fixed.pop("n", None)
            line = [r for r in ours if all(getattr(r, k) == v for k, v in fixed.items())]
            values = [getattr(r, key) for r in line]
            if len(set(values)) > 1:
                time_, memory = (
                    _slope(values, [getattr(r, column) for r in line])
                    for column in ("median_s", "peak_bytes")
                )
                out.append((operation, key.upper(), time_, memory, values))
    return out


def _slope(x: Sequence[int], y: Sequence[float | None]) -> float | None:
    pairs = [(a, b) for a, b in zip(x, y, strict=True) if b]
    if len({a for a, _ in pairs}) < 2:
        return None
    logs = np.log(np.array(pairs, dtype=np.float64))
    return float(np.polyfit(logs[:, 0], logs[:, 1], 1)[0])


def targets(rows: Sequence[Row]) -> list[tuple[str, str, str, bool | None]]:
    """(what, target, measured, reached) at the headline size; reached None: not measured."""
    found = {(r.operation, r.route): r for r in headline(rows)}
    out: list[tuple[str, str, str, bool | None]] = []
    for operation, peer, least in _TARGETS:
        row = found.get((operation, peer))
        ratio = row.ratio_to_ours if row else None
        compiled = found.get((operation, OURS_COMPILED))
        ratios = {OURS: ratio}
        if compiled is not None:  # both were timed in turns with ours
            part = compiled.ratio_to_ours
            ratios[OURS_COMPILED] = ratio / part if ratio and part else None
        for ours, times in ratios.items():
            reached = None if times is None else times >= least
            measured = "not measured" if times is None else f"{times:.4g} ×"
            out.append((f"{operation}: {peer} over {ours}", f"≥ {least:.3g} ×", measured, reached))
    row = found.get(("predict", OURS))
    seconds = row.median_s if row else None
    reached = None if seconds is None else seconds < _TARGET_PREDICT
    out.append(("predict: one frame", f"< {_seconds(_TARGET_PREDICT)}",
                _seconds(seconds) or "not measured", reached))  # fmt: skip
    return out


def show(rows: Sequence[Row], path: Path, console: Console) -> None:
    """The headline table, the targets, the growth and what was skipped, on the terminal."""
    n, d, l = closest(rows)  # noqa: E741
    table = Table(title=f"N = {n}, D = {d:,}, L = {l}", title_justify="left")
    for name, justify in (("operation", "left"), ("route", "left"), ("median", "right"),
                          ("times ours", "right"), ("peak memory", "right"),
                          ("same result", "left")):  # fmt: skip
        table.add_column(name, justify=justify)  # type: ignore[arg-type]
    for row in headline(rows):
        table.add_row(*_cells(row))
    console.print(table)
    table = Table(title="targets", title_justify="left")
    for name in ("what", "target", "measured", ""):
        table.add_column(name)
    for what, target, measured, reached in targets(rows):
        table.add_row(what, target, measured, {True: "reached", False: "[red]missed[/red]"}.get(
            reached, "") if reached is not None else "")  # fmt: skip
    console.print(table)
    table = Table(title="growth of ours: exponent of the fitted power", title_justify="left")
    for name in ("operation", "in", "values", "time", "memory"):
        table.add_column(name)
    for operation, key, time_, memory, values in growth(rows):
        table.add_row(operation, key, ", ".join(f"{v:,}" for v in values),
                      *("" if x is None else f"{x:.2f}" for x in (time_, memory)))  # fmt: skip
    console.print(table)
    skipped: dict[tuple[str, str], list[str]] = {}
    for row in rows:
        if row.status != "ok":
            size = f"N = {row.n}, D = {row.d:,}, L = {row.l}"
            skipped.setdefault((size, row.status), []).append(f"{row.operation} by {row.route}")
    n_skipped = sum(map(len, skipped.values()))
    console.print(f"{len(rows)} measurements, {n_skipped} of them not made:")
    for (size, status), names in skipped.items():
        console.print(f"  {size}: {status}: {'; '.join(names)}", highlight=False)
    console.print(f"{os.path.relpath(path)}", soft_wrap=True)
