"""Runs that were started by hand, on any scene: accuracy against N, and error against time."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence

import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import NullFormatter

from experiments.records.groups import Group, Groups
from experiments.reporting.columns import scene_name
from experiments.reporting.curves import (
    accuracy_curves,
    error_axis,
    error_bars,
    plain_decades,
)
from experiments.reporting.plot import LETTERS, handle, head, look_of, panel, wrapped
from experiments.reporting.rows import Row, row
from experiments.reporting.text import counted

PANELS = 6  # scenes of a figure at most


def started(lines: pd.DataFrame) -> dict[str, list[Group]]:
    """The groups of each scene whose runs no experiment started, on all pixels."""
    runs = [run for run in Groups.of(lines).runs if run.experiment is None]
    scenes: dict[str, list[Group]] = {}
    for group in Groups(runs):
        if group.pixels is None:
            scenes.setdefault(group.scene, []).append(group)
    return scenes


def curves(lines: pd.DataFrame) -> dict[str, list[Group]]:
    """The scenes on which a model was trained on several numbers of samples."""
    every = started(lines)
    return {scene: found for scene, found in every.items() if _are_several(found)}


def accuracy_vs_n(figure: Figure, lines: pd.DataFrame) -> None:
    """A panel per scene, a line per model."""
    shown, left_out = _first(curves(lines))
    sizes = set()
    for axes, groups in zip(_panels(figure, list(shown)), shown.values(), strict=True):
        rows = _rows(groups)
        accuracy_curves(axes, rows, _models(groups), "n_train")
        axes.set_xlabel("training samples N")
        sizes |= {line["n_train"] for line in rows}
    details = ["95 % intervals", *left_out]
    head(figure, "Test accuracy against training samples", details)
    _finish(figure, shown)
    figure.axes[0].set_xticks(sorted(sizes), map(str, sorted(sizes)))


def error_vs_time(figure: Figure, lines: pd.DataFrame) -> None:
    """A panel per scene: the error wherever a run was tested, and after training."""
    shown, left_out = _first(started(lines))
    for axes, groups in zip(_panels(figure, list(shown)), shown.values(), strict=True):
        largest = max(map(_size, groups))
        most = [group for group in groups if _size(group) == largest]
        rows = _rows(most)
        floor = error_axis(axes, rows)
        axes.set_xscale("log")
        for group, line in zip(most, rows, strict=True):
            for run in group.runs:
                tested = [one for one in run.curve if "test_accuracy" in one]
                seconds = [one["training_s"] for one in tested]
                errors = [max(1 - one["test_accuracy"], floor) for one in tested]
                axes.plot(
                    seconds,
                    errors,
                    **look_of(run.model_label) | {"marker": "", "lw": 0.8},
                )
            error_bars(axes, group.model, [line["total_time_s"]], [line], floor)
        axes.set(xlabel="training time (s)", ylabel="test error")
    details = "the most training samples, 95 % intervals after training, grey: no error"
    head(figure, "Test error against training time", [details, *left_out])
    _finish(figure, shown)


def _first(
    scenes: Mapping[str, list[Group]],
) -> tuple[dict[str, list[Group]], list[str]]:
    """As many scenes as a figure has room for, and a line on those that it leaves out."""
    shown = dict(itertools.islice(scenes.items(), PANELS))
    left_out = len(scenes) - len(shown)
    return shown, [f"{counted(left_out, 'more scene')}: see the table"] * bool(left_out)


def _are_several(groups: Sequence[Group]) -> bool:
    """Whether a model has several numbers of training samples."""
    models = [group.model for group in groups]
    return len(models) > len(set(models))


def _size(group: Group) -> float:
    """Training samples; infinity for all of the scene."""
    return group.n_train or math.inf


def _rows(groups: Sequence[Group]) -> list[Row]:
    return [row(group, group) for group in groups]


def _models(groups: Sequence[Group]) -> list[str]:
    return list(dict.fromkeys(group.model for group in groups))


def _panels(figure: Figure, scenes: Sequence[str]) -> list[Axes]:
    """A panel below another, each with the name of its scene."""
    grid = figure.subplots(len(scenes), 1, squeeze=False, sharex=True)
    panels = list(grid[:, 0])
    for axes, letter, scene in zip(panels, LETTERS, scenes, strict=False):
        panel(axes, letter, wrapped(scene_name(scene), 40))
    return panels


def _finish(figure: Figure, shown: Mapping[str, Sequence[Group]]) -> None:
    """Numbers of the shared axis, at least a decade of them, and a legend below."""
    axes = figure.axes[0]
    low, high = axes.get_xlim()
    axes.set_xlim(min(low, high / 10), high)
    axes.xaxis.set_minor_formatter(NullFormatter())
    plain_decades(axes)
    models = _models([*itertools.chain(*shown.values())])
    width, _ = figure.get_size_inches()
    figure.set_size_inches(width, 0.6 + 2 * len(shown) + 0.08 * len(models))
    handles = list(map(handle, models))
    figure.legend(handles=handles, loc="outside lower center", ncols=2)
