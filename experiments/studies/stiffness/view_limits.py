"""Largest stable learning rates, predicted and found, and the eigenvalues they follow from."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib import pyplot as plt
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import NullLocator

from experiments.records.measurement import Measured
from experiments.reporting import published
from experiments.reporting.plot import STYLE, WIDTH, head, plain_decades
from experiments.reporting.rows import display_name
from experiments.reporting.table import Columns, Row, cell, number

GROUP = ("model", "pixels", "method", "start")  # what the rows of one sweep have in common
Lines = Sequence[dict[str, str]]

_METHODS = {"GD": "gradient descent", "SGD": "SGD, batches of 20", "Adam": "Adam, batches of 20"}
# Okabe and Ito's colours; marker and line repeat the distinction.
_PIXELS = {
    "raw": ("0…255", "#0072B2", "o", "-"),
    "unit": ("0…1", "#D55E00", "s", "--"),
    "standard": ("standardised", "#009E73", "^", "-"),
}
_OTHERS = {
    ("softmax", "unit", "Adam", "zero"): ("softmax, 0…1, Adam", "#D55E00", "s", ":"),
    ("softmax", "standard", "Adam", "zero"): ("softmax, standardised, Adam", "#009E73", "^", ":"),
    ("cnn1", "unit", "GD", "random"): ("CNN, 1 layer, GD", "#CC79A7", "v", "-"),
    ("cnn1", "unit", "Adam", "random"): ("CNN, 1 layer, Adam", "#CC79A7", "v", ":"),
    ("cnn3", "unit", "GD", "random"): ("CNN, 3 layers, GD", "#000000", "D", "-"),
    ("cnn3", "unit", "Adam", "random"): ("CNN, 3 layers, Adam", "#000000", "D", ":"),
}

NOTE = (
    "Predicted: 2/λ_max of the Hessian at the start; for SGD of the mean over minibatches; for "
    "Adam 38/λ_max of the Hessian preconditioned by the slopes of an epoch. Found: geometric mean "
    "of the two swept rates between which it begins. Start “optimum”: of the penalised loss, "
    "slightly perturbed; the others have no penalty. The networks see fewer frames, the middle of "
    "each."
)


def sweeps(measured: Measured) -> dict[tuple[str, ...], list[dict[str, str]]]:
    """The rows of each sweep by :data:`GROUP`, in the order of their rates."""
    found: dict[tuple[str, ...], list[dict[str, str]]] = {}
    for row in measured.rows:
        if row["kind"] == "sweep":
            found.setdefault(tuple(row[key] for key in GROUP), []).append(row)
    return {key: sorted(lines, key=lambda r: float(r["rate"])) for key, lines in found.items()}


def limits(measured: Measured) -> list[Row]:
    """One row a sweep: the predicted largest stable rate and those found.

    A limit is the geometric mean of the lowest rate at which something happened and the next lower
    one; ``> rate`` and ``< rate`` if it never or always happened.
    """
    return [_limit(lines) for lines in sweeps(measured).values()]


def _limit(lines: Lines) -> Row:
    first = lines[0]
    row: dict[str, Any] = {key: first[key] for key in GROUP}
    row |= {"n": int(first["n"]), "d": int(first["d"])}
    row["lambda_max"] = float(first["lambda_max"]) if "lambda_max" in first else None
    row["predicted"] = float(first["predicted"])
    row |= {key: _crossing(lines, key) for key in ("rises", "exceeds", "ends_above")}
    found = row["exceeds"]
    ratio = None if isinstance(found, str) else found / row["predicted"]
    row["exceeds_over_predicted"] = ratio
    row["within_factor_2"] = "yes" if ratio and 0.5 <= ratio <= 2 else "no"
    row["why_not"] = None if row["within_factor_2"] == "yes" else _why_not(row, lines)
    return row


def _crossing(lines: Lines, key: str) -> float | str:
    rates = [float(line["rate"]) for line in lines]
    at = next((k for k, line in enumerate(lines) if line[key] == "yes"), None)
    if at is None:
        return f"> {number(rates[-1])}"
    return math.sqrt(rates[at - 1] * rates[at]) if at else f"< {number(rates[0])}"


def _why_not(row: Row, lines: Lines) -> str:
    """Why a limit was not found where it was predicted, from the rows where they say it."""
    ends = {float(x["rate"]): float(x["lambda_end"]) for x in lines if "lambda_end" in x}
    if str(row["exceeds"]).startswith(">"):
        fallen = next((x for rate, x in sorted(ends.items()) if rate > row["predicted"]), None)
        text = "the frames are separated before the swings grow"
        return text if fallen is None else f"{text}; λ_max falls to {number(fallen)}"
    if row["method"] == "Adam":
        return "the first steps have no settled mean square of the slopes, and are all of one size"
    grown = max(ends.values(), default=0.0)
    if grown > 1.5 * row["lambda_max"]:
        return f"the network sharpens as it learns: λ_max grows to {number(grown)}"
    return "λ_max at the start is no bound along the way"


COLUMNS: Columns = {
    "Model": lambda row: display_name(row["model"]),
    "Pixels": lambda row: _PIXELS[row["pixels"]][0],
    "Method": lambda row: _METHODS[row["method"]],
    "Start": lambda row: row["start"],
    "N × D": lambda row: f"{row['n']} × {row['d']:,}",
    "λ_max": cell("lambda_max"),
    "Predicted limit": cell("predicted"),
    "Loss rises above": cell("rises"),
    "Loss exceeds the start above": cell("exceeds"),
    "Loss ends above the start above": cell("ends_above"),
    "Exceeds / predicted": cell("exceeds_over_predicted"),
    "Within a factor 2": lambda row: row["within_factor_2"],
    "Why not": lambda row: row["why_not"] or "–",
}


def published_rate(rows: Sequence[Row]) -> str:
    """Where the published learning rate lies among the limits of :func:`limits`."""
    rate = published.value("table1/learning_rate")
    from_zero = [row for row in rows if (row["model"], row["start"]) == ("softmax", "zero")]
    if rate is None or not from_zero:
        return ""
    found = (
        f"{COLUMNS['Loss exceeds the start above'](row)} ({_PIXELS[row['pixels']][0]}, "
        f"{_METHODS[row['method']]})"
        for row in from_zero
    )
    return (
        f"The published rate is {number(rate)}, with an optimiser and a scaling of the pixels that "
        "are not; from zero weights the loss of softmax regression exceeds its start above "
        f"{', '.join(found)}."
    )


# Figures ------------------------------------------------------------------------------------------


def stability_limit(measured: Measured, frames: str) -> Figure:
    """Highest loss over the first one, against the rate in units of the predicted limit."""
    found = sweeps(measured)
    panels = (
        (("GD", "zero"), "loss_max", 1e3, "Softmax regression from zero weights"),
        (("GD", "optimum"), "loss_end", 1e6, "The same, from near the optimum"),
        (None, "loss_max", 1e3, "Adam, and convolutional networks (smaller frames)"),
    )
    with plt.rc_context(STYLE):
        figure, grid = plt.subplots(3, 1, figsize=(WIDTH, 5.9), sharex=True, layout="constrained")
        for axes, (sweep, key, ceiling, title) in zip(grid, panels, strict=True):
            shown = _OTHERS
            if sweep:
                shown = {("softmax", name, *sweep): style for name, style in _PIXELS.items()}
            for group, style in shown.items():
                _curve(axes, found.get(group, []), key, ceiling, *style)
            axes.set_title(title, loc="left")
            axes.axvline(1, color="0.5", lw=0.7, ls=(0, (4, 3)), zorder=0)
            axes.axhline(1, color="0.8", lw=0.7, zorder=0)
            axes.set_ylabel("highest / first loss")
        first, second, third = grid
        for name, (_, colour, marker, _) in _PIXELS.items():
            lines = found.get(("softmax", name, "SGD", "zero"), [])
            _curve(first, lines, "loss_max", 1e3, "", colour, marker, ":")
        first.plot([], [], color="0.3", ls=":", label="the same in minibatches (SGD)")
        second.set_ylabel("last / first loss gap")
        third.set_ylim(0.7, 1e5)  # room for the legend above the curves
        third.set_xlabel("learning rate / predicted limit")
        plain_decades(third)
        for axes in grid:
            legend = axes.legend(loc="upper left", handlelength=2.4, frameon=True, framealpha=1)
            legend.get_frame().set(facecolor="white", edgecolor="none")
        head(figure, "Largest stable learning rate: predicted and found", [frames])
    return figure


def _curve(
    axes: Axes,
    lines: Lines,
    key: str,
    ceiling: float,
    label: str,
    colour: str,
    marker: str,
    style: str,
) -> None:
    """A loss over the first one against the rate over the predicted limit.

    What is above the ceiling, or no number, is drawn there.
    """
    if not lines:
        return
    x = [float(r["rate"]) / float(r["predicted"]) for r in lines]
    y = np.array([float(r[key]) / float(r["loss_start"]) for r in lines])
    y = np.clip(np.nan_to_num(y, nan=ceiling), 1 / ceiling, ceiling)
    axes.loglog(x, y, color=colour, marker=marker, ls=style, label=label)
    axes.xaxis.set_minor_locator(NullLocator())


def spectrum(measured: Measured, frames: str) -> Figure:
    """Eigenvalues of the Hessian of softmax regression against their index."""
    rows = [row for row in measured.rows if row["kind"] == "spectrum"]
    with plt.rc_context(STYLE):
        figure, axes = plt.subplots(figsize=(WIDTH, 2.9), layout="constrained")
        for name, (label, colour, marker, _) in _PIXELS.items():
            for key, style, face in (
                ("eigenvalue", "-", colour),
                ("eigenvalue_optimum", ":", "white"),
            ):
                lines = [row for row in rows if row["pixels"] == name and key in row]
                axes.loglog(
                    [int(row["index"]) for row in lines],
                    [float(row[key]) for row in lines],
                    color=colour,
                    ls=style,
                    marker=marker,
                    ms=2.5,
                    mfc=face,
                    mew=0.6,
                    label=label if key == "eigenvalue" and lines else None,
                )
        handles, _ = axes.get_legend_handles_labels()
        grey = {"color": "0.3", "ls": ":", "marker": "o", "mfc": "white", "ms": 2.5}
        handles.append(Line2D([], [], label="at the penalised optimum", **grey))  # type: ignore[arg-type]
        figure.legend(handles=handles, loc="outside lower center", ncols=2)
        axes.set_xlabel("index of the eigenvalue")
        axes.set_ylabel("eigenvalue of the Hessian")
        plain_decades(axes)
        head(figure, "Stiffness of softmax regression, by scaling of the pixels", [frames])
    return figure
