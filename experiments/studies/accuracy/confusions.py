"""Which classes HDC confuses (Figs. 6(b) and 9(d)), and by how many millimetres (Fig. 7)."""

from __future__ import annotations

import json
from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from experiments.records import configs
from experiments.records.results import RUNS, by_scene, of_experiment
from experiments.records.rows import unpack_labels
from experiments.reporting.columns import scene_name
from experiments.reporting.facets import PRINTED, matrix
from experiments.reporting.plot import LETTERS, panel, wrapped
from experiments.reporting.resamples import mean_matrix
from experiments.reporting.study import RUN, Figure, about
from experiments.reporting.table import Table
from experiments.reporting.text import SIMULATED
from experiments.reporting.trained import split_of, whole

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.colorbar import Colorbar
    from matplotlib.figure import Figure as Canvas

ALL_SCENES = "all_scenes"
SPATIAL = "spatial"
SPATIAL_CORRELATION = (
    f"{RUN}correlation scene=spatial 'task.kinds=[prototype]' 'task.samples=[held-out]'"
)


def by_place(scene: str) -> tuple[bool, int, str]:
    """The order of scenes: simulated ones last, then as the sweep has them."""
    order = configs.sweep(ALL_SCENES)["scene"]
    simulated = configs.scene_display(scene)["kind"] == SIMULATED
    return simulated, order.index(scene) if scene in order else len(order), scene


def _of_hdc(runs: pd.DataFrame) -> dict[str, pd.DataFrame]:
    """The runs of HDC on all samples and pixels of each scene."""
    found = by_scene(whole(runs[runs.model == "hdc"]))
    return {scene: found[scene] for scene in sorted(found, key=by_place)}


def answers_of(runs: pd.DataFrame) -> Iterator[np.ndarray]:
    """True and predicted classes of the test samples of all seeds."""
    for texts in (runs.labels, runs.predicted):
        yield np.concatenate(list(map(unpack_labels, texts)))


def confusion(runs: pd.DataFrame) -> pd.DataFrame:
    """Shares of the true class, a row per true and predicted class, all seeds together."""
    classes = json.loads(runs.classes.iloc[0])
    every = range(len(classes))
    shares = pd.crosstab(*answers_of(runs), normalize="index")
    shares = shares.reindex(index=every, columns=every, fill_value=0.0)
    named = (
        shares.set_axis(classes).set_axis(classes, axis="columns").rename_axis("true")
    )
    names = {"var_name": "predicted", "value_name": "share"}
    return named.melt(ignore_index=False, **names).reset_index()


def confusions(runs: pd.DataFrame) -> pd.DataFrame | None:
    """The shares of each scene of few classes of which some are confused."""
    parts = []
    for scene, of_scene in _of_hdc(runs).items():
        accuracy = float((of_scene.right / of_scene.n_test).mean())
        if accuracy < 1 and of_scene.n_classes.iloc[0] <= PRINTED:
            about = {"scene": scene, "split": split_of(of_scene), "accuracy": accuracy}
            about |= {"origin": of_scene.origin.iloc[0], "seeds": len(of_scene)}
            parts.append(confusion(of_scene).assign(**about))
    return pd.concat(parts) if parts else None


def draw_confusions(figure: Canvas, data: pd.DataFrame) -> None:
    """A panel per scene."""
    scenes = by_scene(data)
    down = -(-len(scenes) // 2)
    figure.set_size_inches(4.2, 1.1 + 1.95 * down)
    figure.set_layout_engine("constrained", h_pad=0.1)  # titles have several lines
    for k, (scene, shares) in enumerate(scenes.items()):
        axes = figure.add_subplot(down, 2, k + 1)
        _draw_confusion(axes, shares).remove()
        axes.set(xlabel="predicted", ylabel="true")
        axes.tick_params(axis="x", rotation=90)
        of_paper = configs.scene_display(scene)["figure"]
        name = ", ".join(filter(None, [scene_name(scene), of_paper]))
        first = shares.iloc[0]
        accuracy = f"accuracy {100 * first.accuracy:.1f} %"
        title = f"{wrapped(name, 22)}\n{wrapped(first.split, 26)}\n{accuracy}"
        panel(axes, LETTERS[k], title)


def _draw_confusion(axes: Axes, shares: pd.DataFrame, gamma: float = 1) -> Colorbar:
    """Shares of each true class in percent; less than half a percent is left blank."""
    return matrix(axes, 100 * _square(shares), _whole, "Blues", (0, 100), gamma)


def _whole(share: float) -> str:
    return f"{share:.0f}" if share >= 0.5 else ""


def _square(rows: pd.DataFrame) -> pd.DataFrame:
    """The matrix of the shares of true (down) and predicted classes, in the order of the rows."""
    names: list[str] = list(rows.true.unique())
    return rows.pivot(index="true", columns="predicted", values="share").loc[
        names, names
    ]


# Fig. 7 -------------------------------------------------------------------------------------------


def spatial(frame: pd.DataFrame) -> pd.DataFrame | None:
    """Positions along a line: shares of confused ones, errors in millimetres, correlations.

    Returns:
        DataFrame: ``what`` (``confusion``, ``correlation``, ``error_mm``: the mean error at a true
        position, or ``error``: mean, median and 95th percentile), ``true``, ``predicted`` and
        ``share``.
    """
    runs = _of_hdc(of_experiment(frame, RUNS)).get(SPATIAL)
    if runs is None:
        return None
    first = runs.iloc[0]
    start, stop = (
        json.loads(first[f"scene.classes.{end}"]) for end in ("start", "stop")
    )
    length = 1e3 * np.linalg.norm(np.subtract(stop, start))
    at = np.linspace(0, length, int(first["scene.classes.number"]))
    truth, found = (at[classes] for classes in answers_of(runs))
    error = pd.Series(np.abs(found - truth), pd.Index(truth, name="true"), name="share")
    whole = error.agg(["mean", "median"]).rename_axis("true")
    whole["95th percentile"] = error.quantile(0.95)
    by_position = error.groupby(level=0).mean()
    parts = [
        confusion(runs).assign(what="confusion"),
        by_position.reset_index().assign(what="error_mm"),
        whole.reset_index().assign(what="error"),
    ]
    correlations = of_experiment(frame, "correlation")
    if len(correlations):  # prototypes (true) with held-out hypervectors (predicted)
        here = correlations[correlations.scene == SPATIAL]
        mean = mean_matrix(here, "prototype", "held-out").assign(what="correlation")
        parts.append(
            mean.set_axis(["true", "predicted", "share", "what"], axis="columns")
        )
    about = {"scene": SPATIAL, "split": split_of(runs), "seeds": len(runs)}
    return pd.concat(parts).assign(**about)


def draw_spatial(figure: Canvas, data: pd.DataFrame) -> None:
    """Fig. 7 and the error in millimetres."""
    grid = figure.add_gridspec(2, 2, height_ratios=(1.4, 1))
    left, right = (figure.add_subplot(grid[0, k]) for k in (0, 1))
    below = figure.add_subplot(grid[1, :])
    correlations = data[data.what == "correlation"]
    if len(correlations):
        matrix(left, _square(correlations), str)
        left.set(xlabel="hypervectors at (mm)", ylabel="prototype at (mm)")
        panel(left, "a", "correlation $C^p$, held out")
    else:
        left.set_axis_off()
        panel(left, "a", "no measurement")
    # A colour has to show one of 100 test samples.
    bar = _draw_confusion(right, data[data.what == "confusion"], gamma=0.4)
    bar.set_ticks([0, 5, 20, 50, 100])
    right.set(xlabel="predicted (mm)", ylabel="true position (mm)")
    panel(right, "b", "confusion (%)")
    errors = data[data.what == "error_mm"]
    places = errors.true.astype(float)
    below.plot(places, errors.share, color="#0072B2", marker="o", ms=2)
    below.set(xlabel="true position (mm)", ylabel="mean |error| (mm)")
    below.set_ylim(0, None)
    whole = data[data.what == "error"].set_index("true").share
    texts = [f"{name} {value:.3g} mm" for name, value in whole.items()]
    panel(below, "c", ", ".join(texts))


FIGURES = [
    Figure(
        "confusions",
        Table("confusions", confusions, of=RUNS, commands=[f"{RUN}all_scenes"]),
        draw_confusions,
        title="Confusion by HDC as published, % of the true label",
        details=lambda data: (
            f"{about(data.drop(columns='split'))}; the split stands above each panel"
        ),
        caption="Confusion of the classes by HDC, in percent of the true label (rows), test "
        "samples of all seeds together (Figs. 6(b) and 9(d)). Cells below 0.5 % "
        "are blank. Data sets without errors are left out.",
    ),
    Figure(
        "fig7_spatial",
        Table(
            "fig7_spatial",
            spatial,
            of=(RUNS, "correlation"),
            commands=[f"{RUN}all_scenes", SPATIAL_CORRELATION],
        ),
        draw_spatial,
        title="HDC: 51 positions, 1 mm apart (Fig. 7)",
        details=lambda data: about(data).partition(", ")[
            2
        ],  # the title names the scene
        caption="51 positions: correlations, confusion and error in millimetres (Fig. 7).",
        size=(3.4, 3.9),
    ),
]
