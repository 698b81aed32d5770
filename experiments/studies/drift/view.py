"""Drift and recalibration (Fig. 8(b)): accuracy regained in the new session, kept in the old.

``numbers`` makes accuracies of the lines, which rules 4 read as well; ``figures`` draws more than
one table.
"""

from __future__ import annotations

from collections.abc import Iterator

import pandas as pd

from experiments.reporting import estimates
from experiments.reporting.columns import Column
from experiments.reporting.study import Figure, Quantity, Study, about
from experiments.reporting.table import Table
from experiments.reporting.text import percent
from experiments.studies.drift import figures, numbers
from experiments.studies.drift.numbers import N_NEW, accuracies

PAPERS = (0.5, 0.75)  # its p


def quantities(lines: pd.DataFrame) -> Iterator[Quantity]:
    """Fig. 8(b): accuracy of HDC in the new session before and after an update with N_new = 50, the
    mean of p = 0.5 and 0.75, for which the paper has one number."""
    n_test = int(lines.n_test_new.iloc[0])
    of_hdc = accuracies(lines[lines.model == "hdc"])
    after = of_hdc[of_hdc.n_new == N_NEW]
    found = {
        "stored": of_hdc[of_hdc.method == "stored"],
        "recovered": after[after.p.isin(PAPERS)],
    }
    for name, updates in found.items():
        values = updates.groupby("seed").new.mean().tolist()
        if values:
            least = estimates.least_variance(values, n_test)
            yield Quantity(
                f"drift/{name}_accuracy",
                estimates.one_sensor(values, least).within(0, 1),
                n=n_test * len(values),
                seeds=len(values),
                note="new samples first in time" if name == "recovered" else "",
            )


COLUMNS = {
    "n_new": Column("New frames"),
    "before": Column("Before the drift, %", percent),
    "stored": Column("Not updated, %", percent),
    "updated": Column("New session, %", percent),
    "old": Column("Old session, %", percent),
}
INTERVALS = "Intervals: Student, 95 %, over seeds."
SPLIT = "new session split by time"
STUDY = Study(
    "drift",
    "Drift and recalibration",
    "How many new samples, with or without labels, restore the accuracy after drift? How much "
    "is forgotten of the old session, and do its samples still help?",
    5,
    tables=[
        Table(
            "drift",
            numbers.regained,
            of="drift",
            key=("scene", "model", "update", "n_new"),
            title="Every update of every model, with labels and without",
            columns=COLUMNS,
            shown=("scene", "model", "update", "n_new", "updated", "old"),
            note="New samples come before those tested. New samples alone are the paper's p = 1 "
            "for HDC. Equal weights: a new sample counts N_old/N_new times. At the old weights: "
            "the penalty is on the distance from them. Re-referenced, without labels: every frame "
            "is standardised and a reference frame is subtracted, before the drift the mean of "
            "the training frames, afterwards the mean of unlabelled new frames that come before "
            f"those tested. {INTERVALS}",
        ),
        Table(
            "drift_regained",
            numbers.best_updates,
            of="drift",
            key=("scene", "model", "labels"),
            title="Cost of the drift, and the best update of every model",
            columns=COLUMNS,
            shown=(
                *("scene", "model", "update", "n_new"),
                *("before", "stored", "updated"),
            ),
            note="Best: the highest mean on the test frames, which favours it, with at most "
            f"{N_NEW} labelled frames; or without labels (re-referenced), with all classes alike. "
            f"New frames come before those tested. {INTERVALS}",
        ),
    ],
    figures=[
        Figure(
            "fig8_drift",
            Table("fig8_drift", numbers.recalibrated, of="drift"),
            figures.draw_recalibrated,
            title="Recalibration with labels",
            details=lambda data: f"{about(data)}, {SPLIT}",
            caption="Recalibration with labelled samples of the new session, which come before "
            "those tested (Fig. 8(b)), HDC with a share p of its bits replaced; p = 1: new samples "
            "alone. (a): accuracy in the new session; dashed: not updated; stars: the paper, not "
            "updated and with p = 0.5 or 0.75. (b): in the old session; dashed: before the drift. "
            "(c): in the new session, the best update of each model on these test frames after "
            f"{N_NEW} samples, which favours it. Error bars: 95 % intervals over seeds.",
            size=(7.0, 3.2),
        ),
        Figure(
            "drift_unlabelled",
            Table("drift_unlabelled", numbers.unlabelled, of="drift"),
            figures.draw_unlabelled,
            title="Re-referencing without labels, by data set",
            details=f"{SPLIT}; dashed: chance; error bars: 95 % intervals over seeds",
            caption="Accuracy in the new session, re-referenced without labels, and after training "
            f"anew on {N_NEW} labelled frames. New frames come before those tested.",
        ),
    ],
    numbers={"drift": quantities},
)
