"""Drift and recalibration (Fig. 8(b)): accuracy regained in the new session, kept in the old."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from typing import Any

import pandas as pd
from matplotlib.figure import Figure

from experiments.records.results import by_scene
from experiments.records.rows import unpack_labels
from experiments.reporting import estimates, published
from experiments.reporting.columns import Column, scene_name
from experiments.reporting.measured import each_scene
from experiments.reporting.plot import literal
from experiments.reporting.study import Numbers, Plot, Quantity, Study
from experiments.reporting.table import Table
from experiments.reporting.text import kind_of, percent, points
from experiments.studies.drift import figures
from experiments.studies.drift.numbers import (
    N_NEW,
    UNLABELLED,
    best_updates,
    regained,
)
from experiments.studies.drift.sessions import accuracies

PAPERS = (0.5, 0.75)  # its p


def best(rows: pd.DataFrame) -> pd.DataFrame:
    """A row per model of a scene, with labels and without."""
    return best_updates(regained(rows))


def fig8(figure: Figure, rows: pd.DataFrame) -> None:
    """Every update of HDC by the paper, and the best of each model, on the paper's scene."""
    rows = paper_scene(rows)
    figures.recalibrations(figure, regained(rows), _called(rows))
    if set(rows.origin) == {"simulated"}:
        numbers = published.numbers()
        names = ("stored", "recovered")
        values = [numbers[f"drift/{name}_accuracy"].value for name in names]
        figures.of_paper(figure.axes[0], values)


def paper_scene(rows: pd.DataFrame) -> pd.DataFrame:
    """The rows on the experiment's own scene, which is the paper's; of the first one without."""
    own = rows[~rows.elsewhere.astype(bool)]
    return own if len(own) else rows[rows.scene == rows.scene.iloc[0]]


def unlabelled(figure: Figure, rows: pd.DataFrame) -> None:
    """A panel per scene, a row per model, a marker per update."""
    panels = {}
    for of_scene in by_scene(rows).values():
        found = regained(of_scene)
        without = found[~found.labels].model.unique()
        labels = unpack_labels(of_scene.labels.dropna().iloc[0])
        chance = 100 / len(set(labels.tolist()))
        shown = found[found.model.isin(without)]
        if len(shown):
            panels[_called(of_scene)] = shown, chance
    figures.without_labels(figure, panels)


def _called(rows: pd.DataFrame) -> str:
    """The name of their scene, and of what kind its frames are."""
    first = rows.iloc[0]
    return literal(f"{scene_name(first.scene)}, {kind_of(first.origin)}")


def quantities(
    rows: pd.DataFrame,
) -> Iterator[Quantity]:
    """Fig. 8(b): accuracy of HDC in the new session before and after an update with N_new = 50, the
    mean of p = 0.5 and 0.75, for which the paper has one number."""
    n_test = int(rows.n_test_new.iloc[0])
    by_seed = accuracies(rows[rows.model == "hdc"])
    after = by_seed[by_seed.n_new == N_NEW]
    found = {
        "stored": by_seed[by_seed.method == "stored"],
        "recovered": after[after.p.isin(PAPERS)],
    }
    for name, updates in found.items():
        values = updates.groupby("seed").new.mean().tolist()
        if values:
            least = estimates.least_variance(values, n_test)
            yield Quantity.of(
                f"drift/{name}_accuracy",
                estimates.one_sensor(values, least).within(0, 1),
                estimates.ONE_SENSOR,
                100,
                n=n_test * len(values),
                seeds=len(values),
                note="new samples first in time" if name == "recovered" else "",
            )


COLUMNS: dict[str, Any] = {
    "scene": Column("Scene", scene_name),
    "update": Column("Update"),
    "n_new": Column("New frames"),
    "before": Column("Before the drift, %", percent),
    "stored": Column("Not updated, %", percent),
    "updated": Column("New session, %", percent),
    "old": Column("Old session, %", percent),
    "lost": Column("Lost, points", points),
    "regained": Column("Regained, %", percent),
}
_REGAINED = "Regained: gain relative to loss, a ratio of means."
_INTERVALS = "Intervals: Student, 95 %, over seeds."
STUDY = Study(
    "drift",
    "Drift and recalibration",
    "How many new samples, with or without labels, restore the accuracy after drift? How much "
    "is forgotten of the old session, and do its samples still help?",
    5,
    tables=[
        Table(
            "drift",
            partial(each_scene, regained),
            of="drift",
            key=("scene", "model", "update", "n_new"),
            title="Every update of every model, with labels and without",
            columns=COLUMNS,
            shown=("scene", "model", "update", "n_new", "updated", "old", "regained"),
            note="New samples come before those tested. New samples alone are the paper's p = 1 "
            "for HDC. Equal votes: a new sample counts N_old/N_new times. From the old weights: "
            "the penalty is on the distance from them. Re-referenced, without labels: every frame "
            "is standardised and a reference frame is subtracted, before the drift the mean of "
            "the training frames, afterwards the mean of unlabelled new frames that come before "
            "those tested; or both times the "
            f"mean of frames without touch. {_REGAINED} {_INTERVALS}",
        ),
        Table(
            "drift_regained",
            partial(each_scene, best),
            of="drift",
            key=("scene", "model", "labels"),
            title="Cost of the drift, and the best update of every model",
            columns=COLUMNS,
            shown=(
                *("scene", "model", "update", "n_new"),
                *("before", "stored", "updated", "regained"),
            ),
            note="Best: the highest mean on the test frames, which favours it, with at most "
            f"{N_NEW} labelled frames; or without labels (re-referenced), with all classes alike "
            f"or no touch. New frames come before those tested. {_REGAINED} {_INTERVALS}",
        ),
    ],
    figures=[
        Plot(
            "fig8_drift",
            fig8,
            of="drift",
            size=(7.0, 2.6),
            caption="Recalibration with labelled samples of the new session (Fig. 8(b)), HDC with "
            "a share p of its bits replaced. (a): accuracy in the new session. (b): in "
            "the old one. (c): in the new session, the best update of each model on these "
            f"test frames after {N_NEW} samples, which favours it. Bars: 95 % over seeds.",
        ),
        Plot(
            "drift_unlabelled",
            unlabelled,
            of="drift",
            needs=lambda rows: bool(rows.method.isin(UNLABELLED).any()),
            caption="Accuracy in the new session, re-referenced without labels by "
            f"{figures.N_UNLABELLED} frames, and after training on {N_NEW} labelled frames alone. "
            "Bars: 95 % over seeds.",
        ),
    ],
    numbers=[Numbers(quantities, of="drift")],
)
