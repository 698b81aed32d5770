"""The figure of error against CPU time, from the measurement ``numerics``."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path

from matplotlib import pyplot as plt
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter, NullLocator

from experiments.figures import STYLE, WIDTH
from experiments.measurement import read

Row = dict[str, str]

# Okabe and Ito's palette; markers repeat the distinction where lines could be confused.
BLUE, GREEN, ORANGE, GREY = "#0072B2", "#009E73", "#D55E00", "0.4"
FLOOR = 2.0**-54  # half a unit in the last place of a correlation near one: drawn there if less


def figure(results: Path) -> Figure | None:
    """Phases, mean correlations and the displacement table; None without the measurement."""
    measured = read(results, "numerics")
    if measured is None or not measured.rows:
        return None
    title = f"Error against run time, {measured.record['environment']['cpu']}, one thread"
    if measured.outdated:
        title += "\ncode has changed since these were measured"
    with plt.rc_context(STYLE):
        drawn, panels = plt.subplots(3, 1, figsize=(WIDTH, 7.0), layout="constrained")
        for axes, (problem, draw) in zip(panels, PANELS.items(), strict=True):
            draw(axes, [row for row in measured.rows if row["problem"] == problem])
        drawn.suptitle(title, x=0.01, ha="left", fontsize=7)
    return drawn


def _phases(axes: Axes, rows: Sequence[Row]) -> None:
    colours = {"float32": BLUE, "mixed": GREEN, "float64": ORANGE}
    markers = dict(zip(dict.fromkeys(row["input"] for row in rows), "os^", strict=False))
    for row in rows:
        _point(axes, row, colours[row["method"]], markers[row["input"]])
    _dress(axes, rows, "field of a path, 62,856 phases", "error of the field, rms",
           "tolerance: the camera's read noise", 0.02)  # fmt: skip
    reach = {f"to {_power(float(size.split()[0]))} rad": m for size, m in markers.items()}
    colours["mixed: to one turn first"] = colours.pop("mixed")
    _legend(axes, [*_markers(dict.fromkeys(colours, "o"), colours), *_markers(reach)])


def _correlations(axes: Axes, rows: Sequence[Row]) -> None:
    colours = {"double sum": BLUE, "Gram matrix": GREEN, "class sum": ORANGE}
    markers = {"float32": "o", "compensated": "^", "float64": "s"}
    inputs = list(dict.fromkeys(row["input"] for row in rows))
    for row in rows:
        form, number = row["method"].split(", ")
        _point(axes, row, colours[form], markers[number], hollow=row["input"] == inputs[0])
    _dress(axes, rows, "mean correlation of a class (Eq. 4)", "error of the correlation",
           "tolerance: half of the last digit printed", 0.32)  # fmt: skip
    handles = [*_markers(dict.fromkeys(colours, "o"), colours), *_markers(markers)]
    for name, face in zip(inputs, ("white", GREY), strict=False):
        handles.append(Line2D([], [], ls="", marker="D", color=GREY, mfc=face, label=name))
    _legend(axes, handles)


def _layer(axes: Axes, rows: Sequence[Row]) -> None:
    for method, colour, marker, line in (
        ("largest", BLUE, "o", "-"),
        ("root mean square", ORANGE, "s", "--"),
    ):
        mine = [row for row in rows if row["method"] == method]
        axes.plot(list(map(_ms, mine)), [float(row["error"]) for row in mine], color=colour,
                  marker=marker, ls=line, label=method)  # fmt: skip
        for row in mine if method == "largest" else ():
            axes.annotate(row["input"], (_ms(row), float(row["error"])), (4, 3),
                          textcoords="offset points", fontsize=6,
                          bbox={"fc": "white", "ec": "none", "pad": 0.3})  # fmt: skip
    _dress(axes, rows, "displacement table of the layer, by intervals",
           "error per indentation", "tolerance: 0.05 rad", 0.02)  # fmt: skip
    axes.legend(loc="lower left")


PANELS = {"phases": _phases, "correlations": _correlations, "layer": _layer}


def _dress(
    axes: Axes, rows: Sequence[Row], title: str, error: str, tolerance: str, place: float
) -> None:
    """Logarithmic axes with their titles, and the tolerance with its label at this share of x."""
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.margins(x=0.12, y=0.12)
    axes.set_title(title, loc="left")
    axes.set_xlabel("CPU time (ms)")
    axes.set_ylabel(error)
    for row in rows[:1]:
        value = float(row["tolerance"])
        axes.axhline(value, color="0.5", lw=0.8, ls=(0, (4, 3)), zorder=0)
        axes.annotate(tolerance, (place, value), (0, 2), textcoords="offset points", fontsize=6,
                      xycoords=("axes fraction", "data"), color="0.3")  # fmt: skip
    low, high = axes.get_xlim()
    if high < 8 * low:  # less than a decade would have few ticks
        middle = math.sqrt(low * high)
        axes.set_xlim(middle / 3, middle * 3)
    axes.xaxis.set_major_locator(LogLocator(subs=(1, 2, 5), numticks=10))
    axes.xaxis.set_major_formatter(FuncFormatter(lambda x, _: f"{x:g}"))
    axes.xaxis.set_minor_formatter(NullFormatter())
    axes.yaxis.set_major_locator(LogLocator(numticks=7))
    axes.yaxis.set_minor_locator(NullLocator())


def _point(axes: Axes, row: Row, colour: str, marker: str, hollow: bool = False) -> None:
    axes.plot(_ms(row), max(float(row["error"]), FLOOR), marker, color=colour,
              mfc="white" if hollow else colour)  # fmt: skip


def _markers(shapes: Mapping[str, str], colours: Mapping[str, str] | None = None) -> list[Line2D]:
    """Entries of a legend, grey unless there are colours."""
    return [
        Line2D([], [], ls="", marker=m, color=(colours or {}).get(name, GREY), label=name)
        for name, m in shapes.items()
    ]


def _legend(axes: Axes, handles: Sequence[Line2D]) -> None:
    """Below the axes, in columns of three."""
    axes.legend(handles=handles, loc="upper center", bbox_to_anchor=(0.45, -0.24),
                ncols=math.ceil(len(handles) / 3), handlelength=1.0)  # fmt: skip


def _ms(row: Row) -> float:
    return 1e3 * float(row["time_s"])


def _power(value: float) -> str:
    """A power of ten as one."""
    return f"$10^{{{round(math.log10(value))}}}$"
