"""Figures from records, one column wide (3.4 in), as SVG and PDF that come out the same every time.

An accuracy on n test samples cannot tell an error below 1/n from none: errors of zero are drawn in
a grey strip of their own below 1/n, labelled 0. Intervals are those of the tables.
"""

from __future__ import annotations

import io
import textwrap
from collections.abc import Iterable, Sequence
from typing import Any

import matplotlib

matplotlib.use("Agg")
import numpy as np
from matplotlib import pyplot as plt
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import FixedLocator, FuncFormatter, NullLocator

from experiments.selection import Records, Run, sweep
from experiments.table_text import display_name, origin
from experiments.tables import Row, published, published_row, row, training_time

WIDTH = 3.4  # in, one column
STYLE: dict[Any, Any] = {
    "font.family": "DejaVu Sans",
    "font.size": 7,
    "axes.titlesize": 7,
    "axes.linewidth": 0.6,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "lines.linewidth": 1.1,
    "lines.markersize": 3.5,
    "legend.fontsize": 6,
    "legend.frameon": False,
    "legend.handlelength": 3.0,
    "svg.hashsalt": "optical-hdc",
    "pdf.fonttype": 42,
}
# Okabe and Ito's palette, distinguishable with any colour vision; marker and line style repeat
# the distinction. A family of models shares a colour.
_STYLES: dict[str, tuple[str, str, str]] = {
    "hdc": ("#D55E00", "o", "-"),
    "hdc_compiled": ("#D55E00", "P", "--"),
    "hdc_integer": ("#D55E00", "s", "--"),
    "hdc_online": ("#D55E00", "D", "-."),
    "record_hdc": ("#D55E00", "v", ":"),
    "softmax": ("#0072B2", "s", "-"),
    "softmax_dual": ("#0072B2", "D", "--"),
    "cnn1": ("#009E73", "^", "-"),
    "cnn1_fast": ("#009E73", "^", "--"),
    "cnn3": ("#CC79A7", "v", "-"),
    "cnn3_fast": ("#CC79A7", "v", "--"),
    "ridge": ("#56B4E9", "P", "-"),
    "correlation": ("#E69F00", "X", "-"),
    "nearest_neighbour": ("#000000", "d", "-"),
}
_OTHER = ("#666666", ".", ":")
# Where the published accuracies are drawn: all at N = 400, the two equal ones side by side.
PUBLISHED_N = {"hdc": 400, "softmax": 400, "cnn1": 380, "cnn3": 421}
_STAR = Line2D([], [], ls="", marker="*", mfc="white", mec="black", ms=8, label="paper, Table I")


def error_vs_time(records: Records) -> Figure:
    """Test error against training time, a curve for each model and seed; the paper's points."""
    models = ["hdc", "softmax", "softmax_dual", "cnn1", "cnn1_fast", "cnn3", "cnn3_fast"]
    scene = sweep("table1")["scene"][0]
    groups = [records.group(scene, model) for model in models]
    rows = [row(group, groups[0]) for group in groups]
    with plt.rc_context(STYLE):
        figure, axes = plt.subplots(figsize=(WIDTH, 3.7))
        floor = _error_axis(axes, rows)
        axes.set_xscale("log")
        for group, line in zip(groups, rows, strict=True):
            for run in group.runs:
                _curve(axes, run, floor)
            if group.runs and not isinstance(line["training_time_s"], str):
                _final_interval(axes, group.runs, line, floor)
        for model in ("hdc", "softmax", "cnn1", "cnn3"):
            known = published_row(model)
            error = 1 - known["published_test_accuracy"]
            axes.plot(
                known["published_training_time_s"], max(error, floor), "*", markersize=9,
                color=style_of(model)[0], markeredgecolor="black", markeredgewidth=0.6, zorder=5,
                clip_on=False,
            )  # fmt: skip
        axes.set_xlabel("training time (s)")
        axes.set_ylabel("test error")
        _plain_decades(axes)
        shown = [group.model for group in groups if group.runs]
        handles = [_handle(model) for model in shown]
        handles += [
            _STAR,
            Line2D([], [], ls="", marker="o", mfc="white", mec="black", ms=6,
                   label="training accuracy > 90 %"),
        ]  # fmt: skip
        _title(figure, axes, "Test error against training time", rows, shown, models, handles)
    return figure


def accuracy_vs_n(rows: Sequence[Row]) -> Figure:
    """Test accuracy against the number of training samples (Fig. 5(b) of the paper)."""
    paper = ["hdc", "softmax", "softmax_dual", "cnn1_fast", "cnn3_fast"]
    others = ["hdc", "hdc_integer", "hdc_online", "record_hdc", "ridge", "correlation",
              "nearest_neighbour"]  # fmt: skip
    with plt.rc_context(STYLE):
        figure, panels = plt.subplots(2, 1, figsize=(WIDTH, 5.6), sharex=True)
        for axes, models in zip(panels, (paper, others), strict=True):
            _accuracy_curves(axes, rows, models, "n_train", PUBLISHED_N.values())
            handles = [_handle(m) for m in _shown(rows, models)]
            axes.legend(
                handles=[*handles, *([_STAR] if axes is panels[0] else [])], loc="lower right"
            )
        for model, n in PUBLISHED_N.items():
            panels[0].plot(
                n, 100 * published_row(model)["published_test_accuracy"], "*", markersize=8,
                color=style_of(model)[0], markeredgecolor="black", markeredgewidth=0.6, zorder=5,
                clip_on=False,
            )  # fmt: skip
        limit = published()["accuracy_vs_n/n_for_90_percent"]
        for axes in panels:
            axes.plot([limit, limit], [0, 90], color="0.5", lw=0.7, ls=(0, (4, 3)), zorder=0)
            axes.axhline(90, color="0.5", lw=0.7, ls=(0, (4, 3)), zorder=0)
        panels[0].text(limit * 0.95, 24, f"paper: > 90 %\nonly for N > {limit:g}", ha="right",
                       color="0.3", fontsize=6)  # fmt: skip
        ticks = [5, 10, 20, 50, 100, 200, 400]
        panels[1].xaxis.set_major_locator(FixedLocator(ticks))
        panels[1].xaxis.set_minor_locator(NullLocator())
        panels[1].xaxis.set_major_formatter(FuncFormatter(lambda n, _: f"{n:g}"))
        panels[1].set_xlabel("training samples N")
        _title(figure, panels[0], "Test accuracy against training samples", rows,
               _shown(rows, paper + others), paper + others)  # fmt: skip
    return figure


def accuracy_vs_d(rows: Sequence[Row]) -> Figure:
    """Test accuracy against the number of pixels seen, which is HDC's dimension."""
    models = ["hdc", "softmax_dual", "ridge", "correlation", "nearest_neighbour"]
    with plt.rc_context(STYLE):
        figure, axes = plt.subplots(figsize=(WIDTH, 2.9))
        _accuracy_curves(axes, rows, models, "pixels")
        axes.legend(handles=[_handle(m) for m in _shown(rows, models)], loc="lower right")
        whole = max((line["pixels"] or 0 for line in rows if line["seeds"]), default=0)
        axes.set_xlabel(f"pixels seen, D (whole frame: {whole:,})" if whole else "pixels seen, D")
        _title(figure, axes, "Test accuracy against dimension", rows, _shown(rows, models), models)
    return figure


def work_precision(rows: Sequence[Row], table: Sequence[Row]) -> Figure:
    """Test error against the time to predict a single frame; from left to right D grows.

    Args:
        rows: by model and number of pixels.
        table: rows of models that were run on whole frames only.
    """
    models = list(dict.fromkeys(line["model"] for line in rows))
    whole = [line for line in table if line["model"] not in models]
    everything = [*rows, *whole]
    names = [*models, *(line["model"] for line in whole if line["model"] in _STYLES)]
    with plt.rc_context(STYLE):
        figure, axes = plt.subplots(figsize=(WIDTH, 3.7))
        floor = _error_axis(axes, everything)
        axes.set_xscale("log")
        for model in names:
            lines = [r for r in everything if r["model"] == model and r["seeds"]]
            times = [1e3 * line["predict_single_s"] for line in lines]
            _error_bars(axes, model, times, lines, floor)
        seen = [line["pixels"] for line in rows if line["pixels"]]
        axes.set_xlabel(
            "time to predict a single frame (ms)"
            + (f"\nalong a curve: D = {min(seen):,} … {max(seen):,} pixels" if seen else "")
        )
        axes.set_ylabel("test error")
        _plain_decades(axes)
        shown = _shown(everything, names)
        handles = [_handle(model) for model in shown]
        _title(
            figure, axes, "Test error against prediction time", everything, shown, names, handles
        )
    return figure


def save(figure: Figure, kind: str) -> bytes:
    """The figure as ``svg``, ``pdf`` or ``png``, free of dates and random names."""
    # PDF has no hash salt, but takes its dates from here.
    metadata: dict[str, dict[str, Any]] = {
        "svg": {"Date": None},
        "pdf": {"CreationDate": None, "ModDate": None},
    }
    with plt.rc_context(STYLE):
        stream = io.BytesIO()
        figure.savefig(stream, format=kind, metadata=metadata.get(kind), dpi=300)
    return stream.getvalue()


# Parts --------------------------------------------------------------------------------------------


def _curve(axes: Axes, run: Run, floor: float) -> None:
    """Error over the reports of one run; the point where it had learnt is ringed."""
    model = run.record["choices"]["model"]
    colour, marker, line = style_of(model)
    points = [(row["training_s"], 1 - row["test_accuracy"]) for row in run.curve
              if "test_accuracy" in row]  # fmt: skip
    if not points:
        return
    times, errors = np.array(points).T
    axes.plot(times, np.maximum(errors, floor), color=colour, ls=line, lw=0.8, alpha=0.75,
              marker=marker if len(times) < 3 else None)  # fmt: skip
    reached = training_time(run)
    if np.isfinite(reached):
        at = int(np.argmin(np.abs(times - reached)))
        axes.plot(times[at], max(errors[at], floor), "o", mfc="white", mec=colour, ms=5, zorder=4)


def _final_interval(axes: Axes, runs: Sequence[Run], line: Row, floor: float) -> None:
    """The interval of the final error, at the median time of the end."""
    _error_bars(
        axes,
        runs[0].record["choices"]["model"],
        [line["total_time_s"]],
        [line],
        floor,
        marker=False,
    )


def _error_bars(
    axes: Axes,
    model: str,
    x: Iterable[float],
    lines: Sequence[Row],
    floor: float,
    marker: bool = True,
) -> None:
    if not lines:
        return
    colour, symbol, style = style_of(model)
    errors = np.array([1 - line["test_accuracy_final"] for line in lines])
    high = np.array([1 - line["test_ci_low"] for line in lines])
    low = np.array([1 - line["test_ci_high"] for line in lines])
    y = np.maximum(errors, floor)
    axes.errorbar(
        list(x), y, yerr=[y - np.maximum(low, floor), high - y], color=colour, ls=style,
        marker=symbol if marker else None, mfc=fill_of(model), elinewidth=0.7, capsize=1.5, lw=0.9,
        zorder=3,
    )  # fmt: skip


def _accuracy_curves(
    axes: Axes, rows: Sequence[Row], models: Sequence[str], key: str, also: Iterable[float] = ()
) -> None:
    """Accuracy in percent over a logarithmic axis; models are set apart by a few percent of x.

    The axis spans what the rows ask for, measured or not, and the places in `also`.
    """
    axes.set_xscale("log")
    places = [*also, *(r[key] for r in rows if r[key])]
    if places:
        axes.set_xlim(min(places) / 1.35, max(places) * 1.35)
    lowest = 100 * min((r["test_ci_low"] for r in rows if r["seeds"]), default=1.0)
    for k, model in enumerate(models):
        lines = [r for r in rows if r["model"] == model and r["seeds"]]
        lines.sort(key=lambda r: r[key])
        if not lines:
            continue
        colour, marker, style = style_of(model)
        x = np.array([r[key] for r in lines]) * 1.02 ** (k - len(models) // 2)
        y, low, high = (
            100 * np.array([r[name] for r in lines])
            for name in ("test_accuracy_final", "test_ci_low", "test_ci_high")
        )
        axes.errorbar(
            x, y, yerr=[y - low, high - y], color=colour, marker=marker, mfc=fill_of(model),
            ls=style, elinewidth=0.6, capsize=1.2, lw=0.9,
        )  # fmt: skip
    axes.set_ylim(min(15, lowest - 2), 102)
    axes.set_ylabel("test accuracy (%)")


def _error_axis(axes: Axes, rows: Sequence[Row]) -> float:
    """A logarithmic axis of errors in percent, with a strip for no error at all; where that is."""
    # Half an error among all the test samples that a row pools.
    n_test = max((line["n_test"] for line in rows if line["seeds"]), default=100)
    floor = 0.5 / n_test
    axes.set_yscale("log")
    axes.set_ylim(floor * 0.8, 1.1)
    decades = (0.001, 0.01, 0.1)
    ticks = [t * k for t in decades for k in (1, 2, 5) if t * k >= 0.99 / n_test]
    axes.yaxis.set_major_locator(FixedLocator([floor, *ticks, 1.0]))
    axes.yaxis.set_minor_locator(NullLocator())
    axes.yaxis.set_major_formatter(
        FuncFormatter(lambda y, _: "0" if y < 0.9 / n_test else f"{100 * y:g} %")
    )
    axes.axhspan(floor * 0.8, 0.72 / n_test, color="0.92", lw=0, zorder=0)
    return floor


def _plain_decades(axes: Axes) -> None:
    """Decades of the x axis written out where they are short."""
    axes.xaxis.set_major_formatter(
        FuncFormatter(lambda x, _: f"{x:,g}" if 1e-3 <= x <= 1e5 else f"{x:.0e}")
    )


def _title(
    figure: Figure,
    axes: Axes,
    text: str,
    rows: Sequence[Row],
    shown: Sequence[str],
    wanted: Sequence[str],
    handles: Sequence[Line2D] = (),
) -> None:
    """Title with the origin of the frames and what has no record; a legend below the axes."""
    seeds = sorted({line["seeds"] for line in rows if line["seeds"]})
    count = f", {seeds[0]}–{seeds[-1]} seeds" if len(seeds) > 1 else ""
    count = f", {seeds[0]} seed{'s' * (seeds[0] > 1)}" if len(seeds) == 1 else count
    strip = ", grey: no error" if axes.get_yscale() == "log" else ""
    lines = [text]
    if seeds:
        lines += [f"{origin(rows)} frames{count}, 95 % intervals{strip}"]
    # Lines break between names, not within one.
    missing = [display_name(m) for m in dict.fromkeys(wanted) if m not in shown]
    if missing:
        names = "; ".join(name.replace(" ", "\xa0") for name in missing)
        lines += textwrap.wrap(f"no records: {names}", 64)
    figure.suptitle("\n".join(lines), x=0.01, ha="left", fontsize=7)
    if handles:
        figure.legend(handles=handles, loc="outside lower center", ncols=2)
    figure.set_layout_engine("constrained")


def _shown(rows: Sequence[Row], models: Sequence[str]) -> list[str]:
    found = {line["model"] for line in rows if line["seeds"]}
    return [model for model in dict.fromkeys(models) if model in found]


def _handle(model: str) -> Line2D:
    colour, marker, line = style_of(model)
    return Line2D([], [], color=colour, marker=marker, ls=line, mfc=fill_of(model),
                  label=display_name(model))  # fmt: skip


def fill_of(model: str) -> str:
    """Of markers: none for a dashed line, so that lone markers of a family differ too."""
    colour, _, line = style_of(model)
    return "white" if line == "--" else colour


def style_of(model: str) -> tuple[str, str, str]:
    """Colour, marker and line of a model, the same in every figure."""
    return _STYLES.get(model, _OTHER)
