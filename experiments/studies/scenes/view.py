"""Every model on every scene: accuracies and confusions; Figs. 5(a), 6, 7 and 9.

Scenes of captured and computed frames come before simulated ones.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from experiments.records import configs
from experiments.records.groups import Group, Groups
from experiments.records.results import RUNS
from experiments.records.run import Finished
from experiments.reporting import estimates, published
from experiments.reporting.columns import scene_name
from experiments.reporting.estimates import ONE_SENSOR
from experiments.reporting.matrices import CONFUSION_MAP, PRINTED, matrix
from experiments.reporting.measured import matrices
from experiments.reporting.plot import LETTERS, head, panel, wrapped
from experiments.reporting.rows import row
from experiments.reporting.study import RUN, WIDTH, Numbers, Plot, Quantity, Study
from experiments.reporting.table import Table, frame
from experiments.reporting.text import SIMULATED, counted, frames_of, split_name
from experiments.studies.scenes import own

EXPERIMENT = "all_scenes"
SPATIAL_CORRELATION = (
    f"{RUN}correlation scene=spatial 'task.kinds=[prototype]' 'task.samples=[held-out]'"
)
# How the paper's accuracies on a scene end in published.csv.
_ACCURACY = "/test_accuracy"


def groups(runs: Groups) -> list[Group]:
    """The runs of each scene and model on all pixels with the most training samples, simulated
    scenes last, HDC first in each."""
    whole: dict[tuple[str, str], Group] = {}
    for group in runs:
        key = group.scene, group.model
        if group.pixels is None and group.runs:
            before = whole.get(key, group)
            whole[key] = max(before, group, key=lambda one: one.n_train or math.inf)
    order = [*configs.sweep(EXPERIMENT)["scene"]]

    def place(group: Group) -> tuple[bool, int, str, bool]:
        at = len(order)
        if group.scene in order:
            at = order.index(group.scene)
        simulated = group.runs[0].scene.origin == SIMULATED
        model, _, _ = group.model.partition(" (")
        return simulated, at, group.scene, model != "hdc"

    return sorted(whole.values(), key=place)


def all_scenes(lines: pd.DataFrame) -> pd.DataFrame:
    """One row per scene and model."""
    runs = Groups.of(lines)
    rows = []
    for group in groups(runs):
        hdc = runs.group(group.scene, "hdc", group.n_train)
        rows.append(row(group, hdc))
    return frame(rows)


def confusions(figure: Figure, lines: pd.DataFrame) -> None:
    """A panel per scene."""
    chosen = confused(Groups.of(lines))
    down = -(-len(chosen) // 2)
    figure.set_size_inches(WIDTH, 1.4 + 1.55 * down)
    panels = [figure.add_subplot(down, 2, k + 1) for k in range(len(chosen))]
    for axes, letter, group in zip(panels, LETTERS, chosen, strict=False):
        confusion(axes, group)
        axes.set(xlabel="predicted", ylabel="true")
        axes.tick_params(axis="x", rotation=90)
        of_paper = configs.scene_display(group.scene)["figure"]
        of = f", {of_paper}" if of_paper else ""
        accuracy = 100 * estimates.share(group).value
        scene = wrapped(scene_name(group.scene), 20)
        panel(axes, letter, f"{scene}{of}\n{accuracy:.1f} %")
    origins = [{"origin": group.runs[0].scene.origin} for group in chosen]
    frames = frames_of(origins)
    head(figure, "Confusion by HDC, % of the true label", [frames])


def confused(runs: Groups) -> list[Group]:
    """HDC's runs on each scene of few classes of which some are confused."""
    of_hdc = [group for group in groups(runs) if group.model == "hdc"]
    few = [group for group in of_hdc if len(group.classes) <= PRINTED]
    return [group for group in few if estimates.share(group).value < 1]


def confusion(axes: Axes, group: Group) -> None:
    """Shares of each true class in percent."""
    counts = group.confusion()
    of_class = counts.sum(1, keepdims=True)
    shares = 100 * counts / np.maximum(of_class, 1)
    few = len(group.classes) <= PRINTED
    cells = [_whole(line) for line in shares] if few else None
    gamma = 1 if few else 0.4  # a colour has to show one of 100 test samples
    bar = matrix(axes, shares, group.classes, cells, CONFUSION_MAP, (0, 100), gamma)
    if few:
        bar.remove()
    else:
        bar.set_ticks([0, 5, 20, 50, 100])


def _whole(shares: np.ndarray) -> list[str]:
    """Shares in whole percent; less than half a percent is left blank."""
    return [f"{share:.0f}" if share >= 0.5 else "" for share in shares]


def positions(record: Finished) -> np.ndarray:
    """Places along the line of contacts of a run on the scene ``spatial``: mm [L]."""
    line = record.config["scene"]["classes"]
    length = math.dist(line["start"], line["stop"])
    return np.linspace(0.0, 1e3 * length, line["number"])


def spatial(figure: Figure, lines: pd.DataFrame) -> None:
    """Fig. 7 and the error in millimetres."""
    group = Groups.of(lines).group("spatial", "hdc")
    is_spatial = (lines.experiment == "correlation") & (lines.scene == "spatial")
    correlations = lines[is_spatial]
    grid = figure.add_gridspec(2, 2, height_ratios=(1.4, 1))
    left = figure.add_subplot(grid[0, 0])
    right = figure.add_subplot(grid[0, 1])
    below = figure.add_subplot(grid[1, :])
    if len(correlations):
        classes, values, _ = matrices(correlations, "prototype", "held-out")
        matrix(left, values.mean(0), classes)
        left.set(
            xlabel="hypervectors of position (mm)", ylabel="prototype of position (mm)"
        )
    else:
        left.set_axis_off()
    panel(left, "a", "correlation $C^p$, held out" if left.axison else "no measurement")
    confusion(right, group)
    right.set(xlabel="predicted (mm)", ylabel="true position (mm)")
    panel(right, "b", "confusion (%)")
    at = positions(group.runs[0])
    truth = np.concatenate([run.test_labels for run in group.runs])
    found = np.concatenate([run.predicted for run in group.runs])
    error = np.abs(at[found] - at[truth])
    sums = np.bincount(truth, error, len(at))
    mean = sums / np.bincount(truth, minlength=len(at))
    below.plot(
        at,
        mean,
        color="#0072B2",
        marker="o",
        ms=2,
    )
    below.set(xlabel="true position (mm)", ylabel="mean |error| (mm)")
    below.set_ylim(0, None)
    median, most = np.percentile(error, (50, 95))
    text = f"mean {error.mean():.2f} mm, median {median:.3g} mm, "
    text += f"95th percentile {most:.3g} mm"
    panel(below, "c", text)
    run = group.runs[0]
    frames = frames_of([{"origin": run.scene.origin}])
    split, seeds = split_name(run.config["split"]), counted(len(group.runs), "seed")
    head(
        figure,
        "HDC: 51 positions, 1 mm apart (Fig. 7)",
        [f"{frames}, {split}, {seeds}"],
    )


def quantities(lines: pd.DataFrame) -> Iterator[Quantity]:
    """Accuracies of HDC on the scenes of which the paper gives one."""
    runs = Groups.of(lines)
    names = (name for name in published.numbers() if name.endswith(_ACCURACY))
    for scene in (name.removesuffix(_ACCURACY) for name in names):
        group = runs.group(scene, "hdc")
        if group.runs:
            share, n = estimates.share_of_one_sensor(group), len(group.right)
            rest = {
                "n": n,
                "seeds": len(group.runs),
                "made_by": f"{RUN}{EXPERIMENT}",
            }
            yield Quantity.of(f"{scene}{_ACCURACY}", share, ONE_SENSOR, 100, **rest)


def _has_spatial(lines: pd.DataFrame) -> bool:
    return bool(Groups.of(lines).group("spatial", "hdc").runs)


STUDY = Study(
    "scenes",
    "Models by scene",
    "How accurate is each model on every scene, own recordings included?",
    order=2.2,
    tables=[
        Table(
            EXPERIMENT,
            all_scenes,
            of=RUNS,
            title="Every model on every scene",
            key=("scene", "model", "n_train", "pixels"),
            note="Fitted: parameters of the scene were chosen by the accuracy of HDC on it. Each "
            "model on all pixels of a scene and the most training samples that it was given.",
            shown=(
                *("scene", "origin", "model", "test_accuracy_final", "over_hdc"),
                *("training_time_s", "predict_single_s", "model_bytes"),
            ),
            commands=[f"{RUN}{EXPERIMENT}"],
        )
    ],
    figures=[
        Plot(
            "confusions",
            confusions,
            of=RUNS,
            caption="Confusion of the classes by HDC, in percent of the true label (rows), test "
            "samples of all seeds together (Figs. 6(b) and 9(d)). Cells below 0.5 % "
            "are blank. Scenes without errors are left out.",
            needs=lambda lines: bool(confused(Groups.of(lines))),
            commands=[f"{RUN}{EXPERIMENT}"],
        ),
        Plot(
            "fig7_spatial",
            spatial,
            of=(RUNS, "correlation"),
            caption="51 positions: correlations, confusion and error in millimetres (Fig. 7).",
            size=(WIDTH, 3.9),
            needs=_has_spatial,
            commands=[f"{RUN}{EXPERIMENT}", SPATIAL_CORRELATION],
        ),
        Plot(
            "own_accuracy_vs_n",
            own.accuracy_vs_n,
            of=RUNS,
            caption="Test accuracy against the number of training samples, of runs that were "
            "started by hand: a panel per scene.",
            needs=lambda lines: bool(own.curves(lines)),
        ),
        Plot(
            "own_error_vs_time",
            own.error_vs_time,
            of=RUNS,
            caption="Test error against training time, of runs that were started by hand: a panel "
            "per scene. Lines: while the model learns; markers: after training.",
            needs=lambda lines: bool(own.started(lines)),
        ),
    ],
    numbers=[Numbers(quantities, of=RUNS)],
)
