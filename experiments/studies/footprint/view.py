"""Time, memory and modules of each scene and model, and what it saves to leave out the rest."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pandas as pd

from experiments.reporting.columns import Column, scene_name
from experiments.reporting.plot import legend_below
from experiments.reporting.study import Figure, Study
from experiments.reporting.table import Table
from experiments.reporting.text import size
from experiments.studies.footprint.probe import WATCHED

if TYPE_CHECKING:
    from matplotlib.figure import Figure as Canvas


def _bytes(value: float) -> str:
    return size(int(value))


COLUMNS = {
    "first_prediction_s": Column("First prediction, s", of_machine=True),
    "every_s": Column("with every module, s", of_machine=True),
    "peak_bytes": Column("Peak memory", _bytes, of_machine=True),
    "every_bytes": Column("with every module", _bytes, of_machine=True),
    "loaded": Column("Loaded of those watched", note=f"Watched: {', '.join(WATCHED)}."),
}


NAMES = [
    *("scene", "model", "n", "torch_s", "first_prediction_s", "peak_bytes", "status"),
    *("origin", "loaded", "every_s", "every_bytes"),
]


def footprint(frame: pd.DataFrame) -> pd.DataFrame:
    """A row per scene and model."""
    return frame.reindex(columns=NAMES)


def draw(figure: Canvas, data: pd.DataFrame) -> None:
    """A row per scene: memory and time of HDC with every module, and with those that it needs."""
    of_hdc = data[(data.model == "hdc") & data.loaded.notna()]
    names = of_hdc.scene.map(scene_name)
    left, right = figure.subplots(1, 2, sharey=True)
    for axes, needed, every, label, unit in (
        (left, "peak_bytes", "every_bytes", "peak memory (MB)", 1e6),
        (right, "first_prediction_s", "every_s", "first prediction (s)", 1),
    ):
        own, whole = of_hdc[needed] / unit, of_hdc[every] / unit
        bars = axes.barh(names, whole, color="0.85", label="every module")
        axes.bar_label(bars, [f" −{saved:.3g}" for saved in whole - own], fontsize=6)
        axes.barh(names, own, 0.5, color="#0072B2", label="modules that it needs")
        axes.set_xlabel(label)
        axes.margins(x=0.2)
    left.invert_yaxis()
    legend_below(figure, left.containers)


FOOTPRINT = Table(
    "footprint",
    footprint,
    of="footprint",
    title="Footprint of each scene and model. {machine}",
    shown=("scene", "model", *COLUMNS, "status"),
    columns=COLUMNS,
    note="Each row is a process of its own: it builds the scene and the model, makes ten frames, "
    "learns them and predicts one. Another process loads every watched module first. A module that "
    "is loaded and that neither the scene nor the model needs is a failure.",
)
STUDY = Study(
    "footprint",
    "Footprint",
    "How much memory and time does each scene and model take, and is what it does not need left "
    "out?",
    order=13,
    tables=[FOOTPRINT],
    figures=[
        Figure(
            "footprint",
            FOOTPRINT,
            draw,
            caption="Peak memory of a process that learns ten frames of a scene with HDC, and its "
            "time to the first prediction. Two processes: one loads the modules that it "
            "needs, the other every module that some part of the project needs.",
            size=(3.4, 2.4),
        )
    ],
)
