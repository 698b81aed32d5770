"""Which classes HDC confuses (Figs. 6(b), 7(b) and 9(d))."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from experiments.records import configs
from experiments.records.results import RUNS, by_scene
from experiments.records.rows import unpack_labels
from experiments.reporting.columns import scene_name
from experiments.reporting.facets import matrix
from experiments.reporting.plot import LETTERS, panel, wrapped
from experiments.reporting.study import RUN, Figure, about
from experiments.reporting.table import Table
from experiments.reporting.text import SIMULATED
from experiments.reporting.trained import split_of, whole

if TYPE_CHECKING:
    from matplotlib.figure import Figure as Canvas

ALL_SCENES = "all_scenes"


def by_place(scene: str) -> tuple[bool, int, str]:
    """The order of scenes: simulated ones last, then as the sweep has them."""
    order = configs.sweep(ALL_SCENES)["scene"]
    simulated = configs.scene_display(scene)["kind"] == SIMULATED
    return simulated, order.index(scene) if scene in order else len(order), scene


def _of_hdc(runs: pd.DataFrame) -> dict[str, pd.DataFrame]:
    """The runs of HDC on all samples and pixels of each scene."""
    found = by_scene(whole(runs[runs.model == "hdc"]))
    return {scene: found[scene] for scene in sorted(found, key=by_place)}


def confusion(runs: pd.DataFrame) -> pd.DataFrame:
    """Shares of the true class that are not zero: ``true``, ``predicted``, ``share``; all seeds
    together, in the order of the classes."""
    names = dict(enumerate(json.loads(runs.classes.iloc[0])))
    truth, found = (
        np.concatenate(list(map(unpack_labels, texts)))
        for texts in (runs.labels, runs.predicted)
    )
    shares = pd.crosstab(truth, found, normalize="index").stack()
    shares = shares[shares > 0].rename_axis(["true", "predicted"])
    shares = shares.rename("share").reset_index()
    shares[["true", "predicted"]] = shares[["true", "predicted"]].replace(names)
    return shares


def confusions(runs: pd.DataFrame) -> pd.DataFrame | None:
    """The shares of each scene of which some classes are confused."""
    parts = []
    for scene, of_scene in _of_hdc(runs).items():
        accuracy = float((of_scene.right / of_scene.n_test).mean())
        if accuracy < 1:
            about = {"scene": scene, "split": split_of(of_scene), "accuracy": accuracy}
            about |= {"origin": of_scene.origin.iloc[0], "seeds": len(of_scene)}
            parts.append(confusion(of_scene).assign(**about))
    return pd.concat(parts) if parts else None


def draw_confusions(figure: Canvas, data: pd.DataFrame) -> None:
    """A panel per scene."""
    from matplotlib.colors import PowerNorm

    scenes = by_scene(data)
    down = -(-len(scenes) // 2)
    figure.set_size_inches(4.2, 1.1 + 1.95 * down)
    figure.set_layout_engine("constrained", h_pad=0.1)  # titles have several lines
    for k, (scene, shares) in enumerate(scenes.items()):
        axes = figure.add_subplot(down, 2, k + 1)
        names = pd.unique(pd.concat([shares.true, shares.predicted]))
        square = shares.pivot(index="true", columns="predicted", values="share")
        percents = 100 * square.reindex(index=names, columns=names).fillna(0)
        # A colour has to show one of 100 test samples.
        look = {"cmap": "Blues", "norm": PowerNorm(0.4, 0, 100)}
        matrix(axes, percents, _whole, **look)
        axes.set(xlabel="predicted", ylabel="true")
        axes.tick_params(axis="x", rotation=90)
        of_paper = configs.scene_display(scene)["figure"]
        name = ", ".join(filter(None, [scene_name(scene), of_paper]))
        first = shares.iloc[0]
        accuracy = f"accuracy {100 * first.accuracy:.1f} %"
        title = f"{wrapped(name, 22)}\n{wrapped(first.split, 26)}\n{accuracy}"
        panel(axes, LETTERS[k], title)


def _whole(share: float) -> str:
    """Less than half a percent is left blank."""
    return f"{share:.0f}" if share >= 0.5 else ""


FIGURE = Figure(
    "confusions",
    Table("confusions", confusions, of=RUNS, commands=[f"{RUN}all_scenes"]),
    draw_confusions,
    title="Confusion by HDC as published, % of the true label",
    details=lambda data: (
        f"{about(data.drop(columns='split'))}; the split stands above each panel"
    ),
    caption="Confusion of the classes by HDC, in percent of the true label (rows), test "
    "samples of all seeds together (Figs. 6(b), 7(b) and 9(d)). Cells below 0.5 % "
    "are blank. Data sets without errors are left out.",
)
