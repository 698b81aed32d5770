"""Figures of the measurements stiffness and softmax_methods, one column wide.

Each is drawn from the rows in ``measured/`` of a results folder, and is None where they are not.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import FixedLocator, FuncFormatter, LogLocator, NullLocator

from experiments import measurement
from experiments.figures import STYLE, WIDTH, plt
from experiments.stiffness_tables import sweeps, work

# Okabe and Ito's palette, as in experiments.figures; marker and line repeat the distinction.
_PIXELS = {
    "raw": ("#0072B2", "o", "-", "0…255"),
    "unit": ("#D55E00", "s", "--", "0…1"),
    "standard": ("#009E73", "^", "-", "standardised"),
}
_OTHERS = {
    ("softmax", "unit", "Adam"): ("#D55E00", "s", ":", "softmax, 0…1, Adam"),
    ("softmax", "standard", "Adam"): ("#009E73", "^", ":", "softmax, standardised, Adam"),
    ("cnn1", "unit", "GD"): ("#CC79A7", "v", "-", "CNN, 1 layer, GD"),
    ("cnn1", "unit", "Adam"): ("#CC79A7", "v", ":", "CNN, 1 layer, Adam"),
    ("cnn3", "unit", "GD"): ("#000000", "D", "-", "CNN, 3 layers, GD"),
    ("cnn3", "unit", "Adam"): ("#000000", "D", ":", "CNN, 3 layers, Adam"),
}
_METHODS = {
    ("GD", "unit"): ("#D55E00", "s", "-", "gradient descent"),
    ("GD", "unit_centred"): ("#D55E00", "s", ":", "gradient descent, centred"),
    ("GD dual", "centred"): ("#E69F00", "o", "--", "gradient descent, dual"),
    ("Adam", "unit"): ("#0072B2", "^", "-", "Adam"),
    ("L-BFGS", "unit"): ("#009E73", "v", "-", "L-BFGS"),
    ("L-BFGS", "unit_centred"): ("#009E73", "v", ":", "L-BFGS, centred"),
    ("Newton dual", "centred"): ("#000000", "D", "--", "Newton, dual"),
}
_CEILINGS = (1e3, 1e6, 1e3)  # of a loss relative to the first; what is above is drawn there
_FLOOR = 1e-9  # of F − F*: float32 weights tell no smaller gap
_PUBLISHED = 1e-4


def stability_limit(results: Path) -> Figure | None:
    """Highest loss over the first one, against the rate in units of the predicted limit."""
    measured = measurement.read(results, "stiffness")
    if measured is None or not measured.rows:
        return None
    found = sweeps(measured)
    with plt.rc_context(STYLE):
        figure, panels = plt.subplots(3, 1, figsize=(WIDTH, 5.9), sharex=True, layout="constrained")
        for name, (colour, marker, line, label) in _PIXELS.items():
            for k, method, start, style, key in (
                (0, "GD", "zero", line, "loss_max"),
                (0, "SGD", "zero", ":", "loss_max"),
                (1, "GD", "optimum", line, "loss_end"),
            ):
                lines = found.get(("softmax", name, method, start), [])
                shown = label if method == "GD" else None
                _sweep(panels[k], lines, key, _CEILINGS[k], colour, marker, style, shown)
        panels[0].plot([], [], color="0.3", ls=":", label="the same in minibatches (SGD)")
        for (model, pixels, method), (colour, marker, style, label) in _OTHERS.items():
            start = "zero" if model == "softmax" else "random"
            lines = found.get((model, pixels, method, start), [])
            _sweep(panels[2], lines, "loss_max", _CEILINGS[2], colour, marker, style, label)
        titles = (
            "Softmax regression from zero weights",
            "The same, gradient descent from near the optimum",
            "Adam, and convolutional networks (smaller frames)",
        )
        for axes, title in zip(panels, titles, strict=True):
            axes.set_title(title, loc="left")
            axes.axvline(1, color="0.5", lw=0.7, ls=(0, (4, 3)), zorder=0)
            axes.axhline(1, color="0.8", lw=0.7, zorder=0)
            axes.set_ylabel("highest / first loss")
            axes.legend(loc="upper left", handlelength=2.4, frameon=True, facecolor="white",
                        edgecolor="none", framealpha=1)  # fmt: skip
        panels[1].set_ylabel("last / first loss gap")
        panels[2].set_ylim(0.7, 1e5)  # room for the legend above the curves
        panels[2].set_xlabel("learning rate / predicted limit")
        panels[2].xaxis.set_major_formatter(FuncFormatter(lambda x, _: f"{x:g}"))
        _title(figure, "Largest stable learning rate: predicted and found")
    return figure


def spectrum(results: Path) -> Figure | None:
    """Eigenvalues of the Hessian of softmax regression against their index."""
    measured = measurement.read(results, "stiffness")
    rows = [] if measured is None else [r for r in measured.rows if r["kind"] == "spectrum"]
    if not rows:
        return None
    with plt.rc_context(STYLE):
        figure, axes = plt.subplots(figsize=(WIDTH, 2.9), layout="constrained")
        for name, (colour, marker, _, label) in _PIXELS.items():
            for key, style, face in (
                ("eigenvalue", "-", colour),
                ("eigenvalue_optimum", ":", "white"),
            ):
                points = [(int(r["index"]), float(r[key])) for r in rows
                          if r["pixels"] == name and key in r]  # fmt: skip
                if points:
                    axes.loglog(*zip(*points, strict=True), color=colour, ls=style, marker=marker,
                                ms=2.5, mfc=face, mew=0.6,
                                label=label if key == "eigenvalue" else None)  # fmt: skip
        at_optimum = Line2D([], [], color="0.3", ls=":", marker="o", mfc="white", ms=2.5,
                            label="at the penalised optimum")  # fmt: skip
        handles, _ = axes.get_legend_handles_labels()
        figure.legend(handles=[*handles, at_optimum], loc="outside lower center", ncols=2)
        axes.set_xlabel("index of the eigenvalue")
        axes.set_ylabel("eigenvalue of the Hessian")
        axes.xaxis.set_major_formatter(FuncFormatter(lambda x, _: f"{x:g}"))
        _title(figure, "Stiffness of softmax regression, by scaling of the pixels")
    return figure


def methods(results: Path) -> Figure | None:
    """Loss gap and test error against training time, a curve a method."""
    measured = measurement.read(results, "softmax_methods")
    if measured is None or not measured.rows:
        return None
    adam = [r for r in measured.rows if r["method"] == "Adam"]
    best = min(adam, key=lambda r: float(r["loss_gap"]), default={"rate": ""})["rate"]
    with plt.rc_context(STYLE):
        figure, (above, below) = plt.subplots(
            2, 1, figsize=(WIDTH, 5.0), sharex=True, height_ratios=(2, 1), layout="constrained"
        )
        for (method, pixels), (colour, marker, style, label) in _METHODS.items():
            mine = [r for r in measured.rows if (r["method"], r["pixels"]) == (method, pixels)]
            curves = [(label, style, mine)]
            if method == "Adam" and mine:
                chosen = sorted(
                    {r["rate"] for r in mine if float(r["rate"]) == _PUBLISHED} | {best}
                )
                curves = [
                    (f"{label}, {_rate(float(rate))}", "-" if rate == best else ":",
                     [r for r in mine if r["rate"] == rate])
                    for rate in chosen
                ]  # fmt: skip
            for name, look, lines in curves:
                lines.sort(key=work)
                if not lines:
                    continue
                times = [float(r["seconds"]) for r in lines]
                gaps = [max(float(r["loss_gap"]), _FLOOR) for r in lines]
                errors = [100 * float(r["test_error"]) for r in lines]
                above.plot(times, gaps, color=colour, marker=marker, ls=look, label=name)
                below.plot(times, errors, color=colour, marker=marker, ls=look)
        above.set_xscale("log")
        above.set_yscale("log")
        above.yaxis.set_major_locator(LogLocator(numticks=12))
        above.set_ylabel("loss above the optimum, F − F*")
        below.set_ylabel("test error (%)")
        below.set_yscale("symlog", linthresh=1)
        below.yaxis.set_major_locator(FixedLocator([0, 1, 10, 100]))
        below.yaxis.set_minor_locator(NullLocator())
        below.yaxis.set_major_formatter(FuncFormatter(lambda y, _: f"{y:g}"))
        below.set_ylim(-0.2, 110)
        below.set_xlabel("training time (s)")
        below.xaxis.set_major_formatter(FuncFormatter(lambda x, _: f"{x:g}"))
        handles, _ = above.get_legend_handles_labels()
        figure.legend(handles=handles, loc="outside lower center", ncols=2)
        _title(figure, "Softmax regression: error against training time")
    return figure


# Parts --------------------------------------------------------------------------------------------


def _sweep(
    axes: Axes,
    lines: Sequence[dict[str, str]],
    key: str,
    ceiling: float,
    colour: str,
    marker: str,
    style: str,
    label: str | None,
) -> None:
    """One sweep: a loss over the first one against the rate over the predicted limit."""
    if not lines:
        return
    x = [float(r["rate"]) / float(r["predicted"]) for r in lines]
    y = np.array([float(r[key]) / float(r["loss_start"]) for r in lines])
    y = np.clip(np.nan_to_num(y, nan=ceiling), 1 / ceiling, ceiling)
    axes.loglog(x, y, color=colour, marker=marker, ls=style, label=label)
    axes.xaxis.set_minor_locator(NullLocator())


def _title(figure: Figure, text: str) -> None:
    figure.suptitle(f"{text}\nsimulated frames", x=0.01, ha="left", fontsize=7)


def _rate(value: float) -> str:
    return f"{value:.0e}".replace("e-0", "e-")
