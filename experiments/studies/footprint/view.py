"""Time and memory of each scene and model, and what each package that it loads costs."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pandas as pd

from experiments.reporting.columns import Column, scene_name
from experiments.reporting.study import Figure, Study
from experiments.reporting.table import Table
from experiments.reporting.text import size

if TYPE_CHECKING:
    from matplotlib.figure import Figure as Canvas

CASE = ["scene", "model", "n", "status", "origin"]
MEASURED = ["first_prediction_s", "peak_bytes"]
OF_PACKAGE = ["modules", "package_s", "package_bytes"]


def _bytes(value: float) -> str:
    return size(int(value))


COLUMNS = {
    "first_prediction_s": Column("First prediction, s", of_machine=True),
    "peak_bytes": Column("Peak memory", _bytes, of_machine=True),
    "package": Column("Package"),
    "modules": Column("Modules"),
    "package_s": Column("Time to import, s", of_machine=True),
    "package_bytes": Column("Memory", _bytes, of_machine=True),
}


def footprint(frame: pd.DataFrame) -> pd.DataFrame:
    """A row per scene and model: medians over the repetitions, and the least and the most."""
    once = frame.drop_duplicates([*CASE, *MEASURED])
    by_case = once.groupby(CASE, sort=False, dropna=False)[MEASURED]
    parts = [by_case.median(), by_case.min(), by_case.max()]
    ends = ("", "_low", "_high")
    named = [part.add_suffix(end) for part, end in zip(parts, ends, strict=True)]
    joined = pd.concat(named, axis="columns")
    names = [f"{name}{end}" for name in MEASURED for end in ends]
    return joined[names].reset_index()[[*CASE[:3], *names, *CASE[3:]]]


def packages(frame: pd.DataFrame) -> pd.DataFrame | None:
    """A row per scene, model and package: medians over the repetitions, the largest first."""
    if "package" not in frame:
        return None  # of older code
    loaded = frame[frame.package.notna()]
    keys = ["scene", "model", "package"]
    found = loaded.groupby(keys, sort=False)[OF_PACKAGE].median().reset_index()
    cases = found.groupby(keys[:2], sort=False).ngroup()
    return found.assign(case=cases).sort_values(
        ["case", "package_bytes"], ascending=[True, False], kind="stable"
    )[[*keys, *OF_PACKAGE]]


def draw(figure: Canvas, data: pd.DataFrame) -> None:
    """A row per scene: memory and time of HDC."""
    of_hdc = data[(data.model == "hdc") & data.peak_bytes.notna()]
    names = of_hdc.scene.map(scene_name)
    left, right = figure.subplots(1, 2, sharey=True)
    for axes, name, label, unit in (
        (left, "peak_bytes", "peak memory (MB)", 1e6),
        (right, "first_prediction_s", "first prediction (s)", 1),
    ):
        median, low, high = (
            of_hdc[f"{name}{end}"] / unit for end in ("", "_low", "_high")
        )
        # Not below zero, where digits of a CSV are rounded.
        spread = [part.clip(lower=0) for part in (median - low, high - median)]
        axes.barh(names, median, 0.6, xerr=spread, color="#0072B2")
        axes.set_xlabel(label)
    left.invert_yaxis()


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
    title="What each package costs that a scene and a model load. {machine}",
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
    figures=[
        Figure(
            "footprint",
            FOOTPRINT,
            draw,
            caption="Peak memory of a process that learns ten frames of a scene with HDC, and its "
            "time to the first prediction.",
            size=(3.4, 2.4),
        )
    ],
)
