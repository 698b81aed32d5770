"""Models by scene: test errors, and what HDC is ahead or behind by, seed by seed.

Scenes made with measured optics come first and apart from simulated ones.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from matplotlib import pyplot as plt
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullFormatter

from experiments.records import configs
from experiments.records.results import Results
from experiments.reporting import rows as rows_of
from experiments.reporting.plot import (
    STYLE,
    WIDTH,
    fill_of,
    handle,
    measured_models,
    panel,
    plain_decades,
    style_of,
    title,
)
from experiments.reporting.rows import VALUES, Row, columns, row
from experiments.reporting.study import RUN, Plot, Study
from experiments.reporting.table import Table, frame, interval, percent

EXPERIMENT = "all_scenes"
# Of measured optics, with a random split and with one that keeps actuator positions apart.
MEASURED = {"fibre": "fibre", "fibre_grouped": "fibre, other positions"}
# What learns by steps is run where an epoch is short.
BY_STEPS = ("softmax", "cnn1_fast")
COMMANDS = (
    f"{RUN}{EXPERIMENT} scene=fibre,fibre_grouped",
    f"{RUN}{EXPERIMENT}",
    f"{RUN}{EXPERIMENT} scene=fibre,fibre_grouped,touch,finger,tactile model={','.join(BY_STEPS)}",
)


def scenes() -> list[str]:
    """Scenes of the experiment, measured ones first."""
    return [*MEASURED, *configs.sweep(EXPERIMENT)["scene"]]


def models() -> list[str]:
    """Models of the experiment, HDC first."""
    return [*configs.sweep(EXPERIMENT)["model"], *BY_STEPS]


def rows(results: Results) -> list[Row]:
    """A row a scene and model that was run on it."""
    found = []
    for scene in scenes():
        hdc = results.group(scene, "hdc")
        groups = (results.group(scene, model) for model in models())
        found += [row(group, hdc) for group in groups if group.runs]
    return found


def tables(results: Results) -> Iterator[Table]:
    """One table, measured optics first."""
    lines = rows(results)
    if lines:
        missing = [scene for scene in scenes() if scene not in {line["scene"] for line in lines}]
        shown = {
            "Scene": lambda line: f"{name(line['scene'])} ({line['origin']})",
            **columns("Model", "Seeds"),
            "Test error, % [95 %]": _error,
            **columns(
                "− HDC, points [95 %]",
                "Seeds above, below HDC",
                "Training time, s",
                "Size",
                "Status",
            ),
        }
        absent = f" Not run: {', '.join(missing)}." if missing else ""
        yield Table(
            EXPERIMENT,
            "Models by scene: test error of the last model. Fibre: frames computed from measured "
            "transmission matrices; all other scenes are simulated",
            frame(lines, VALUES),
            shown,
            f"{rows_of.notes(lines, shown)} “Other positions”: no actuator position of a test "
            "sample was trained on. What learns by steps is left out on spatial, where an epoch is "
            f"204 steps.{absent}",
            COMMANDS,
        )


def plots(results: Results) -> Iterator[Plot]:
    """The same as a figure."""
    lines = rows(results)
    if lines:
        yield Plot(
            EXPERIMENT,
            "Test error against training time, by scene. Fibre: frames "
            "computed from measured transmission matrices; all other scenes are simulated.",
            lambda: errors_by_scene(lines),
            COMMANDS,
        )


def name(scene: str) -> str:
    """What a scene is called."""
    return MEASURED.get(scene, scene)


def errors_by_scene(lines: list[Row]) -> Figure:
    """Test error against training time, a panel a scene."""
    seen = list(dict.fromkeys(line["scene"] for line in lines))
    with plt.rc_context(STYLE):
        height = -(-len(seen) // 2)
        figure, panels = plt.subplots(height, 2, figsize=(WIDTH, 1.4 + 1.6 * height), squeeze=False)
        for axes, scene in zip(panels.flat, seen, strict=False):
            _panel(axes, [line for line in lines if line["scene"] == scene])
        for axes in panels.flat[len(seen) :]:
            axes.set_axis_off()
        for k, scene in enumerate(seen):
            origin = next(line["origin"] for line in lines if line["scene"] == scene)
            panels.flat[k].set(xlabel="training time (s)", ylabel="test error (%)")
            panel(panels.flat[k], "abcdefgh"[k], f"{name(scene)}\n{origin}")
        shown = measured_models(lines, models())
        title(
            figure,
            panels[0, 0],
            "Test error by scene and model",
            lines,
            shown,
            models(),
            [handle(model) for model in shown],
        )
    return figure


def _panel(axes: Axes, lines: list[Row]) -> None:
    """One scene; measured ones have a background of their own."""
    axes.set_xscale("log")
    if lines[0]["origin"] == "measured":
        axes.set_facecolor("#FFF6E5")
    largest = 0.0
    for line in lines:
        colour, marker, _ = style_of(line["model"])
        error, low, high = _errors(line)
        time = line["training_time_s"]
        reached = not isinstance(time, str)
        axes.errorbar(
            time if reached else line["total_time_s"],
            error,
            yerr=[[max(0.0, error - low)], [max(0.0, high - error)]],
            color=colour,
            marker=marker,
            mfc=fill_of(line["model"]),
            ms=4,
            lw=0.7,
            capsize=1.2,
            alpha=1.0 if reached else 0.4,
        )
        largest = max(largest, error)
    axes.set_ylim(-0.03 * max(5.0, 1.5 * largest), max(5.0, 1.5 * largest))
    plain_decades(axes)
    # A panel may span less than a decade, which would have one label, or all of them.
    axes.xaxis.set_major_locator(LogLocator(subs=(1, 3)))
    axes.xaxis.set_minor_formatter(NullFormatter())


def _errors(line: Mapping[str, Any]) -> tuple[float, float, float]:
    """Test error and its bounds in percent."""
    keys = ("test_accuracy_final", "test_ci_high", "test_ci_low")
    error, low, high = (100 * (1 - line[key]) for key in keys)
    return error, low, high


def _error(line: Mapping[str, Any]) -> str:
    return interval(*(percent(value / 100) for value in _errors(line)))


STUDY = Study(
    "models",
    "Models by scene",
    "Where not all are right, is HDC the best, and of what can be made of its own bits?",
    2.2,
    tables,
    plots,
)
