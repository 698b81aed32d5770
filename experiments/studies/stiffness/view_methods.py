"""Softmax regression by explicit, adaptive and second-order methods: error against run time."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from matplotlib import pyplot as plt
from matplotlib.figure import Figure
from matplotlib.ticker import FixedLocator, FuncFormatter, LogLocator, NullLocator

from experiments.records.measurement import Measured
from experiments.reporting import published
from experiments.reporting.plot import STYLE, WIDTH, head, plain_decades
from experiments.reporting.table import Columns, Row, cell, percent

GAPS = (1e-1, 1e-3, 1e-5)  # of F − F*, to which the time is told
Curves = dict[tuple[str, str, str], list[dict[str, str]]]

_PIXELS = {"unit": "0…1", "unit_centred": "0…1, centred", "centred": "0…1, each centred"}
# Okabe and Ito's colours; marker and line repeat the distinction.
_METHODS = {
    ("GD", "unit"): ("gradient descent", "#D55E00", "s", "-"),
    ("GD", "unit_centred"): ("gradient descent, centred", "#D55E00", "s", ":"),
    ("GD dual", "centred"): ("gradient descent, dual", "#E69F00", "o", "--"),
    ("Adam", "unit"): ("Adam", "#0072B2", "^", "-"),
    ("L-BFGS", "unit"): ("L-BFGS", "#009E73", "v", "-"),
    ("L-BFGS", "unit_centred"): ("L-BFGS, centred", "#009E73", "v", ":"),
    ("Newton dual", "centred"): ("Newton, dual", "#000000", "D", "--"),
}
_FLOOR = 1e-9  # of F − F*: float32 weights tell no smaller gap

NOTE = (
    "F: mean cross-entropy + ‖W‖²/(2CN), pixels in 0…1; F*: the dual Newton method at its "
    "tightest. Gradient descent at 0.9 of its stability limit. A dash: not reached in the time "
    "given."
)


def curves(measured: Measured) -> Curves:
    """Rows by method, pixels and rate, in the order of the work they took.

    The dual methods choose their rate themselves and are run anew for each number of steps: all
    rows of one are one curve, by steps.
    """
    found: Curves = {}
    for row in measured.rows:
        rate = "" if "steps" in row else row.get("rate", "")
        found.setdefault((row["method"], row["pixels"], rate), []).append(row)
    for lines in found.values():
        lines.sort(key=lambda row: float(row.get("steps", row["seconds"])))
    return found


def methods(measured: Measured) -> list[Row]:
    """One row a curve: the time to each of :data:`GAPS`, and where it ended."""
    rows: list[Row] = []
    for (method, pixels, _), lines in curves(measured).items():
        last = lines[-1]
        row: dict[str, Any] = {"method": method, "pixels": pixels}
        row["rate"] = float(last["rate"]) if "rate" in last else None
        for gap in GAPS:
            times = (float(x["seconds"]) for x in lines if float(x["loss_gap"]) <= gap)
            row[f"seconds_to_{gap:g}"] = next(times, None)
        rows.append(row | {k: float(last[k]) for k in ("seconds", "loss_gap", "test_error")})
    return rows


COLUMNS: Columns = {
    "Method": lambda row: row["method"],
    "Pixels": lambda row: _PIXELS[row["pixels"]],
    "Rate": cell("rate"),
    **{f"s to F − F* ≤ {gap:g}": cell(f"seconds_to_{gap:g}") for gap in GAPS},
    "s in all": cell("seconds"),
    "F − F* at the end": cell("loss_gap"),
    "Test error, %, at the end": lambda row: percent(row["test_error"]),
}


def error_against_time(measured: Measured, frames: str) -> Figure:
    """Loss gap and test error against training time, a curve a method."""
    with plt.rc_context(STYLE):
        figure, (above, below) = plt.subplots(
            2, 1, figsize=(WIDTH, 5.0), sharex=True, height_ratios=(2, 1), layout="constrained"
        )
        for label, (colour, marker, line), lines in _drawn(curves(measured)):
            times = [float(row["seconds"]) for row in lines]
            gaps = [max(float(row["loss_gap"]), _FLOOR) for row in lines]
            wrong = [100 * float(row["test_error"]) for row in lines]
            above.loglog(times, gaps, color=colour, marker=marker, ls=line, label=label)
            below.semilogx(times, wrong, color=colour, marker=marker, ls=line)
        above.yaxis.set_major_locator(LogLocator(numticks=12))
        above.set_ylabel("loss above the optimum, F − F*")
        below.set_ylabel("test error (%)")
        below.set_yscale("symlog", linthresh=1)
        below.yaxis.set_major_locator(FixedLocator([0, 1, 10, 100]))
        below.yaxis.set_minor_locator(NullLocator())
        below.yaxis.set_major_formatter(FuncFormatter(lambda y, _: f"{y:g}"))
        below.set_ylim(-0.2, 110)
        below.set_xlabel("training time (s)")
        plain_decades(below)
        figure.legend(loc="outside lower center", ncols=2)
        head(figure, "Softmax regression: error against training time", [frames])
    return figure


def _drawn(found: Curves) -> Iterator[tuple[str, tuple[str, str, str], list[dict[str, str]]]]:
    """Label, style and rows of each curve; of Adam the published rate and the best."""
    adam = {key: lines for key, lines in found.items() if key[0] == "Adam"}
    best = min(adam, key=lambda key: min(float(r["loss_gap"]) for r in adam[key]), default=None)
    known = published.value("table1/learning_rate")
    for group, (label, colour, marker, line) in _METHODS.items():
        for key, lines in found.items():
            if key[:2] != group:
                continue
            if key not in adam:
                yield label, (colour, marker, line), lines
            elif key == best or float(key[2]) == known:
                look = colour, marker, "-" if key == best else ":"
                yield f"{label}, {float(key[2]):.0e}", look, lines
