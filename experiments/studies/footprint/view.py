"""Time and memory of each scene and model, and the cost of each package that it loads."""

from __future__ import annotations

import pandas as pd

from experiments.reporting.columns import Column
from experiments.reporting.study import Study
from experiments.reporting.table import Table
from experiments.reporting.text import size

CASE = ["scene", "model", "n", "status", "origin"]
MEASURED = ["first_prediction_s", "peak_bytes"]
OF_PACKAGE = ["modules", "package_s", "package_bytes"]


def _bytes(value: float) -> str:
    return size(int(value))


COLUMNS = {
    "first_prediction_s": Column("First prediction, s", of_machine=True),
    "peak_bytes": Column("Peak memory", _bytes, of_machine=True),
    "package_s": Column("Time to import, s", of_machine=True),
    "package_bytes": Column("Memory", _bytes, of_machine=True),
}


def footprint(frame: pd.DataFrame) -> pd.DataFrame:
    """A row per scene and model: medians over the repetitions, and the least and the most."""
    once = frame.drop_duplicates([*CASE, *MEASURED])
    by_case = once.groupby(CASE, sort=False, dropna=False)[MEASURED]
    found = by_case.agg(["median", "min", "max"])
    ends = {"median": "", "min": "_low", "max": "_high"}
    found.columns = [f"{name}{ends[end]}" for name, end in found.columns]
    return found.reset_index()[[*CASE[:3], *found.columns, *CASE[3:]]]


def packages(frame: pd.DataFrame) -> pd.DataFrame:
    """A row per scene, model and package: medians over the repetitions, the largest first."""
    found = frame.groupby(["scene", "model", "package"])[OF_PACKAGE].median()
    by_size = {"ascending": [True, True, False], "kind": "stable"}
    return found.reset_index().sort_values(
        ["scene", "model", "package_bytes"], **by_size
    )


FOOTPRINT = Table(
    "footprint",
    footprint,
    of="footprint",
    title="Footprint of each scene and model. {machine}",
    shown=("scene", "model", *MEASURED, "status"),
    columns=COLUMNS,
    note="Each row is a process of its own: it imports what it needs, builds the scene and the "
    "model, makes ten frames, learns them and predicts one; median and range of the repetitions. A "
    "package that is loaded and that neither the scene nor the model needs is a failure.",
)
PACKAGES = Table(
    "footprint_packages",
    packages,
    of="footprint",
    title="Cost of each package that a scene and a model load. {machine}",
    columns=COLUMNS,
    note="Time and memory of importing a package, without what it imports of others; median of "
    "the repetitions. “python” is the standard library.",
)
STUDY = Study(
    "footprint",
    "Footprint",
    "How much memory and time does each scene and model take, and is what it does not need left "
    "out?",
    order=13,
    tables=[FOOTPRINT, PACKAGES],
)
