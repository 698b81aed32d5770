"""Accuracy against the number of training samples (Fig. 5(b)), the pixels seen, and by scene."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any

import pandas as pd

from experiments.records import configs
from experiments.records.results import ROW, RUNS
from experiments.reporting import estimates, published
from experiments.reporting.columns import display_name
from experiments.reporting.estimates import ONE_SENSOR
from experiments.reporting.facets import line
from experiments.reporting.plot import (
    DASHED,
    by_panel,
    handle,
    literal,
    look_of,
    published_point,
)
from experiments.reporting.study import RUN, Figure, Numbers, Quantity, Study
from experiments.reporting.table import Table
from experiments.reporting.text import SIMULATED
from experiments.reporting.trained import (
    caption,
    extra_models,
    of_runs,
    swept,
    whole,
)
from experiments.studies.accuracy import confusions, own

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure as Canvas

N_PUBLISHED = 400  # of all the published accuracies; equal ones are drawn side by side
ALL_SCENES = "all_scenes"
KEY = ("scene", "model", "n_train", "pixels")
SHOWN = (
    *("model", "n_train", "pixels", "seeds", "test_accuracy_final"),
    *("training_time_s", "predict_single_s", "model_bytes"),
)
_ACCURACY = (
    "/test_accuracy"  # how the paper's accuracies on a scene end in published.csv
)


def several(table: pd.DataFrame) -> pd.DataFrame | None:
    """A table of a sweep without the names of its rows; None where one place was measured only."""
    places = table[table.seeds.astype(bool)][["n_train", "pixels"]].drop_duplicates()
    return table.drop(columns=ROW[2:]) if len(places) > 1 else None


def accuracy_vs_n(runs: pd.DataFrame) -> pd.DataFrame | None:
    """Accuracies against the number N of training samples, of one's own models, too."""
    rows = swept(runs, "accuracy_vs_n")
    (scene,) = configs.sweep("accuracy_vs_n")["scene"]
    is_own = runs.model.isin(extra_models(runs, scene)) | runs.model.eq("hdc")
    own_runs = runs[is_own & (runs.scene == scene) & (runs.asked_d == 0)]
    own_rows = of_runs(own_runs)
    own_rows = own_rows[own_rows.model != "hdc"]
    return several(pd.concat([rows, own_rows]) if len(own_rows) else rows)


def accuracy_vs_d(runs: pd.DataFrame) -> pd.DataFrame | None:
    """Accuracies against the number D of pixels."""
    return several(swept(runs, "accuracy_vs_d"))


def all_scenes(runs: pd.DataFrame) -> pd.DataFrame:
    """A row per scene and model: on all pixels, with the most training samples; simulated scenes
    last, HDC first in each."""
    rows = of_runs(runs)
    order = [*configs.sweep(ALL_SCENES)["scene"]]
    every = rows[rows.asked_d == 0]
    every = every.assign(
        size=every.asked_n.where(every.asked_n > 0, math.inf).astype(float),
        simulated=every.scene.map(lambda name: _is_simulated(name)),
        place=[order.index(s) if s in order else len(order) for s in every.scene],
        other=~every.model.str.partition(" (")[0].eq("hdc"),
    )
    most = every.loc[every.groupby(["scene", "model"], sort=False)["size"].idxmax()]
    by = ["simulated", "place", "scene", "other"]
    ordered = most.sort_values(by, kind="stable")
    return ordered.drop(columns=["size", *by[:2], "other", *ROW[2:]])


def _is_simulated(scene: str) -> bool:
    return bool(configs.scene_display(scene)["kind"] == SIMULATED)


def draw_accuracies(figure: Canvas, data: pd.DataFrame) -> None:
    """Test accuracy against the number of training samples (Fig. 5(b) of the paper): the paper's
    models and fast ones first, then the others."""
    measured = data[data.seeds.astype(bool)]
    models = list(measured.model.unique())
    known = [name for name in configs.models("paper", "fast") if name in models]
    shown = by_panel([*known, *(name for name in models if name not in known)])
    figure.set_size_inches(3.4, 0.8 + 2.4 * len(shown))
    panels = [*figure.subplots(len(shown), 1, sharex=True, squeeze=False)[:, 0]]
    sizes = [N_PUBLISHED, *data.n_train.dropna()]
    lowest = 100 * measured.test_accuracy_final_low.min()
    for axes, names in zip(panels, shown, strict=True):
        _curves(axes, measured, names)
        axes.set_xscale("log")
        axes.set_xlim(min(sizes) / 1.35, max(sizes) * 1.35)
        axes.set_ylim(min(15, lowest - 2), 102)
        axes.set_ylabel("test accuracy (%)")
        axes.legend(handles=list(map(handle, names)), loc="lower right")
        chance = 100 / measured.n_classes.iloc[0]
        axes.axhline(chance, color="0.5", lw=0.7, ls=":", zorder=0)
    _draw_published(panels, shown[0])
    below = panels[-1].xaxis
    ticks = [n for n in (5, 10, 20, 50, 100, 200, 400) if n >= min(sizes) / 1.35]
    below.set_ticks(ticks, map(str, ticks))
    below.set_ticks([], minor=True)
    panels[-1].set_xlabel("training samples N")


def _curves(axes: Axes, measured: pd.DataFrame, models: Sequence[str]) -> None:
    """Accuracies of models, which are set apart by a few percent of N."""
    for k, model in enumerate(models):
        rows = measured[measured.model == model].sort_values("n_train")
        apart = rows.assign(n_train=rows.n_train * 1.02 ** (k - len(models) // 2))
        line(axes, apart, "n_train", "test_accuracy_final", 100, **look_of(model))


def _draw_published(panels: Sequence[Axes], shown: Sequence[str]) -> None:
    """The paper's accuracies as stars, named where the model has no line beside them, and its least
    N for 90 % as dashed lines."""
    known = published.numbers()
    drawn: list[float] = []
    names: dict[float, list[str]] = {}
    for model in published.models_of_table1():
        accuracy = known[f"table1/{model}_test_accuracy"].value
        place = N_PUBLISHED * 1.1 ** drawn.count(accuracy)
        published_point(panels[0], model, place, accuracy, 8)
        drawn.append(accuracy)
        if model not in shown:
            names.setdefault(accuracy, []).append(display_name(model))
    box = {"fc": "white", "ec": "none", "pad": 0.5}
    for accuracy, of_models in names.items():
        text = literal("; ".join(of_models))
        look: Any = {"ha": "right", "va": "center", "fontsize": 5.5, "bbox": box}
        panels[0].text(N_PUBLISHED / 1.08, accuracy, text, **look)
    limit = known["accuracy_vs_n/n_for_90_percent"].value
    for axes in panels:
        axes.plot([limit, limit], [0, 90], **DASHED)
        axes.axhline(90, **DASHED)
    text = f"paper: > 90 %\nonly for N > {limit:g}"
    panels[0].text(limit * 1.05, 42, text, ha="left", color="0.3", fontsize=6)


def quantities(runs: pd.DataFrame) -> Iterator[Quantity]:
    """Accuracies of HDC on the scenes of which the paper gives one; and the number of training
    samples at which HDC exceeds 90 % (Fig. 5(b))."""
    of_hdc = runs[runs.model == "hdc"]
    names = (name for name in published.numbers() if name.endswith(_ACCURACY))
    for scene in (name.removesuffix(_ACCURACY) for name in names):
        of_scene = whole(of_hdc[of_hdc.scene == scene])
        if len(of_scene):
            share = estimates.share_of_one_sensor(of_scene)
            about = {"n": int(of_scene.n_test.sum()), "seeds": len(of_scene)}
            made_by = f"{RUN}{ALL_SCENES}"
            name = f"{scene}{_ACCURACY}"
            yield Quantity.of(name, share, ONE_SENSOR, 100, made_by=made_by, **about)
    yield from _least_samples(of_hdc)


def _least_samples(of_hdc: pd.DataFrame) -> Iterator[Quantity]:
    """The N at which HDC exceeds 90 %, on a line between two N: of each seed that was run with
    every N, and has a curve of its own."""
    params = configs.sweep("accuracy_vs_n")
    asked = of_hdc.asked_n.isin(configs.numbers(params["split.n_train"]))
    (scene,) = params["scene"]
    lines = of_hdc[asked & (of_hdc.scene == scene) & (of_hdc.asked_d == 0)]
    every = lines["n_train"].nunique()
    crossed = [
        estimates.crossing(of_seed.n_train, of_seed.test_accuracy_final)
        for _, of_seed in lines.groupby("seeds")
        if 1 < len(of_seed) == every
    ]
    if not crossed or math.isnan(sum(crossed)):
        return
    by_size = lines.groupby("n_train")
    yield Quantity.of(
        "accuracy_vs_n/n_for_90_percent",
        estimates.one_sensor(crossed).within(0, math.inf),
        f"{ONE_SENSOR}, each where its own curve first crosses",
        n=int(by_size.n_test.sum().min()),
        seeds=int(by_size.size().min()),
        made_by=f"{RUN}accuracy_vs_n",
    )


def _sweep(name: str, make: object, what: str) -> Table:
    """The table of a sweep."""
    return Table(
        name,
        make,  # type: ignore[arg-type]
        of=RUNS,
        key=KEY,
        title=lambda data: caption(data, what),
        shown=SHOWN,
        commands=[f"{RUN}{name}"],
    )


VS_N = _sweep(
    "accuracy_vs_n",
    accuracy_vs_n,
    "Accuracy against the number N of training samples",
)
VS_D = _sweep(
    "accuracy_vs_d", accuracy_vs_d, "Accuracy against the number D of pixels seen"
)
BY_SCENE = Table(
    ALL_SCENES,
    all_scenes,
    of=RUNS,
    key=KEY,
    title="Every model on every scene",
    note="Fitted: parameters of the scene were chosen by the accuracy of HDC on it. Each model on "
    "all pixels of a scene and the most training samples that it was given.",
    shown=(
        *("scene", "origin", "model", "test_accuracy_final", "over_hdc"),
        *("training_time_s", "predict_single_s", "model_bytes"),
    ),
    commands=[f"{RUN}{ALL_SCENES}"],
)
STUDY = Study(
    "accuracy",
    "Few samples, few pixels, every scene",
    "How many training samples are enough, and how many pixels? The paper exceeds 90 % for N > 20. "
    "How accurate is each model on every scene, own recordings included?",
    order=2,
    front=True,
    tables=[VS_N, VS_D, BY_SCENE],
    figures=[
        Figure(
            "accuracy_vs_n",
            VS_N,
            draw_accuracies,
            title="Test accuracy against training samples",
            caption="Test accuracy against the number of training samples (Fig. 5(b)). Stars: the "
            "paper's Table I. Dotted: chance. Bars: 95 % intervals.",
            size=(3.4, 5.6),
        ),
        *confusions.FIGURES,
        *own.FIGURES,
    ],
    numbers=[Numbers(quantities, of=[RUNS])],
)
