"""Error against run time of the numerics."""

from __future__ import annotations

import re

import pandas as pd
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import LogLocator, NullLocator

from experiments.records.results import own_columns
from experiments.reporting.columns import Column, milliseconds
from experiments.reporting.curves import plain_decades
from experiments.reporting.plot import panel
from experiments.reporting.study import Plot
from experiments.reporting.table import Table

# Half a unit in the last place of a correlation near one: smaller is drawn there.
FLOOR = 2.0**-54
# Okabe and Ito's.
COLOURS = {"float32": "#0072B2", "mixed": "#009E73", "float64": "#D55E00"}


def table(
    rows: pd.DataFrame,
) -> pd.DataFrame | None:
    """A row per method; None of records that judge nothing."""
    return own_columns(rows) if "verdict" in rows else None


def _decade(text: str) -> str:
    """A text with ``1e+05`` written as a power of ten."""
    return re.sub(r"1e\+0*(\d+)", r"$10^{\1}$", text)


def error_against_time(
    figure: Figure,
    rows: pd.DataFrame,
) -> None:
    """A panel per input, a colour per precision, a marker per method."""
    every = figure.subplots(rows["input"].nunique(), 1)
    for axes, letter, (name, part) in zip(
        every, "abc", rows.groupby("input", sort=False), strict=True
    ):
        markers = dict(zip(part["method"].unique(), "os^", strict=False))
        for method, of_method in part.groupby("method", sort=False):
            errors = of_method["error"].clip(FLOOR)
            axes.loglog(
                1e3 * of_method["time_s"], errors, color="0.7", lw=0.7, marker=""
            )
            for time_s, error, number in zip(
                of_method["time_s"], errors, of_method["number"], strict=True
            ):
                axes.plot(1e3 * time_s, error, markers[method], color=COLOURS[number])
        tolerance = part["tolerance"].iloc[0]
        axes.axhline(
            tolerance,
            color="0.5",
            lw=0.8,
            ls="--",
            zorder=0,
        )
        place = {
            "transform": axes.get_yaxis_transform(),
            "ha": "right",
            "va": "bottom",
        }
        axes.text(
            0.98,
            tolerance,
            "tolerable",
            fontsize=5.5,
            color="0.4",
            **place,
        )
        unit = " (mean intensities)" if name == "phases" else ""
        axes.set(xlabel="CPU time (ms)", ylabel=f"error{unit}")
        times = part["time_s"]
        axes.set_xlim(300 * times.min(), 3000 * times.max())
        axes.margins(y=0.15)
        axes.xaxis.set_major_locator(LogLocator(subs=(1, 3)))
        axes.xaxis.set_minor_locator(NullLocator())
        plain_decades(axes)
        panel(axes, letter, name if name == "phases" else f"mean correlation, {name}")
        looks = [(n, COLOURS[n], "o") for n in part["number"].unique()]
        looks += [(method, "0.4", marker) for method, marker in markers.items()]
        handles = [
            Line2D(
                [],
                [],
                ls="",
                color=c,
                marker=m,
                label=_decade(n),
            )
            for n, c, m in looks
        ]
        axes.legend(
            handles=handles, loc="center left", bbox_to_anchor=(1, 0.5), handlelength=1
        )


TABLES = [
    Table(
        "numerics",
        table,
        of="numerics",
        title="Error and time of phases and of mean correlations. {machine}",
        columns={
            "input": Column("Input"),
            "method": Column("Method"),
            "number": Column("Precision"),
            "error": Column("Error"),
            "tolerance": Column("Tolerance"),
            "time_s": Column("CPU time, ms", milliseconds),
            "verdict": Column("Verdict"),
        },
        note="Phases: the camera's frame of 62,856 paths, error in mean intensities. Precision: "
        "of the phases; mixed: reduced modulo 2π in float64, the remainder in float32. Verdict: "
        "of what this project uses; it holds if its error is within the tolerance.",
    )
]
FIGURES = [
    Plot(
        "numerics",
        error_against_time,
        of="numerics",
        caption="Error against CPU time, one thread: a frame by the phases of its paths "
        "(float32, float64, or mixed: reduced modulo 2π in float64), and the mean "
        "correlation of a class (Eq. 4) for two kinds of frames. Lines join the "
        "points of a method. Dashed: the tolerable error, the camera's read noise and "
        "half of the paper's last digit.",
        size=(3.4, 5.2),
    )
]
