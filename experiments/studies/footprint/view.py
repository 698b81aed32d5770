"""Time, memory and modules of each scene and model, and what it saves to leave out the rest."""

from __future__ import annotations

import pandas as pd
from matplotlib.figure import Figure

from experiments.records.results import own_columns
from experiments.reporting.columns import Column, scene_name
from experiments.reporting.study import Plot, Study
from experiments.reporting.table import Table
from experiments.reporting.text import size
from experiments.studies.footprint.probe import WATCHED

COLUMNS = {
    "first_prediction_s": Column("First prediction, s"),
    "every_s": Column("with every module, s"),
    "peak_bytes": Column("Peak memory", lambda value: size(int(value))),
    "every_bytes": Column("with every module", lambda value: size(int(value))),
    "loaded": Column("Loaded of those watched", note=f"Watched: {', '.join(WATCHED)}."),
}


def picture(figure: Figure, rows: pd.DataFrame) -> None:
    """A row per scene: memory and time with every module, and with those that it needs."""
    of_hdc = ran(rows)
    places = range(len(of_hdc))
    panels = figure.subplots(1, 2, sharey=True)
    for axes, own, every, label, unit in (
        (panels[0], "peak_bytes", "every_bytes", "peak memory (MB)", 1e6),
        (panels[1], "first_prediction_s", "every_s", "first prediction (s)", 1),
    ):
        needed = of_hdc[own] / unit
        if every in of_hdc:
            whole = of_hdc[every] / unit
            axes.barh(places, whole, color="0.85", label="every module")
            for place, most, saved in zip(places, whole, whole - needed, strict=True):
                axes.text(most, place, f" −{saved:.3g}", va="center", fontsize=6)
        axes.barh(places, needed, 0.5, color="#0072B2", label="modules that it needs")
        axes.set(xlabel=label, ylim=(len(of_hdc) - 0.4, -0.6))
        axes.margins(x=0.2)
    panels[0].set_yticks(places, [scene_name(name) for name in of_hdc.scene])
    handles, labels = panels[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=2)


def ran(rows: pd.DataFrame) -> pd.DataFrame:
    """The processes of HDC whose scene had its data."""
    return rows[(rows.model == "hdc") & rows.loaded.notna()]


STUDY = Study(
    "footprint",
    "Footprint",
    "How much memory and time does each scene and model take, and is what it does not need left "
    "out?",
    order=13,
    tables=[
        Table(
            "footprint",
            own_columns,
            of="footprint",
            title="Footprint of each scene and model. {machine}",
            shown=("scene", "model", *COLUMNS, "status"),
            columns=COLUMNS,
            note="Each row is a process of its own: it builds the scene and the model, makes ten "
            "frames, learns them and predicts one. Another process loads every watched module "
            "first. A module that is loaded and that neither the scene nor the model needs is a "
            "failure.",
        ),
    ],
    figures=[
        Plot(
            "footprint",
            picture,
            of="footprint",
            size=(3.4, 2.4),
            caption="Peak memory of a process that learns ten frames of a scene with HDC, and its "
            "time to the first prediction. Two processes: one loads the modules that it "
            "needs, the other every module that some part of the project needs.",
            needs=lambda rows: bool(len(ran(rows))),
        )
    ],
)
