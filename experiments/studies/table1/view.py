"""Table I, and error against run time."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from experiments.records import configs
from experiments.records.results import Group, Results, Run
from experiments.reporting import estimates, published
from experiments.reporting import rows as rows_of
from experiments.reporting.columns import Column
from experiments.reporting.estimates import ONE_SENSOR
from experiments.reporting.measured import RIVAL
from experiments.reporting.plot import (
    error_axis,
    error_bars,
    handle,
    plain_decades,
    published_point,
    style_of,
    title,
)
from experiments.reporting.routes import ORDINARY, ordinary_training_s
from experiments.reporting.rows import row
from experiments.reporting.study import RUN, Quantity, Study
from experiments.reporting.table import frame
from experiments.reporting.text import number, percent

PAPER = published.models_of_table1()
LINES = (*PAPER, RIVAL)
AS_WRITTEN = "HDC as written here"
WAYS = (AS_WRITTEN, ORDINARY)  # of computing HDC

STUDY = Study(
    "table1",
    "Table I",
    "Does HDC recognise touches better than softmax regression and convolutional networks, and "
    "train in a hundredth of their time? Five labels, N = 400.",
    1,
    front=True,
)


def scene() -> str:
    """Name of the scene of Table I."""
    return configs.sweep("table1")["scene"][0]


def _ratio(cells: Mapping[str, Any]) -> str:
    here = number(cells["training_time_over_hdc"])
    if (ordinary := cells["training_time_over_ordinary_hdc"]) is not None:
        here += f" ({number(ordinary)})"
    return f"{number(cells['published_training_time_over_hdc'])} → {here}"


def _trained(cells: Mapping[str, Any]) -> str:
    if not cells["seeds"]:
        return str(cells["status"])
    if cells["stop"] == "reached":
        return "not continued"
    accuracy = percent(cells["test_accuracy_final"])
    low = percent(cells["test_accuracy_final_low"])
    high = percent(cells["test_accuracy_final_high"])
    text = f"{accuracy} [{low}, {high}]"
    time, seconds = cells["training_time_s"], cells["total_time_s"]
    if isinstance(time, str) or seconds > 1.01 * time:
        text += f" in {number(seconds)} s"
    return text


COLUMNS = {
    "time": Column(
        "Time, s: paper → here",
        cell=lambda cells: (
            f"{number(cells['published_training_time_s'])} → {number(cells['training_time_s'])}"
        ),
        note="Time: iterative models, until training accuracy exceeds 90 %, as in the paper; "
        "one-pass models, until fitted. Medians over seeds, of ratios too.",
    ),
    "ratio": Column(
        "× HDC: paper → here (by ordinary routes)",
        cell=_ratio,
        note="× HDC: training time over that of this library's HDC; in parentheses over that "
        "of HDC by ordinary routes, the faster of NumPy and PyTorch medians followed by torchhd.",
    ),
    "published_test_accuracy": Column("Test, %: paper", percent),
    "test_accuracy_at_target": Column(
        "Test, %: here, at 90 % training accuracy", percent
    ),
    "trained": Column(
        "Test, %: here, after full training [95 % interval]",
        cell=_trained,
        note="Intervals: Student over seeds, never narrower than the test set allows; Wilson for "
        "one seed.",
    ),
}


@STUDY.table(
    "table1",
    title="Table I, published and measured",
    key=("scene", "model", "n_train", "pixels"),
    shown=("model", *COLUMNS, "seeds"),
    columns=COLUMNS,
)
def table1(results: Results) -> pd.DataFrame | None:
    """Table I, and below it the same softmax regression solved directly and one's own models."""
    models = (*LINES, *results.extra_models(scene()))
    groups = [results.group(scene(), model) for model in models]
    rows = []
    for group in groups:
        line = row(group, groups[0], paper=True)
        line["training_time_over_ordinary_hdc"] = None
        seconds = ordinary_training_s(results, group)
        time = line.get("training_time_s")
        if seconds and isinstance(time, float):
            line["training_time_over_ordinary_hdc"] = time / seconds
        rows.append(line)
    if not any(line["seeds"] for line in rows):
        return None
    shown = [line for line in rows if line["seeds"] or line["model"] in PAPER]
    data = frame(shown)
    data.attrs["title"] = rows_of.caption(shown, "Table I, published and measured")
    data.attrs["commands"] = rows_of.commands(groups) or [f"{RUN}table1"]
    return data


def seconds_to(run: Run, accuracy: float) -> float:
    """Training time at the first report of at least this test accuracy; infinite without one.
    A one-pass model is asked once, when it is fitted."""
    if not run.iterative:
        if run.record.test_accuracy_final < accuracy:
            return math.inf
        return run.record.training_s
    for report in run.curve:
        if report.get("test_accuracy", -1) >= accuracy:
            return report["training_s"]
    return math.inf


def _over_seeds(name: str, values: Sequence[float]) -> dict[str, float]:
    """Median, and lowest to highest where they differ; nothing of no values."""
    if not values:
        return {}
    estimate = estimates.Estimate(float(np.median(values)))
    lowest, highest = min(values), max(values)
    if lowest < highest:
        estimate = estimate._replace(low=lowest, high=highest)
    return estimate.columns(name)


def _or_never(value: float) -> str:
    return number(value) if math.isfinite(value) else "never"


@STUDY.table(
    "equal_accuracy",
    key=("model", "pixels"),
    title="Time to reach the test accuracy of HDC",
    columns={
        "time": Column("Time to the test accuracy of HDC, s", _or_never),
        "ratio": Column("× HDC", _or_never),
    },
    note="Rule: a model is as accurate as HDC at its first report of at least the test accuracy "
    "that HDC of the same seed ends with; never, if it stops before. One-pass models report when "
    "they are fitted. × HDC: over the time of HDC of the same seed, on the same machine. Median "
    "[lowest, highest] over seeds. Fewer pixels: the fewest with which every seed gets there.",
    commands=[f"{RUN}table1", f"{RUN}table1_extended", f"{RUN}accuracy_vs_d"],
)
def equal_accuracy(results: Results) -> pd.DataFrame | None:
    """A row for each model of Table I and its extension, and one for the fewest pixels it needs."""
    hdc = results.group(scene(), "hdc")
    models = [
        *configs.sweep("table1")["model"],
        *configs.sweep("table1_extended")["model"],
        *results.extra_models(scene()),
    ]
    rows = []
    for model in dict.fromkeys(models):
        for group in _by_pixels(results, model):
            line = _as_accurate(group, hdc)
            if line is None:
                continue
            rows.append(line)
            if group.pixels:  # fewer than any that follow
                break
    return frame(rows)


def _by_pixels(results: Results, model: str) -> list[Group]:
    """Groups of a model on the scene of Table I: all pixels first, then from the fewest up."""
    place = (scene(), model)
    groups = [g for g in results.groups() if (g.scene, g.model) == place]
    of_all_samples = [group for group in groups if group.n_train is None]
    return sorted(of_all_samples, key=lambda group: group.pixels or 0)


def _as_accurate(group: Group, hdc: Group) -> dict[str, Any] | None:
    """Times to the accuracy of HDC of the same seed; None without such seeds, or where one with
    fewer pixels never gets there."""
    ours = {run.seeds: run.record for run in hdc.runs}
    times, ratios = [], []
    for run in group.runs:
        if run.seeds in ours:
            record = ours[run.seeds]
            time = seconds_to(run, record.test_accuracy_final)
            times.append(time)
            ratios.append(time / record.training_s)
    if not times or (group.pixels and max(times) == math.inf):
        return None
    if group.machines != hdc.machines:
        ratios = []
    return {
        "model": group.model,
        "pixels": group.pixels or "all",
        "seeds": len(times),
        **_over_seeds("time", times),
        **_over_seeds("ratio", ratios),
    }


@STUDY.figure(
    "error_vs_time",
    caption="Test error against training time over that of HDC (Table I): one curve per model and "
    "seed; pale: the reference. Stars: the paper's, over the time of its HDC.",
    size=(3.4, 3.9),
    needs=lambda results: bool(results.group(scene(), "hdc").runs),
    commands=(f"{RUN}table1", f"{RUN}table1_extended"),
    over=True,
)
def error_vs_time(
    figure: Figure, results: Results, behind: Results | None = None
) -> None:
    """Test error against training time over HDC's, a curve for each model and seed; the paper's
    points."""
    groups = _curves_of(results)
    rows = [row(group, groups[0]) for group in groups]
    axes = figure.subplots()
    floor = error_axis(axes, rows)
    axes.set_xscale("log")
    if behind is not None:
        _draw_curves(axes, behind, floor, alpha=0.2)
    _draw_curves(axes, results, floor)
    hdc_s = _hdc_s(results)
    for line in rows:
        if not isinstance(line["training_time_s"], str):
            at = [line["total_time_s"] / hdc_s]
            error_bars(axes, line["model"], at, [line], floor, marker=False)
    for model in PAPER:
        known = row(results.group(scene(), model), groups[0], paper=True)
        error = max(1 - known["published_test_accuracy"], floor)
        ratio = known["published_training_time_over_hdc"]
        published_point(axes, model, ratio, error, 9)
    axes.set(xlabel="training time, × HDC", ylabel="test error")
    plain_decades(axes)
    shown = [group.model for group in groups]
    handles = [handle(model) for model in shown]
    for marker, size, label in (
        ("*", 8, "paper, Table I"),
        ("o", 6, "training accuracy > 90 %"),
    ):
        look: Any = {
            "marker": marker,
            "ms": size,
            "mfc": "white",
            "mec": "black",
        }
        handles.append(
            Line2D(
                [],
                [],
                label=label,
                ls="",
                **look,
            )
        )
    text = "Test error against training time"
    title(figure, axes, text, rows, shown, shown, handles)


def _curves_of(results: Results) -> list[Group]:
    """The groups of Table I that have runs, HDC first: the paper's models, fast ones, one's own."""
    every = [*configs.models("paper", "fast"), *results.extra_models(scene())]
    groups = [results.group(scene(), model) for model in every]
    return [group for group in groups if group.runs]


def _draw_curves(
    axes: Axes,
    results: Results,
    floor: float,
    alpha: float = 0.75,
) -> None:
    hdc_s = _hdc_s(results)
    for group in _curves_of(results):
        for run in group.runs:
            _curve(axes, run, floor, hdc_s, alpha)


def _hdc_s(results: Results) -> float:
    """Training time of HDC in Table I, median over runs."""
    runs = results.group(scene(), "hdc").runs
    times = [estimates.training_time(run) for run in runs]
    return float(np.median(times)) if times else math.nan


def _curve(
    axes: Axes,
    run: Run,
    floor: float,
    hdc_s: float,
    alpha: float = 0.75,
) -> None:
    """Error over the reports of one run, times over HDC's; a ring where training accuracy passed
    90 %."""
    colour, marker, line = style_of(run.model)
    reports = [report for report in run.curve if "test_accuracy" in report]
    if not reports:
        return
    seconds = np.array([report["training_s"] for report in reports])
    accuracies = np.array([report["test_accuracy"] for report in reports])
    times = seconds / hdc_s
    errors = np.maximum(1 - accuracies, floor)
    shape = marker if len(times) < 3 else None
    look: Any = {
        "color": colour,
        "ls": line,
        "lw": 0.8,
        "marker": shape,
    }
    axes.plot(times, errors, alpha=alpha, **look)
    reached = estimates.training_time(run) / hdc_s
    if np.isfinite(reached):
        nearest = np.abs(times - reached).argmin()
        at = int(nearest)
        ring: Any = {
            "mfc": "white",
            "mec": colour,
            "ms": 5,
            "zorder": 4,
        }
        axes.plot(
            times[at],
            errors[at],
            "o",
            alpha=min(1, alpha / 0.75),
            **ring,
        )


@STUDY.quantities()
def quantities(results: Results) -> Iterator[Quantity]:
    """Times and accuracies of Table I, in seconds and percent, and the learning rate."""
    groups = {model: results.group(scene(), model) for model in PAPER}
    for model, group in groups.items():
        if not group.runs:
            continue
        line, name = row(group, group), f"table1/{model}"
        seeds: dict[str, Any] = {
            "seeds": len(group.runs),
            "made_by": " && ".join(rows_of.commands([group])),
        }
        n_runs = len(group.runs)
        note = f"median; {line['cpu']}, {line['threads']} threads; paper: Apple M1"
        time = line["training_time_s"]
        yield Quantity(f"{name}_training_time", time, n=n_runs, note=note, **seeds)
        if model == "hdc":
            yield Quantity.of(
                f"{name}_test_accuracy",
                estimates.share_of_one_sensor(group),
                ONE_SENSOR,
                100,
                n=line["n_test"],
                **seeds,
            )
            yield Quantity("touch/labels", len(group.classes), made_by=f"{RUN}table1")
            continue
        yield from _ratios(results, group)
        for kind, called, n in (
            ("train", "training", line["n_train"] * n_runs),
            ("test", "test", line["n_test"]),
        ):
            best = line[f"{kind}_accuracy_max"]
            final = line[f"{kind}_accuracy_final"]
            if best is not None:
                note = f"maximum of a run, as published; {100 * final:.4g} % at its end"
                yield Quantity(
                    f"{name}_{called}_accuracy",
                    100 * best,
                    n=n,
                    note=note,
                    **seeds,
                )
    yield from _learning_rate(groups)


def _learning_rate(groups: Mapping[str, Group]) -> Iterator[Quantity]:
    """That of the iterative models, where it is one."""
    rates = set()
    for model, group in groups.items():
        if model != "hdc":
            rates |= {run.record.config["model"]["lr"] for run in group.runs}
    if len(rates) == 1:
        yield Quantity(
            "table1/learning_rate",
            rates.pop(),
            note="softmax and CNNs",
            made_by=f"{RUN}table1",
        )


def _ratios(results: Results, group: Group) -> Iterator[Quantity]:
    """Training time over HDC's, in the lowest to the highest run, by this library's HDC and by
    ordinary routes."""
    name = f"table1/{group.model}_time_over_hdc"
    note = "" if group.model == "softmax" else "the network's sizes are ours"
    for condition, ratios in time_ratios(results, group).items():
        by = f"{RUN}{'benchmark' if condition == ORDINARY else 'table1'}"
        if not ratios or not all(map(math.isfinite, ratios)):
            yield Quantity(name, None, condition=condition, made_by=by)
            continue
        yield Quantity(
            name,
            float(np.median(ratios)),
            min(ratios),
            max(ratios),
            "lowest to highest run",
            condition,
            n=len(ratios),
            seeds=len(ratios),
            made_by=by,
            note=note,
        )


def time_ratios(results: Results, group: Group) -> dict[str, list[float]]:
    """Training time over HDC's in each run, by each way of computing HDC; by this library's the
    time of the same seed, by ordinary routes one time for all."""
    hdc = results.group(group.scene, "hdc")
    own = {}
    if group.machines == hdc.machines:
        own = _times(hdc)
    ordinary = ordinary_training_s(results, group)
    times = _times(group)
    as_written = [time / own[seeds] for seeds, time in times.items() if seeds in own]
    by_ordinary = []
    if ordinary:
        by_ordinary = [time / ordinary for time in times.values()]
    return {AS_WRITTEN: as_written, ORDINARY: by_ordinary}


def _times(group: Group) -> dict[str, float]:
    """Training times by the seeds of the run."""
    return {run.seeds: estimates.training_time(run) for run in group.runs}
