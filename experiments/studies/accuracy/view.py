"""Accuracy against the number of training samples (Fig. 5(b)), the pixels seen, and by scene.

``confusions`` draws classes and positions, which are in no table.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Any

import pandas as pd

from experiments.records import configs
from experiments.records.results import ROW, RUNS
from experiments.reporting import estimates, published
from experiments.reporting.columns import display_name, scene_name
from experiments.reporting.facets import facets
from experiments.reporting.plot import (
    DASHED,
    entry,
    handle,
    legend_below,
    published_look,
    wrapped,
)
from experiments.reporting.study import (
    RUN,
    WIDTH,
    Figure,
    Quantity,
    Study,
    about,
)
from experiments.reporting.table import Table
from experiments.reporting.trained import caption, of_runs, whole
from experiments.studies.accuracy import confusions
from experiments.studies.accuracy.confusions import ALL_SCENES, by_place

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure as Canvas

N_PUBLISHED = 400  # of all the published accuracies; equal ones are drawn side by side
MOST_MODELS = 4  # of the figure; the CSV has all
KEY = ("scene", "model", "n_train", "pixels")
# How the names of the paper's accuracies on a scene end in published.csv.
_ACCURACY = "/test_accuracy"


def curves(runs: pd.DataFrame, along: str) -> pd.DataFrame | None:
    """Rows of the models that were trained on several numbers of samples, or of pixels, of a scene,
    one's own too."""
    rows = of_runs(runs)
    several = rows.groupby(["scene", "model"])[along].transform("nunique") > 1
    ordered = rows[several].sort_values(["scene", "model", along])
    return ordered.drop(columns=ROW[2:])


def all_scenes(runs: pd.DataFrame) -> pd.DataFrame:
    """A row per scene and model: on all pixels, with the most training samples; simulated scenes
    last, HDC first in each."""
    rows = of_runs(runs[runs.asked_d == 0])
    size = rows.asked_n.where(rows.asked_n > 0, math.inf).astype(float)
    rows = rows.loc[size.groupby([rows.scene, rows.model], sort=False).idxmax()]
    is_hdc = rows.model.str.partition(" (")[0].eq("hdc")
    ordered = rows.assign(other=~is_hdc, at=rows.scene.map(by_place))
    ordered = ordered.sort_values(["at", "other"], kind="stable")
    return ordered.drop(columns=["other", "at", *ROW[2:]])


def draw_accuracies(figure: Canvas, data: pd.DataFrame) -> None:
    """A panel per scene: test accuracy against the number of training samples of the paper's models
    and fast ones, then others; on the scene of the paper's Fig. 5(b) its values."""
    found = set(data.model)
    order = dict.fromkeys([*configs.models("paper", "fast"), *data.model])
    models = [model for model in order if model in found][:MOST_MODELS]
    shown = data[data.model.isin(models)].sort_values("n_train", kind="stable")
    figure.set_size_inches(WIDTH, 1.5 + 2.2 * shown.scene.nunique())
    place = shown.model.map(models.index) - len(models) // 2
    # Apart by a few percent of N.
    apart = shown.assign(n_train=shown.n_train * 1.02**place, column="")
    names = ("n_train", "test_accuracy_final", "model", "scene", "column")
    for (scene, _), axes in facets(figure, apart, *names, scale=100).items():
        of_scene = shown[shown.scene == scene]
        axes.set(xscale="log", xlabel="training samples N", ylabel="test accuracy (%)")
        sizes = of_scene.n_train.unique().tolist()
        axes.set_xticks(sizes, map(str, sizes), fontsize=6, rotation=90)
        axes.set_xticks([], minor=True)
        chance = 100 / of_scene.n_classes.iloc[0]
        axes.axhline(chance, color="0.5", lw=0.7, ls=":", zorder=0)
        axes.set_title(wrapped(scene_name(scene), 40))
        if [scene] == configs.sweep("accuracy_vs_n")["scene"]:
            _draw_published(axes)
    stars = [
        entry(f"paper: {display_name(model)}", **published_look(model))
        for model in published.models_of_table1()
    ]
    legend_below(figure, [*map(handle, models), *stars])


def _draw_published(axes: Axes) -> None:
    """The paper's accuracies as stars, and its least N for 90 % as dashed lines."""
    known = published.numbers()
    drawn: list[float] = []
    for model in published.models_of_table1():
        accuracy = known[f"table1/{model}_test_accuracy"].value
        place = N_PUBLISHED * 1.1 ** drawn.count(accuracy)
        axes.plot(place, accuracy, zorder=5, **published_look(model))
        drawn.append(accuracy)
    limit = known["accuracy_vs_n/n_for_90_percent"].value
    axes.axvline(limit, **DASHED)
    axes.axhline(90, **DASHED)
    text = f"paper: > 90 %\nonly for N > {limit:g}"
    axes.text(limit * 1.05, 42, text, ha="left", color="0.3", fontsize=6)


def quantities(runs: pd.DataFrame) -> Iterator[Quantity]:
    """Accuracies of HDC on the scenes of which the paper gives one; and the number of training
    samples at which HDC exceeds 90 % (Fig. 5(b))."""
    of_hdc = runs[runs.model == "hdc"]
    for name in published.numbers():
        of_scene = whole(of_hdc[of_hdc.scene == name.removesuffix(_ACCURACY)])
        if len(of_scene):
            share = estimates.share_of_one_sensor(of_scene)
            yield Quantity(name, share, int(of_scene.n_test.sum()), len(of_scene))
    yield from _least_samples(of_hdc[of_hdc.asked_d == 0])


def _least_samples(of_hdc: pd.DataFrame) -> Iterator[Quantity]:
    """The N at which HDC exceeds 90 %, on a line between two N: of each seed that was run with
    every N, and has a curve of its own."""
    params = configs.sweep("accuracy_vs_n")
    asked = of_hdc.asked_n.isin(configs.numbers(params["split.n_train"]))
    lines = of_hdc[asked & of_hdc.scene.isin(params["scene"])]
    crossed = [
        estimates.crossing(of_seed.n_train, of_seed.test_accuracy_final)
        for _, of_seed in lines.groupby("seeds")
        if 1 < len(of_seed) == lines["n_train"].nunique()
    ]
    if not crossed or math.isnan(sum(crossed)):
        return
    by_size = lines.groupby("n_train")
    yield Quantity(
        "accuracy_vs_n/n_for_90_percent",
        estimates.one_sensor(crossed).within(0, math.inf),
        n=int(by_size.n_test.sum().min()),
        seeds=int(by_size.size().min()),
        note="each seed where its own curve first crosses",
    )


def _sweep(name: str, make: Callable[[pd.DataFrame], Any], what: str) -> Table:
    """The table of a sweep."""
    return Table(
        name,
        make,
        of=RUNS,
        key=KEY,
        title=lambda data: caption(data, what),
        shown=(
            *("model", "n_train", "pixels", "seeds", "test_accuracy_final"),
            *("training_time_s", "predict_single_s", "model_bytes"),
        ),
        commands=[f"{RUN}{name}"],
    )


VS_N = _sweep(
    "accuracy_vs_n",
    lambda runs: curves(runs[runs.asked_d == 0], "n_train"),
    "Accuracy against the number N of training samples",
)
VS_D = _sweep(
    "accuracy_vs_d",
    lambda runs: curves(runs[runs.asked_n == 0], "pixels"),
    "Accuracy against the number D of pixels seen",
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
    "Number of samples and pixels",
    "How many training samples are enough, and how many pixels? The paper exceeds 90 % for N > 20. "
    "How accurate is each model on every data set, own ones included?",
    order=2,
    front=True,
    tables=[VS_N, VS_D, BY_SCENE],
    figures=[
        Figure(
            "accuracy_vs_n",
            VS_N,
            draw_accuracies,
            title="Test accuracy against training samples",
            details=lambda data: about(data.drop(columns="seeds")),
            caption="Test accuracy against the number of training samples (Fig. 5(b)), of a few "
            "models; the table has all. Stars: the paper's Table I. Dotted: chance. Bars: 95 % "
            "intervals over five or seven seeds; HDC with counts at N = 400 has one.",
        ),
        *confusions.FIGURES,
    ],
    numbers={RUNS: quantities},
)
