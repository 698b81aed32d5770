"""Numbers at their limits: every case with both errors and the verdict."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import pandas as pd

from experiments.reporting.columns import Column, milliseconds
from experiments.reporting.facets import intervals
from experiments.reporting.plot import entry, legend_below
from experiments.reporting.study import Figure
from experiments.reporting.table import Table
from experiments.reporting.text import number

if TYPE_CHECKING:
    from matplotlib.figure import Figure as Canvas

NAMES = [
    *("case", "part", "extreme", "naive", "ours", "unit", "tolerance"),
    *("error_naive", "error_ours", "verdict", "time_naive_s", "time_ours_s"),
]
# Ends of the axis, where no error and no number are drawn: errors lie between.
NONE, LOST = 1e-19, 1e19
_POINT: dict[str, Any] = {"ls": "", "ms": 3.2, "alpha": 0.5}
LOOKS = {
    "naive computation": {**_POINT, "color": "#E69F00", "marker": "o"},
    "this library": {**_POINT, "color": "#0072B2", "marker": "s"},
}


def error(value: float) -> str:
    """An error; counts are written out."""
    return f"{value:,.0f}" if value == int(value) and value < 1e6 else number(value, 2)


def title(data: pd.DataFrame) -> str:
    """How many cases hold."""
    holding = (data.verdict == "holds").sum()
    shown = "all" if holding == len(data) else holding
    return f"{len(data)} edge cases: {shown} hold in this library"


def draw(figure: Canvas, data: pd.DataFrame) -> None:
    """Both errors of each case in multiples of the tolerance, a row per family."""
    axes = figure.subplots()
    unit = data.tolerance.mask(data.tolerance == 0, 1)  # a bit or a label
    errors = {
        "naive computation": data.error_naive / unit,
        "this library": data.error_ours / unit,
    }
    shares = pd.DataFrame(errors).clip(NONE, LOST).fillna(LOST).assign(part=data.part)
    shares = shares.melt("part", var_name="way")
    families = data.part.value_counts(sort=False)
    rows: Any = {"names": families.index, "hues": list(LOOKS), "look": LOOKS.get}
    intervals(axes, shares, "value", "part", "way", **rows)
    axes.axvline(1, color="0.4", lw=0.7, ls="--")
    axes.set(xscale="log", xlim=(NONE / 10, LOST * 10))
    names = ["no\nerror", "$10^{-9}$", "1", "$10^9$", "no\nnumber"]
    axes.set_xticks([NONE, 1e-9, 1, 1e9, LOST], names)
    labels = [f"{name} ({n})" for name, n in families.items()]
    axes.set_yticks(range(len(families)), labels)
    axes.invert_yaxis()
    axes.minorticks_off()
    axes.grid(axis="y", color="0.92", lw=0.4)
    axes.set_xlabel("error, in multiples of the tolerance")
    legend_below(figure, [entry(name, **look) for name, look in LOOKS.items()])


TABLE = Table(
    "stability",
    lambda frame: frame.reindex(columns=NAMES),
    of="stability",
    title=title,
    columns={
        "extreme": Column("Why it is extreme"),
        "naive": Column("Naive computation"),
        "error_naive": Column(
            "Error, naive", error, note="A dash: no number came out."
        ),
        "error_ours": Column("Error, this library", error),
        "tolerance": Column("Tolerance", error),
        "time_naive_s": Column("CPU time, naive, ms", milliseconds, of_machine=True),
        "time_ours_s": Column("CPU time, ms", milliseconds, of_machine=True),
    },
    shown=(
        *("case", "extreme", "naive", "error_naive", "error_ours", "tolerance"),
        *("time_naive_s", "time_ours_s"),
    ),
    note="The same input by the naive computation and by this library, against an exact "
    "reference. A case holds if the library's error is within the tolerance. CPU time: of one "
    "call, on one thread.",
)
FIGURE = Figure(
    "stability",
    TABLE,
    draw,
    title=title,
    details="",
    caption="Extreme input, one row per family with its number of cases: error against an exact "
    "reference in multiples of the tolerance, by the naive computation and by this library. Left "
    "edge: no error; right edge: no number. Left of the line a method holds.",
    size=(3.4, 3.0),
)
