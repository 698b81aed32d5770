"""Accuracy against the number of training samples (Fig. 5(b)), the pixels seen, and by scene.

``confusions`` draws classes and positions, which are in no table.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
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
    published_point,
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
from experiments.reporting.trained import caption, extra_models, of_runs, swept, whole
from experiments.studies.accuracy import confusions
from experiments.studies.accuracy.confusions import ALL_SCENES, by_place

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure as Canvas

N_PUBLISHED = 400  # of all the published accuracies; equal ones are drawn side by side
MOST_MODELS = 4  # of the figure; the CSV has all
TICKS = (5, 10, 20, 50, 100, 200, 400)
KEY = ("scene", "model", "n_train", "pixels")
# How the names of the paper's accuracies on a scene end in published.csv.
_ACCURACY = "/test_accuracy"


def several(table: pd.DataFrame) -> pd.DataFrame | None:
    """A table of a sweep without the names of its rows; None where one place was measured only."""
    places = table[["n_train", "pixels"]].drop_duplicates()
    return table.drop(columns=ROW[2:]) if len(places) > 1 else None


def accuracy_vs_n(runs: pd.DataFrame) -> pd.DataFrame | None:
    """Accuracies against the number N of training samples, of one's own models, too."""
    (scene,) = configs.sweep("accuracy_vs_n")["scene"]
    wanted = runs.model.isin(extra_models(runs, scene)) | runs.model.eq("hdc")
    here = runs[wanted & (runs.scene == scene) & (runs.asked_d == 0)]
    own_rows = of_runs(here)[lambda rows: rows.model != "hdc"]
    rows = swept(runs, "accuracy_vs_n")
    return several(pd.concat([rows, own_rows]) if len(own_rows) else rows)


def own_accuracy_vs_n(runs: pd.DataFrame) -> pd.DataFrame | None:
    """Rows of runs on all pixels that no experiment started, of scenes on which a model was trained
    on several numbers of samples."""
    own = runs[runs["sweep"].eq("") & runs.asked_d.eq(0)]
    if not len(own):
        return None
    by_scene = of_runs(own).groupby("scene")
    several = by_scene.filter(lambda rows: rows.model.duplicated().any())
    return several.drop(columns=ROW[2:])


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
    """Test accuracy against the number of training samples (Fig. 5(b) of the paper): of the paper's
    models and fast ones, one's own, then others, and the paper's values."""
    swept_here = configs.sweep("accuracy_vs_n")["model"]
    own_models = data.model[~data.model.isin(swept_here)]
    order = [*configs.models("paper", "fast"), *own_models, *swept_here]
    found = set(data.model)
    models = [model for model in dict.fromkeys(order) if model in found][:MOST_MODELS]
    shown = data[data.model.isin(models)]
    place = shown.model.map(models.index) - len(models) // 2
    apart = shown.assign(n_train=shown.n_train * 1.02**place)  # by a few percent of N
    (axes,) = _draw_lines(figure, apart, TICKS).values()
    chance = 100 / data.n_classes.iloc[0]
    axes.axhline(chance, color="0.5", lw=0.7, ls=":", zorder=0)
    axes.text(50, chance, "chance", ha="center", va="bottom", color="0.3", fontsize=6)
    _draw_published(axes)
    lowest = 100 * data.test_accuracy_final_low.min()
    axes.set_ylim(min(15, lowest - 2), 102)
    sizes = [N_PUBLISHED, *data.n_train]
    axes.set_xlim(min(sizes) / 1.35, max(sizes) * 1.35)
    stars = [
        entry(f"paper: {display_name(model)}", **published_look(model))
        for model in published.models_of_table1()
    ]
    legend_below(figure, [*map(handle, models), *stars])


def _draw_lines(
    figure: Canvas, data: pd.DataFrame, ticks: Sequence[int]
) -> dict[str, Axes]:
    """A panel per scene (returned by its name), a line per model."""
    names = ("n_train", "test_accuracy_final", "model", "scene", "experiment")
    rows = data.sort_values("n_train", kind="stable").assign(experiment="")
    panels = facets(figure, rows, *names, scale=100, sharex=True)
    for axes in panels.values():
        axes.set(xscale="log", xlabel="training samples N", ylabel="test accuracy (%)")
        axes.set_xticks(ticks, map(str, ticks))
        axes.set_xticks([], minor=True)
    return {scene: axes for (scene, _), axes in panels.items()}


def _draw_published(axes: Axes) -> None:
    """The paper's accuracies as stars, and its least N for 90 % as dashed lines."""
    known = published.numbers()
    drawn: list[float] = []
    for model in published.models_of_table1():
        accuracy = known[f"table1/{model}_test_accuracy"].value
        place = N_PUBLISHED * 1.1 ** drawn.count(accuracy)
        published_point(axes, model, place, accuracy, 8)
        drawn.append(accuracy)
    limit = known["accuracy_vs_n/n_for_90_percent"].value
    axes.plot([limit, limit], [0, 90], **DASHED)
    axes.axhline(90, **DASHED)
    text = f"paper: > 90 %\nonly for N > {limit:g}"
    axes.text(limit * 1.05, 42, text, ha="left", color="0.3", fontsize=6)


def draw_own(figure: Canvas, data: pd.DataFrame) -> None:
    """Runs that were started by hand."""
    figure.set_size_inches(WIDTH, 1 + 2 * data.scene.nunique())
    panels = _draw_lines(figure, data, sorted(data.n_train.unique()))
    for scene, axes in panels.items():
        axes.set_title(wrapped(scene_name(scene), 40))
    legend_below(figure, map(handle, data.model.unique()))


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
    accuracy_vs_n,
    "Accuracy against the number N of training samples",
)
VS_D = _sweep(
    "accuracy_vs_d",
    lambda runs: several(swept(runs, "accuracy_vs_d")),
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
            size=(3.4, 3.7),
        ),
        confusions.FIGURE,
        Figure(
            "own_accuracy_vs_n",
            Table("own_accuracy_vs_n", own_accuracy_vs_n, of=RUNS),
            draw_own,
            title="Test accuracy against training samples",
            caption="Test accuracy against the number of training samples, of runs that were "
            "started by hand, with 95 % intervals: a panel per data set.",
        ),
    ],
    numbers={RUNS: quantities},
)
