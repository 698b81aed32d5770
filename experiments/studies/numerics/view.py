"""What accuracy costs: the figure of error against CPU time."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from functools import partial

from matplotlib import pyplot as plt
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import LogLocator, NullFormatter, NullLocator

from experiments.records.measurement import Measured
from experiments.records.results import Results
from experiments.reporting.plot import STYLE, WIDTH, head, plain_decades
from experiments.reporting.study import Plot, Study

Row = Mapping[str, str]

# Okabe and Ito's palette; markers repeat the distinction where lines could be confused.
BLUE, GREEN, ORANGE, GREY = "#0072B2", "#009E73", "#D55E00", "0.4"
FLOOR = 2.0**-54  # half a unit in the last place of a correlation near one: drawn there if less


def plots(results: Results) -> Iterator[Plot]:
    """Phases, mean correlations and the displacement table."""
    measured = results.measured("numerics")
    if measured and measured.rows:
        yield Plot(
            "numerics",
            "Error against CPU time of phases, mean correlations and the elastic layer.",
            partial(error_against_time, measured),
            [measured.record.command],
        )


def error_against_time(measured: Measured) -> Figure:
    """A panel a problem."""
    with plt.rc_context(STYLE):
        figure, grid = plt.subplots(3, 1, figsize=(WIDTH, 7.0), layout="constrained")
        for axes, (problem, draw) in zip(grid, PANELS.items(), strict=True):
            draw(axes, [row for row in measured.rows if row["problem"] == problem])
        details = [f"{measured.record.environment.cpu}, one thread"]
        details += [f"{key}={value}" for key, value in measured.overrides.items()]
        head(figure, "Error against run time", [", ".join(details)])
    return figure


def _phases(axes: Axes, rows: Sequence[Row]) -> None:
    colours = {"float32": BLUE, "mixed": GREEN, "float64": ORANGE}
    markers = dict(zip(dict.fromkeys(row["input"] for row in rows), "os^", strict=False))
    for row in rows:
        _point(axes, row, colours[row["method"]], markers[row["input"]])
    axes.set_title("field of a path, 62,856 phases", loc="left")
    axes.set_ylabel("error of the field, rms")
    _dress(axes, rows, "tolerance: the camera's read noise", 0.02)
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
    axes.set_title("mean correlation of a class (Eq. 4)", loc="left")
    axes.set_ylabel("error of the correlation")
    _dress(axes, rows, "tolerance: half of the last digit printed", 0.32)
    handles = [*_markers(dict.fromkeys(colours, "o"), colours), *_markers(markers)]
    for name, face in zip(inputs, ("white", GREY), strict=False):
        handles.append(Line2D([], [], ls="", marker="D", color=GREY, mfc=face, label=name))
    _legend(axes, handles)


def _layer(axes: Axes, rows: Sequence[Row]) -> None:
    for method, look in (("largest", (BLUE, "o", "-")), ("root mean square", (ORANGE, "s", "--"))):
        colour, marker, line = look
        mine = [row for row in rows if row["method"] == method]
        points = [(_ms(row), float(row["error"])) for row in mine]
        axes.plot(*zip(*points, strict=True), color=colour, marker=marker, ls=line, label=method)
        for row, point in zip(mine, points, strict=True) if method == "largest" else ():
            box = {"fc": "white", "ec": "none", "pad": 0.3}
            axes.annotate(
                row["input"], point, (4, 3), textcoords="offset points", fontsize=6, bbox=box
            )
    axes.set_title("displacement table of the layer, by intervals", loc="left")
    axes.set_ylabel("error per indentation")
    _dress(axes, rows, "tolerance: 0.05 rad", 0.37)
    axes.legend(loc="lower left")


PANELS = {"phases": _phases, "correlations": _correlations, "layer": _layer}


def _dress(axes: Axes, rows: Sequence[Row], tolerance: str, place: float) -> None:
    """Logarithmic axes, and the tolerance with its label at this share of x."""
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.margins(x=0.12, y=0.12)
    axes.set_xlabel("CPU time (ms)")
    for row in rows[:1]:
        value = float(row["tolerance"])
        axes.axhline(value, color="0.5", lw=0.8, ls=(0, (4, 3)), zorder=0)
        across = axes.get_yaxis_transform()
        axes.annotate(
            tolerance,
            (place, value),
            (0, 2),
            xycoords=across,
            textcoords="offset points",
            fontsize=6,
            color="0.3",
        )
    low, high = axes.get_xlim()
    if high < 8 * low:  # less than a decade would have few ticks
        middle = math.sqrt(low * high)
        axes.set_xlim(middle / 3, middle * 3)
    axes.xaxis.set_major_locator(LogLocator(subs=(1, 2, 5), numticks=10))
    plain_decades(axes)
    axes.xaxis.set_minor_formatter(NullFormatter())
    axes.yaxis.set_major_locator(LogLocator(numticks=7))
    axes.yaxis.set_minor_locator(NullLocator())


def _point(axes: Axes, row: Row, colour: str, marker: str, hollow: bool = False) -> None:
    face = "white" if hollow else colour
    axes.plot(_ms(row), max(float(row["error"]), FLOOR), marker, color=colour, mfc=face)


def _markers(shapes: Mapping[str, str], colours: Mapping[str, str] | None = None) -> list[Line2D]:
    """Entries of a legend, grey unless there are colours."""
    return [
        Line2D([], [], ls="", marker=m, color=(colours or {}).get(name, GREY), label=name)
        for name, m in shapes.items()
    ]


def _legend(axes: Axes, handles: Sequence[Line2D]) -> None:
    """Below the axes, in columns of three."""
    axes.legend(
        handles=handles,
        loc="upper center",
        bbox_to_anchor=(0.45, -0.24),
        ncols=math.ceil(len(handles) / 3),
        handlelength=1.0,
    )


def _ms(row: Row) -> float:
    return 1e3 * float(row["time_s"])


def _power(value: float) -> str:
    """A power of ten as one."""
    return f"$10^{{{round(math.log10(value))}}}$"


STUDY = Study(
    "numerics",
    "Error against run time of the numerics",
    "How exact are phases of many turns, mean correlations and the elastic layer, and what would "
    "another digit cost?",
    10,
    plots=plots,
)
