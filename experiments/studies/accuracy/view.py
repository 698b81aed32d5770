"""Accuracy against the number of training samples (Fig. 5(b)), and against the pixels seen."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from typing import Any

import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FixedLocator, FuncFormatter, NullLocator

from experiments.records import configs
from experiments.records.groups import Group, Groups
from experiments.records.results import RUNS
from experiments.records.run import Finished
from experiments.reporting import estimates, published
from experiments.reporting.columns import display_name
from experiments.reporting.curves import accuracy_curves, published_point
from experiments.reporting.plot import by_panel, handle, literal, title
from experiments.reporting.rows import Row, caption, row, swept
from experiments.reporting.study import RUN, WIDTH, Numbers, Plot, Quantity, Study
from experiments.reporting.table import Table, frame
from experiments.reporting.text import split_name

N_PUBLISHED = 400  # of all the published accuracies; equal ones are drawn side by side
SHOWN = (
    "model",
    "n_train",
    "pixels",
    "seeds",
    "test_accuracy_final",
    "training_time_s",
    "predict_single_s",
    "model_bytes",
)
KEY = ("scene", "model", "n_train", "pixels")


def rows(runs: Groups, name: str) -> list[Row]:
    """Rows of a sweep, of N with one's own models too; none where there is one place only."""
    lines = swept(runs, (name,))
    if name == "accuracy_vs_n":
        scene = configs.sweep(name)["scene"][0]
        extra = runs.extra_models(scene)
        for group in runs:
            of_extra = group.scene == scene and group.model in extra
            if of_extra and group.pixels is None:
                hdc = runs.group(scene, "hdc", group.n_train)
                lines.append(row(group, hdc))
    measured = [line for line in lines if line["seeds"]]
    places = {(line["n_train"], line["pixels"]) for line in measured}
    return lines if len(places) > 1 else []


def accuracy_vs_n(lines: pd.DataFrame) -> pd.DataFrame:
    """Accuracies against the number N of training samples."""
    return frame(rows(Groups.of(lines), "accuracy_vs_n"))


def accuracy_vs_d(lines: pd.DataFrame) -> pd.DataFrame:
    """Accuracies against the number D of pixels."""
    return frame(rows(Groups.of(lines), "accuracy_vs_d"))


def quantities(lines: pd.DataFrame) -> Iterator[Quantity]:
    """Fig. 5(b): the number of training samples at which HDC exceeds 90 %, on a line between two
    N: of each seed that was run with every N, and has a curve of its own."""
    runs = Groups.of(lines)
    params = configs.sweep("accuracy_vs_n")
    sizes = configs.numbers(params["split.n_train"])
    groups = [runs.group(params["scene"][0], "hdc", n) for n in sizes]
    measured = [group for group in groups if group.runs]
    crossed = _crossings(measured)
    if not crossed or math.isnan(sum(crossed)):
        return
    n = min(len(group.right) for group in measured)
    yield Quantity.of(
        "accuracy_vs_n/n_for_90_percent",
        estimates.one_sensor(crossed).within(0, math.inf),
        f"{estimates.ONE_SENSOR}, each where its own curve first crosses",
        n=n,
        seeds=min(len(group.runs) for group in measured),
        made_by=f"{RUN}accuracy_vs_n",
    )


def _crossings(groups: Sequence[Group]) -> list[float]:
    """The crossing of each seed that was run with every N."""
    places = set()
    by_seed: dict[str, list[Finished]] = {}
    for group in groups:
        for run in group.runs:
            places.add(run.n_train)
            by_seed.setdefault(run.seeds, []).append(run)
    whole = [of_seed for of_seed in by_seed.values() if 1 < len(of_seed) == len(places)]
    return list(map(_crossing, whole))


def _crossing(of_seed: Sequence[Finished]) -> float:
    sizes = [record.n_train for record in of_seed]
    accuracies = [record.test_accuracy_final for record in of_seed]
    return estimates.crossing(sizes, accuracies)


def draw_accuracies(figure: Figure, of: pd.DataFrame) -> None:
    """Test accuracy against the number of training samples (Fig. 5(b) of the paper): the paper's
    models and fast ones first, then the others."""
    runs = Groups.of(of)
    lines = rows(runs, "accuracy_vs_n")
    with_runs = [line for line in lines if line["seeds"]]
    measured = list(dict.fromkeys(line["model"] for line in with_runs))
    known_models = configs.models("paper", "fast")
    first = [model for model in known_models if model in measured]
    shown = by_panel([*first, *(model for model in measured if model not in first)])
    figure.set_size_inches(WIDTH, 0.8 + 2.4 * len(shown))
    panels = [*figure.subplots(len(shown), 1, sharex=True, squeeze=False)[:, 0]]
    scene = configs.sweep("accuracy_vs_n")["scene"][0]
    run = next(run for run in runs.runs if run.scene_label == scene)
    chance = 100 / len(run.scene.classes)
    for axes, models in zip(panels, shown, strict=True):
        accuracy_curves(axes, lines, models, "n_train", [N_PUBLISHED])
        axes.legend(handles=list(map(handle, models)), loc="lower right")
        axes.axhline(chance, color="0.5", lw=0.7, ls=":", zorder=0)
    _draw_published(panels, shown[0])
    sizes = panels[-1].xaxis
    sizes.set_major_locator(FixedLocator([5, 10, 20, 50, 100, 200, 400]))
    sizes.set_minor_locator(NullLocator())
    sizes.set_major_formatter(FuncFormatter(lambda n, _: f"{n:g}"))
    panels[-1].set_xlabel("training samples N")
    text = "Test accuracy against training samples"
    title(figure, panels[0], text, lines, split_name(run.config["split"]))


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
    for accuracy, of_models in names.items():
        panels[0].text(
            N_PUBLISHED / 1.08,
            accuracy,
            literal("; ".join(of_models)),
            ha="right",
            va="center",
            fontsize=5.5,
            bbox={"fc": "white", "ec": "none", "pad": 0.5},
        )
    limit = known["accuracy_vs_n/n_for_90_percent"].value
    look: Any = {"color": "0.5", "lw": 0.7, "ls": (0, (4, 3)), "zorder": 0}
    for axes in panels:
        axes.plot([limit, limit], [0, 90], **look)
        axes.axhline(90, **look)
    text = f"paper: > 90 %\nonly for N > {limit:g}"
    panels[0].text(
        limit * 1.05,
        42,
        text,
        ha="left",
        color="0.3",
        fontsize=6,
    )


def _title(name: str, what: str) -> Callable[[pd.DataFrame], str]:
    """A title with the frames and the machine of what a table shows."""
    return lambda lines: caption(rows(Groups.of(lines), name), what)


STUDY = Study(
    "accuracy",
    "Few samples, few pixels",
    "How many training samples are enough, and how many pixels? The paper exceeds 90 % for N > 20.",
    order=2,
    front=True,
    tables=[
        Table(
            name,
            make,
            of=RUNS,
            title=_title(name, what),
            shown=SHOWN,
            key=KEY,
            commands=[f"{RUN}{name}"],
        )
        for name, make, what in (
            (
                "accuracy_vs_n",
                accuracy_vs_n,
                "Accuracy against the number N of training samples",
            ),
            (
                "accuracy_vs_d",
                accuracy_vs_d,
                "Accuracy against the number D of pixels seen",
            ),
        )
    ],
    figures=[
        Plot(
            "accuracy_vs_n",
            draw_accuracies,
            of=RUNS,
            caption="Test accuracy against the number of training samples (Fig. 5(b)). Stars: the "
            "paper's Table I. Dotted: chance.",
            size=(3.4, 5.6),
            needs=lambda lines: bool(rows(Groups.of(lines), "accuracy_vs_n")),
            commands=[f"{RUN}accuracy_vs_n"],
        )
    ],
    numbers=[Numbers(quantities, of=RUNS)],
)
