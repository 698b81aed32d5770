"""Every model on public recordings: accuracies, what theory expects of them, distances."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from experiments.records import configs
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
    RIVAL,
    by_scene,
    models_of,
    over_units,
    saturated,
    with_right,
)
from experiments.reporting.plot import LETTERS, errors, head, literal, panel, wrapped
from experiments.reporting.study import RUN, Study
from experiments.reporting.text import kind_of, number, percent, points

STUDY = Study(
    "recordings",
    "Public recordings",
    "On frames of optical sensors of several kinds, captured or computed by others: does HDC "
    "recognise better than its rivals?",
    0.5,
    front=True,
)
# Frames per class that the figure shows, with colour and marker.
SIZES = {
    1: ("#56B4E9", "o"),
    5: ("#0072B2", "s"),
    20: ("#E69F00", "D"),
    50: ("black", "^"),
}
COLUMNS = {
    "recording": Column("Recording", scene_name),
    "kind": Column("Kind"),
    "frames": Column("Frames"),
    "n": Column("Frames per class"),
}
NOTE = (
    "Split by time, session, group or position, as each recording states, so that near copies of a "
    "test frame do not train. Brackets: Student over seeds (input fields, fibres) for fibres, the "
    "central 95 % of draws for cameras, each of which is one sensor. Standardised: each frame with "
    "mean 0 and deviation 1. Captured: by a camera; computed: from measured matrices of a fibre, "
    f"with an assumed noise. Primary rival, named beforehand: {display_name(RIVAL)}."
)


def recordings(
    results: Results,
    name: str = "recordings",
) -> dict[str, Measured]:
    """Finished measurements by the name of their scene; a fibre counts once, by one input field."""
    found = by_scene(results, name).items()
    return {scene: measured for scene, measured in found if fields_of(measured) == 1}


def fields_of(measured: Measured) -> int:
    """How many input fields of a fibre a frame shows side by side; 1 of any other scene."""
    scene = measured.record.config.get("scene") or {}
    return int(scene.get("n_fields", 1))


def accuracies(rows: pd.DataFrame) -> pd.DataFrame:
    """A row for each split, model, n and unit: ``accuracy``. The unit is what varies: the seed
    where there are several (another input field or fibre), else the draw of frames."""
    counted = with_right(rows, ("seed", "split", "draw"))
    every = counted.explode(["n", "right"]).astype({"n": int, "right": float})
    several = every.seed.nunique() > 1
    every["unit"] = every.seed if several else every.draw
    every["accuracy"] = every.right / every.n_test
    by_unit = every.groupby(["split", "model", "n", "unit"])
    return by_unit.accuracy.mean().reset_index()


def summary(measured: Measured) -> pd.DataFrame:
    """``model``, ``n`` and accuracy with its interval, by the split that counts."""
    every = accuracies(measured.frame).query("split == 'counts'")
    seeds = measured.frame.seed.nunique() > 1
    table = []
    for (model, n), part in every.groupby(["model", "n"]):
        estimate = over_units(part.accuracy, seeds)
        table.append(
            {
                "model": model,
                "n": n,
                **estimate.columns("accuracy"),
            }
        )
    return pd.DataFrame(table)


@STUDY.table(
    "recordings",
    title="Accuracy on public recordings",
    note=NOTE,
    key=("recording", "n"),
)
def front(results: Results) -> pd.DataFrame | None:
    """The recordings, at the fewest, five and the largest number of frames per class."""
    found = recordings(results)
    table = []
    for scene, measured in found.items():
        about = {"recording": scene, "kind": "", "frames": ""}
        of_first = _about(scene, measured)
        for k, line in enumerate(_by_size(measured)):
            described = about if k else {**about, **of_first}
            table.append({**described, **line})
    if not table:
        return None
    commands = [f"{RUN}recordings scene={scene}" for scene in found]
    return _wide(table, COLUMNS, found.values(), commands)


def _about(scene: str, measured: Measured) -> dict[str, str]:
    """The kind of the frames, and what they are."""
    frames = configs.scene_display(scene)["frames"]
    if saturated(measured):
        frames += "; saturated, ranks nothing"
    kind = configs.scene_display(scene)["kind"]
    if "origin" in measured.frame:
        kind = kind_of(measured.frame.origin.iloc[0])
    return {"kind": kind, "frames": frames}


def _wide(
    table: Sequence[Mapping[str, Any]],
    columns: Mapping[str, Column],
    found: Any,
    commands: Sequence[str],
) -> pd.DataFrame:
    """The rows with the columns of what they are first, then each model's value, then bounds."""
    models: dict[str, None] = {}
    for measured in found:
        models |= dict.fromkeys(models_of(measured.frame))
    of_models = model_columns(models, ", %", percent)
    every = {**columns, **of_models}
    data = pd.DataFrame(table)
    names = [name for name in every if name in data]
    data.attrs |= {"columns": every, "shown": names, "commands": commands}
    bounds = [name + end for name in models for end in ENDS[1:]]
    known = [bound for bound in bounds if bound in data]
    return data[[*names, *known]]


def _by_size(measured: Measured) -> Iterator[dict[str, Any]]:
    """Accuracies by the split that counts at the fewest, five and the most frames per class."""
    lines = summary(measured)
    if not len(lines):
        return
    sizes = sorted(lines.n.unique())
    middle = [n for n in sizes if n == 5]
    for n in dict.fromkeys((sizes[0], *middle, sizes[-1])):
        line = {"n": n}
        at = lines[lines.n == n].set_index("model")
        for model, part in at.iterrows():
            for end in ENDS:
                line[f"{model}{end}"] = part[f"accuracy{end}"]
        yield line


@STUDY.table(
    "recordings_fields",
    key=("recording", "n"),
    title="One fibre seen through more input fields",
    note=f"{NOTE} More fields are more pixels of the same modes.",
    folded=True,
)
def fields(results: Results) -> pd.DataFrame | None:
    """Each fibre that was seen through several numbers of input fields, by that number."""
    found = by_scene(results, "recordings")
    several = [_fibre(one) for one in found.values() if fields_of(one) > 1]
    chosen = {name: one for name, one in found.items() if _fibre(one) in several}
    table = []
    for scene in sorted(chosen, key=lambda name: fields_of(chosen[name])):
        count = fields_of(chosen[scene])
        side = chosen[scene].record.config["scene"]["side"]
        about = {
            "recording": scene,
            "fields": count,
            "pixels": 2 * side**2 * count,
        }
        table += [{**about, **line} for line in _by_size(chosen[scene])]
    if not table:
        return None
    columns = {
        "recording": COLUMNS["recording"],
        "fields": Column("Input fields"),
        "pixels": Column("Pixels"),
        "n": COLUMNS["n"],
    }
    commands = [f"{RUN}recordings scene={scene}" for scene in chosen]
    return _wide(table, columns, chosen.values(), commands)


def _fibre(measured: Measured) -> dict[str, Any]:
    """What the scene of a measurement is, whatever the number of input fields."""
    scene = measured.record.config.get("scene") or {}
    return {key: scene[key] for key in scene if key != "n_fields"}


@STUDY.table(
    "recording_theory",
    title="Theory from ten frames of every class, and the accuracy that was found",
    columns={
        "recording": Column("Recording", scene_name),
        "n": Column("Frames per class"),
        "hdc": Column("HDC, %", percent),
        "hdc_theory": Column("HDC by theory, %", percent),
        "mean_image": Column("Mean image, %", percent),
        "mean_image_theory": Column("Mean image by theory, %", percent),
        "cost": Column("Cost of the bit, points", points),
        "cost_theory": Column("Cost by theory, points", points),
    },
    note="Random split, because theory takes all frames of a class as alike. Theory knows the "
    "correlations of pairs among ten frames of every class and classifies none; brackets: the "
    "central 95 % of 20 choices of the ten. Mean image: compared by correlation. Cost of the bit: "
    "mean image less HDC.",
    folded=True,
)
def expected_by_theory(results: Results) -> pd.DataFrame | None:
    """A row for each recording and n of which both theory and a measurement are there."""
    table, benches = [], recordings(results)
    for scene, expected in recordings(results, "recording_theory").items():
        if scene in benches:
            table += list(_theory_beside(scene, expected, benches[scene]))
    if not table:
        return None
    data = pd.DataFrame(table)
    data.attrs["commands"] = [
        f"{RUN}recording_theory scene={name}" for name in data.recording.unique()
    ]
    return data


def _theory_beside(
    scene: str, expected: Measured, bench: Measured
) -> Iterator[dict[str, Any]]:
    """Rows of one recording; none where one of the two models of the theory was not measured."""
    pair = ["hdc", "correlation"]
    lines = accuracies(bench.frame).query("split == 'random' and model in @pair")
    means = lines.groupby(["n", "model"]).accuracy.mean()
    found = means.unstack().reindex(columns=pair).dropna()
    theory = expected.frame
    rows = theory.assign(cost=theory.mean_image - theory.hdc)
    for n, part in rows.groupby("n"):
        if n not in found.index:
            continue
        hdc, image = found.loc[n]
        line = {
            "recording": scene,
            "n": n,
            "hdc": hdc,
            "mean_image": image,
        }
        line["cost"] = image - hdc
        for name in ("hdc", "mean_image", "cost"):
            estimate = over_units(part[name].tolist(), seeds=False)
            line |= estimate.columns(f"{name}_theory")
        yield line


@STUDY.figure(
    "recordings",
    caption="Accuracy of every model on each public recording that is not saturated, by the "
    "number of training frames per class. Grey band: HDC; dashed: chance. Models are in the order "
    "of their mean at the most frames. Split by time, group or position; bars: 95 %.",
    size=(7.0, 4.0),
    needs=lambda results: bool(unsaturated(results)),
)
def every_model(figure: Figure, results: Results) -> None:
    """A panel per recording, a line per model, a marker per number of frames."""
    shown = unsaturated(results)
    summaries = {scene: summary(measured) for scene, measured in shown.items()}
    models = _by_mean(summaries.values())
    panels = figure.subplots(
        1,
        len(shown),
        sharey=True,
        squeeze=False,
    )[0]
    letters = iter(LETTERS)
    for axes, scene in zip(panels, shown, strict=True):
        _frame_of_panel(axes, models, _chance(shown[scene].frame))
        _draw_accuracies(axes, models, summaries[scene])
        panel(axes, next(letters), wrapped(scene_name(scene), 14))
    names = [literal(display_name(model)) for model in models]
    panels[0].set_yticks(range(len(models)), names)
    labels = panels[0].get_yticklabels()
    for label, model in zip(labels, models, strict=True):
        weight = "bold" if model == "hdc" else "normal"
        label.set(fontsize=6, fontweight=weight)
    handles = [
        Line2D(
            [],
            [],
            color=colour,
            marker=marker,
            ls="",
            ms=3,
            label=str(n),
        )
        for n, (colour, marker) in SIZES.items()
    ]
    where: Any = {"loc": "outside lower center", "ncols": len(SIZES)}
    figure.legend(handles=handles, title="frames per class", **where)


def _draw_accuracies(
    axes: Axes,
    models: Sequence[str],
    lines: pd.DataFrame,
) -> None:
    """A marker for each number of frames in the line of each model."""
    for n, (colour, marker) in SIZES.items():
        at = lines[lines.n == n].set_index("model")
        measured = [model for model in models if model in at.index]
        columns = [f"accuracy{end}" for end in ENDS]
        x, spread = errors(at.loc[measured, columns], 100)
        axes.errorbar(
            x,
            [models.index(model) for model in measured],
            xerr=np.maximum(spread, 0),
            elinewidth=0.5,
            color=colour,
            marker=marker,
            ls="",
            ms=2.6,
        )


def unsaturated(results: Results) -> dict[str, Measured]:
    """The recordings that can tell models apart."""
    found = recordings(results).items()
    return {scene: measured for scene, measured in found if not saturated(measured)}


def _by_mean(summaries: Any) -> list[str]:
    """Models, the least accurate first, by their mean over recordings at the most frames."""
    most = [lines[lines.n == lines.n.max()] for lines in summaries]
    by_model = pd.concat(most).groupby("model")
    means = by_model.accuracy.mean().sort_values()
    every = pd.concat(list(summaries)).model.unique()
    others = [model for model in every if model not in means.index]
    return [*others, *means.index]


def _chance(rows: pd.DataFrame) -> float | None:
    """Accuracy of guessing, in percent; None where the rows do not have the number of classes."""
    return 100 / rows.n_classes.iloc[0] if "n_classes" in rows else None


def _frame_of_panel(
    axes: Axes,
    models: Sequence[str],
    chance: float | None,
) -> None:
    """Axis, lines of the models, the band of HDC and the dashed line of chance."""
    axes.set(xlim=(0, 103), ylim=(-0.7, len(models) - 0.3))
    axes.set_xticks([0, 50, 100])
    axes.set_xlabel("accuracy (%)", fontsize=6)
    axes.set_yticks(range(len(models)))
    axes.grid(axis="y", color="0.92", lw=0.5)
    axes.set_axisbelow(True)
    if "hdc" in models:
        at = models.index("hdc")
        axes.axhspan(
            at - 0.5,
            at + 0.5,
            color="0.88",
            lw=0,
            zorder=0,
        )
    if chance is not None:
        axes.axvline(
            chance,
            color="0.4",
            lw=0.7,
            ls="--",
            zorder=0,
        )


@STUDY.figure(
    "recording_distances",
    caption="Hamming distances between hypervectors of frames of one class (intra) and of two "
    "(inter), and their separation d′. Unrelated frames differ in half of their pixels.",
    size=(7.0, 2.6),
    needs=lambda results: bool(recordings(results, "recording_distances")),
)
def distances(figure: Figure, results: Results) -> None:
    """Histograms of intra- and inter-class distances, a panel a recording."""
    shown = recordings(results, "recording_distances")
    panels = figure.subplots(
        1,
        len(shown),
        squeeze=False,
        sharex=True,
    )[0]
    colours = {"intra": "#0072B2", "inter": "#D55E00"}
    for letter, axes, scene in zip(LETTERS, panels, shown, strict=False):
        measured = shown[scene]
        for kind, colour in colours.items():
            part = measured.frame.query("kind == @kind")
            counts = part.groupby("low")["count"].sum()
            look = {"color": colour, "lw": 0.9, "label": kind}
            axes.step(
                counts.index,
                counts / counts.sum(),
                where="post",
                **look,
            )
        separated = number(separation(measured.frame), 2)
        panel(axes, letter, f"{wrapped(scene_name(scene), 22)}\nd′ = {separated}")
        axes.set_yticks([])
        axes.set_xlabel("share of bits that differ", fontsize=6)
    panels[0].set_ylabel("share of pairs", fontsize=6)
    panels[0].legend()
    head(figure, "Hamming distances between frames of one class and of two", [])


def separation(rows: pd.DataFrame) -> float:
    """d′ = |mean inter − mean intra| / √((variance inter + variance intra)/2)."""
    moments = rows.groupby("kind")[["mean", "variance"]].mean()
    means, variances = moments["mean"], moments["variance"]
    gap = abs(means["inter"] - means["intra"])
    return float(gap / np.sqrt(variances.mean()))
