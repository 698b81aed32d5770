"""Unequal classes: accuracy with and without more frames of one class."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from experiments.records.measurement import Measured
from experiments.records.results import Results
from experiments.reporting.columns import (
    Column,
    display_name,
    model_columns,
    scene_name,
)
from experiments.reporting.measured import (
    ENDS,
    by_scene,
    commands_of,
    models_of,
    over_units,
)
from experiments.reporting.plot import LETTERS, head, literal, panel, style_of
from experiments.reporting.study import RUN, Study
from experiments.reporting.text import percent, points

STUDY = Study(
    "unequal",
    "Unequal classes",
    "One class has one frame more than the others: how many of their frames does it take, "
    "by which rule, and does the remedy cost anything?",
    2.7,
)
COLUMNS = {
    "recording": Column("Frames", scene_name),
    "n": Column("n of each class"),
    "extra": Column("More of one class"),
    "equal": Column("HDC, equal classes, %", percent),
    "to_larger": Column(
        "Answers of HDC as published that name the larger class, %", percent
    ),
}


def measurements(results: Results) -> dict[str, Measured]:
    """Finished measurements by the name of their scene."""
    return by_scene(results, "unequal")


def summary(rows: pd.DataFrame) -> pd.DataFrame:
    """A row for each n, extra and model, with intervals: ``accuracy``, its ``change`` from equal
    classes in the same draws, and ``to_larger``, the share that is put into the larger class."""
    every = rows.explode(["n", "right", "to_larger"])
    every = every.astype({"n": int})
    seeds = every.seed.nunique() > 1
    every["unit"] = every.seed if seeds else every.draw
    every["accuracy"] = every.right.astype(float) / every.n_test
    every["to_larger"] = every.to_larger.astype(float) / every.n_test
    keys = ["model", "n", "unit"]
    shares = every.groupby([*keys, "extra"])[["accuracy", "to_larger"]]
    every = shares.mean().reset_index()
    equal = every[every.extra == 0].set_index(keys).accuracy
    before = equal.reindex(every.set_index(keys).index).to_numpy()
    every["change"] = every.accuracy - before
    table = []
    for (n, extra, model), part in every.groupby(["n", "extra", "model"]):
        line = {"n": n, "extra": extra, "model": model}
        for name, least in (("accuracy", 0), ("change", -1), ("to_larger", 0)):
            estimate = over_units(part[name].tolist(), seeds)
            line |= estimate.within(least, 1).columns(name)
        table.append(line)
    return pd.DataFrame(table)


@STUDY.table(
    "unequal",
    title="More training frames in one class",
    key=("recording", "n", "extra"),
    note="Changes of the test accuracy, on the same test frames, when one class has more training "
    "frames than the others. The majority of n frames whose hypervectors correlate by c multiplies "
    "every correlation, the floor of all frames too, by about √(2/π)·√(m/(1 + (m − 1)·c)), m = n "
    "for odd n and n − 1 for even n. For equal classes the factor cancels; a class with more "
    "frames has a larger one, and takes frames of the others. Balanced, the library's default: a "
    "class counts as if it had as many frames as the smallest. Brackets: Student over sensors or "
    "input fields; of one camera or sensor, the central 95 % of draws, none of fewer than ten.",
)
def table(results: Results) -> pd.DataFrame | None:
    """A row for each scene, n and number of further frames: what they change."""
    found = measurements(results)
    lines: list[dict[str, Any]] = []
    for scene, measured in found.items():
        lines += [{"recording": scene, **line} for line in _changes(measured.frame)]
    if not lines:
        return None
    models = list(
        dict.fromkeys(m for one in found.values() for m in models_of(one.frame))
    )
    columns = {**COLUMNS, **model_columns(models, ", points", points)}
    data = pd.DataFrame(lines)
    data = data[[name + end for name in columns for end in ENDS if name + end in data]]
    data.attrs["columns"] = columns
    data.attrs["shown"] = [name for name in columns if name in data]
    data.attrs["commands"] = [f"{RUN}unequal scene={scene}" for scene in found]
    return data


def _changes(rows: pd.DataFrame) -> Iterator[dict[str, Any]]:
    """The rows of one scene: every model's change, and where the answers of HDC go."""
    every = summary(rows).set_index("model")
    for (n, extra), at in every[every.extra > 0].groupby(["n", "extra"]):
        equal = every[(every.n == n) & (every.extra == 0)]
        line = {"n": n, "extra": extra}
        for end in ENDS:
            if "hdc" in at.index:
                line[f"equal{end}"] = equal.loc["hdc", f"accuracy{end}"]
                line[f"to_larger{end}"] = at.loc["hdc", f"to_larger{end}"]
            for model in at.index:
                line[f"{model}{end}"] = at.loc[model, f"change{end}"]
        yield line


@STUDY.figure(
    "unequal",
    caption="Test accuracy against the number of training frames of each class: HDC with as many "
    "of every class, dashed, and each model with one more in one class.",
    size=(7.0, 3.0),
    needs=lambda results: bool(measurements(results)),
    commands=lambda results: commands_of(measurements(results).values()),
)
def figure(figure: Figure, results: Results) -> None:
    """A panel a scene, a line a model."""
    shown = measurements(results)
    panels = figure.subplots(
        1,
        len(shown),
        sharey=True,
        squeeze=False,
    )[0]
    models: dict[str, None] = {}
    of_panels = zip(LETTERS, panels, shown.items(), strict=False)
    for letter, axes, (scene, measured) in of_panels:
        every = summary(measured.frame)
        models |= dict.fromkeys(models_of(every))
        _draw(axes, every)
        panel(axes, letter, literal(scene_name(scene)))
    panels[0].set_ylabel("test accuracy (%)")
    handles = [Line2D([], [], label="HDC, equal classes", **_look("hdc", 0))]
    for model in models:
        name = literal(f"{display_name(model)}, one more")
        handles.append(Line2D([], [], label=name, **_look(model, 1)))
    figure.legend(handles=handles, loc="outside lower center", ncols=3)
    head(figure, "One more frame in one class", [])


def _draw(axes: Axes, every: pd.DataFrame) -> None:
    """HDC with equal classes and each model with one more frame in one, with their intervals."""
    for model, extra in [("hdc", 0), *((model, 1) for model in models_of(every))]:
        part = every[(every.model == model) & (every.extra == extra)]
        look = _look(model, extra)
        axes.plot(part.n, 100 * part.accuracy, ms=2, lw=1, **look)
        low, high = 100 * part.accuracy_low, 100 * part.accuracy_high
        axes.fill_between(part.n, low, high, color=look["color"], alpha=0.1, lw=0)
    ticks = [n for n in (2, 5, 10, 20) if n in set(every.n)]
    axes.set(xscale="log", xlabel="frames of each class", ylim=(0, 103))
    axes.set_xticks(ticks, map(str, ticks))
    axes.minorticks_off()


def _look(model: str, extra: int) -> dict[str, Any]:
    """Colour, marker and line of a model; of equal classes a dashed line in black."""
    if extra == 0:
        return {"color": "black", "marker": "o", "ls": "--"}
    colour, marker, line = style_of(model)
    return {"color": colour, "marker": marker, "ls": line}
