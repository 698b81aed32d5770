"""Numbers at their limits: every case with both errors and the verdict."""

from __future__ import annotations

import pandas as pd
from matplotlib.figure import Figure

from experiments.records.results import own_columns
from experiments.reporting.columns import Column
from experiments.reporting.plot import head
from experiments.reporting.study import Plot
from experiments.reporting.table import Table
from experiments.reporting.text import number


def error(value: float) -> str:
    """An error; counts are written out."""
    return f"{value:,.0f}" if value == int(value) and value < 1e6 else number(value, 2)


COLUMNS = {
    "part": Column("Family"),
    "case": Column("Case"),
    "extreme": Column("Why it is extreme"),
    "naive": Column("Obvious computation"),
    "unit": Column("Error in"),
    "error_naive": Column("Error, obvious", error, note="A dash: no number came out."),
    "error_ours": Column("Error, ours", error),
    "tolerance": Column("Tolerance", error),
}


def _title(rows: pd.DataFrame) -> str:
    holding = (rows["verdict"] == "holds").sum()
    return f"Numbers at their limits: {holding} of {len(rows)} cases hold"


# Ends of the axis, where no error and no number are drawn: errors lie between.
NONE, LOST = 1e-19, 1e19


def at_their_limits(figure: Figure, rows: pd.DataFrame) -> None:
    """Both errors of each case, on a logarithmic axis, a row per family."""
    axes = figure.subplots()
    places, known = pd.factorize(rows.part)
    for column, colour, marker, name in (
        ("error_naive", "#E69F00", "o", "obvious implementation"),
        ("error_ours", "#0072B2", "s", "ours"),
    ):
        shares = _of_tolerance(rows[column], rows.tolerance)
        beside = 0.15 if column == "error_ours" else -0.15
        axes.plot(
            shares, places + beside, marker, color=colour, ms=3.2, alpha=0.5, label=name
        )
    axes.axvline(1, color="0.4", lw=0.7, ls="--")
    axes.set(xscale="log", xlim=(NONE / 10, LOST * 10), ylim=(len(known) - 0.4, -0.6))
    axes.set_xticks(
        [NONE, 1e-9, 1, 1e9, LOST],
        ["no\nerror", "$10^{-9}$", "1", "$10^9$", "no\nnumber"],
    )
    sizes = rows.part.value_counts()
    heads = [f"{name} ({sizes[name]})" for name in known]
    axes.set_yticks(range(len(known)), heads)
    axes.minorticks_off()
    axes.grid(axis="y", color="0.92", lw=0.4)
    axes.set_axisbelow(True)
    axes.set_xlabel("error, in multiples of the tolerance")
    figure.legend(loc="outside lower center", ncols=2)
    holding = (rows.verdict == "holds").sum()
    head(figure, f"Extreme input: {holding} of {len(rows)} cases hold", [])


def _of_tolerance(errors: pd.Series, tolerances: pd.Series) -> pd.Series:
    """Errors in multiples of the tolerance, where it is zero of one unit (a bit, a label)."""
    unit = tolerances.where(tolerances > 0, 1.0)
    shares = (errors / unit).clip(NONE, LOST)
    return shares.fillna(LOST)


TABLES = [
    Table(
        "stability",
        own_columns,
        of="stability",
        title=_title,
        columns=COLUMNS,
        shown=(
            "part",
            "case",
            "extreme",
            "naive",
            "unit",
            "error_naive",
            "error_ours",
            "tolerance",
        ),
        note="The same input by the obvious implementation and by ours, against an exact "
        "reference. A case holds if our error is within the tolerance.",
    )
]
FIGURES = [
    Plot(
        "stability",
        at_their_limits,
        of="stability",
        size=(3.4, 3.0),
        caption="Extreme input, one row per family with its number of cases: error "
        "against an exact reference in multiples of the tolerance, by the obvious "
        "method and by ours. Left edge: no error; right edge: no number. Left of "
        "the line a method holds.",
    )
]
