"""Errors of predicted values, and coverage of intervals, label sets and rejection."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pandas as pd

from experiments.reporting.columns import Column, scene_name
from experiments.reporting.measured import ENDS, over_units, saturated, values_of
from experiments.reporting.table import Table
from experiments.reporting.text import number, percent

COLUMNS = {
    "recording": Column("Frames", scene_name),
    "answer": Column("Answer"),
    "split": Column(
        "Split", lambda split: "as recorded" if split == "counts" else split
    ),
    "n": Column("Training frames"),
    "mean": Column("Mean guess", number),
    "bins": Column("10 prototypes of bins", number),
    "nearest_neighbour": Column("Nearest on bits", number),
    "ridge_bits": Column("Ridge on bits", number),
    "ridge_greys": Column("Ridge on greys", number),
    "regressor": Column("HDCRegressor", number),
    "promised": Column("Promised, %", percent),
    "covered": Column("Covered, %", percent),
    "size": Column("Labels of a set, or width", number),
    "refused": Column("Known frames refused, %", percent),
    "unknown_refused": Column("Unknown frames refused, %", percent),
}
PROMISED = ("covered", "size", "refused", "unknown_refused")
SHARES = ("covered", "refused", "unknown_refused")
NOTE = (
    "As recorded: split by time, session or position. Brackets: Student over sensors or input "
    "fields; of one camera, the central 95 % of draws, none of fewer than ten. A saturated "
    "recording ranks nothing."
)


def measured(
    frame: pd.DataFrame, name: str
) -> Iterator[tuple[dict[str, str], pd.DataFrame]]:
    """Scene and answer of each measurement, and its rows."""
    of_name = frame[frame.experiment == name]
    for scene, rows in of_name.groupby("scene", sort=False):
        first = rows.iloc[0]
        answer = "labels" if name == "coverage" else f"{first.value}, {first.unit}"
        note = ", saturated" if saturated(rows) else ""
        yield {"recording": f"{scene}{note}", "answer": answer}, rows


def means(
    rows: pd.DataFrame,
    column: str,
    name: str,
) -> dict[str, float]:
    """Mean of a column with its interval: over seeds where there are several, else over draws."""
    several = rows.seed.nunique() > 1
    of = rows.groupby("seed" if several else "draw")[column].mean()
    units = of.astype(float).round(9)  # rounding errors are no errors
    value = over_units(units.tolist(), several)
    if column in SHARES:
        value = value.within(0, 1)
    return value.columns(name)


def shown(data: pd.DataFrame) -> list[str]:
    """The columns that a table shows: those known, then models of the user's."""
    own = [name for name in values_of(data) if name not in COLUMNS]
    return [*(name for name in COLUMNS if name in data), *own]


def errors(frame: pd.DataFrame) -> pd.DataFrame:
    """A row for each scene, split and number of training frames."""
    lines = []
    for about, rows in measured(frame, "values"):
        for (split, n), part in rows.groupby(["split", "n"], sort=False):
            line = {**about, "split": split, "n": n}
            for model, of in part.groupby("model"):
                line |= means(of, "error", str(model))
            lines.append(line)
    return pd.DataFrame(lines)


def coverage(frame: pd.DataFrame) -> pd.DataFrame:
    """A row for each scene, answer, split and promise, after the most frames there are."""
    lines = []
    for about, rows in measured(frame, "coverage"):
        lines += [{**about, **line} for line in _promises(_after_most(rows))]
    for about, rows in measured(frame, "values"):
        rows = _after_most(rows[rows.model == "regressor"])
        renamed = rows.drop(columns="size", errors="ignore")
        renamed = renamed.rename(columns={"width": "size"})
        lines += [{**about, **line} for line in _promises(renamed)]
    return pd.DataFrame(lines)


def _after_most(rows: pd.DataFrame) -> pd.DataFrame:
    """The rows after the most frames of their split: another split may leave more to learn."""
    return rows[rows.n == rows.groupby("split")["n"].transform("max")]


def _promises(rows: pd.DataFrame) -> Iterator[dict[str, Any]]:
    """A row for each split and promise; none where nothing was promised."""
    if not len(rows):
        return
    known = rows.dropna(axis=1, how="all")
    columns = [column for column in PROMISED if column in known]
    every = rows.explode(["alpha", *columns])
    for (split, alpha), part in every.groupby(["split", "alpha"], sort=False):
        line = {
            "split": split,
            "n": part.n.iloc[0],
            "promised": 1 - alpha,
        }
        for column in columns:
            if part[column].notna().all():
                line |= means(part, column, column)
        yield line


def coverage_few(frame: pd.DataFrame) -> pd.DataFrame:
    """A row for each scene and number of frames; None of records of one number."""
    lines = []
    for about, rows in measured(frame, "coverage"):
        if rows.n.nunique() < 2:
            continue
        for n, part in rows[rows.split == "random"].groupby("n"):
            line: dict[str, Any] = {"recording": about["recording"], "n": n}
            for promise in _promises(part):
                asked = f"{100 * promise['promised']:g}"
                for end in ENDS:
                    line[f"covered_{asked}{end}"] = promise[f"covered{end}"]
                line[f"size_{asked}"] = promise["size"]
            lines.append(line)
    return pd.DataFrame(lines)


def _of_few(table: pd.DataFrame) -> dict[str, Column]:
    """How the columns of each promise are shown, and of the number of frames."""
    found = {**COLUMNS, "n": Column("Training frames of a class")}
    for name in map(str, table):
        kind, _, asked = name.partition("_")
        if not asked.isdigit():
            continue
        if kind == "covered":
            found[name] = Column(f"Asked {asked} %: covered, %", percent)
        else:
            found[name] = Column(f"Labels of a set, {asked} %", number)
    return found


TABLES = [
    Table(
        "values",
        errors,
        of="values",
        title="Mean absolute error of predicted values",
        key=("recording", "answer", "split", "n"),
        columns=COLUMNS,
        note="A prototype of a bin stands for the mean of the bin's training frames; ridge "
        f"regression has the penalty of the least leave-one-out error. {NOTE}",
        shown=shown,
    ),
    Table(
        "coverage",
        coverage,
        of=("coverage", "values"),
        title="How often intervals, label sets and rejection hold",
        columns=COLUMNS | {"n": Column("Training frames, of a class for labels")},
        note="Labels: HDCClassifier.predict_set; a frame whose set is empty is refused. Values: "
        "the intervals of HDCRegressor, for which 1 − 2·alpha is proven and 1 − alpha stands in "
        "the column. Both are promised for frames that come as the training frames did, so for "
        f"the random split. {NOTE}",
        shown=shown,
    ),
    Table(
        "coverage_few",
        coverage_few,
        of="coverage",
        title="Label sets after few frames: how often they hold the right label",
        key=("recording", "n"),
        columns=_of_few,
        note="Random split, for which the promise is made. Asked for 80, 90 and 95 %: the share "
        "of sets with the right label, and beside it the mean number of labels of a set. By "
        "definition a class of one to three frames is in every set. Brackets: Student over "
        "sensors or input fields; of one camera, the central 95 % of draws, none of fewer than "
        "ten.",
        shown=shown,
    ),
]
