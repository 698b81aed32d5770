"""Errors of predicted values, and coverage of intervals, label sets and rejection."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pandas as pd

from experiments.records.results import Results
from experiments.reporting.columns import Column, scene_name
from experiments.reporting.measured import ENDS, over_units, place_of, saturated
from experiments.reporting.study import RUN
from experiments.reporting.text import number, percent
from experiments.studies.promises.study import STUDY

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
    results: Results, name: str
) -> Iterator[tuple[dict[str, str], pd.DataFrame]]:
    """Scene and answer of each measurement, and its rows."""
    every = [m for m in results.measurements if m.record.name == name]
    for measurement in sorted(
        every, key=lambda m: (place_of(m.record.scene), m.record.scene)
    ):
        rows = measurement.frame
        answer = "labels" if name == "coverage" else f"{rows.value[0]}, {rows.unit[0]}"
        note = ", saturated" if saturated(measurement) else ""
        yield (
            {"recording": f"{measurement.record.scene}{note}", "answer": answer},
            rows,
        )


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


def shown(lines: list[dict], results: Results, *names: str) -> pd.DataFrame | None:
    """Rows of a table, and the commands that make them; None without any."""
    if not lines:
        return None
    data = pd.DataFrame(lines)
    plain = [str(name) for name in data if not str(name).endswith(ENDS[1:])]
    own = [name for name in plain if name not in COLUMNS]  # a model of the user's
    data.attrs["shown"] = [*(name for name in COLUMNS if name in data), *own]
    every = [m for m in results.measurements if m.record.name in names]
    data.attrs["commands"] = sorted(
        f"{RUN}{m.record.name} scene={m.record.scene}" for m in every
    )
    return data


@STUDY.table(
    "values",
    title="Mean absolute error of predicted values",
    key=("recording", "answer", "split", "n"),
    columns=COLUMNS,
    note="A prototype of a bin stands for the mean of the bin's training frames; ridge regression "
    f"has the penalty of the least leave-one-out error. {NOTE}",
)
def errors(results: Results) -> pd.DataFrame | None:
    """A row for each scene, split and number of training frames."""
    lines = []
    for about, rows in measured(results, "values"):
        for (split, n), part in rows.groupby(["split", "n"], sort=False):
            line = {**about, "split": split, "n": n}
            for model, of in part.groupby("model"):
                line |= means(of, "error", str(model))
            lines.append(line)
    return shown(lines, results, "values")


@STUDY.table(
    "coverage",
    title="How often intervals, label sets and rejection hold",
    columns=COLUMNS | {"n": Column("Training frames, of a class for labels")},
    note="Labels: HDCClassifier.predict_set; a frame whose set is empty is refused. Values: the "
    "intervals of HDCRegressor, for which 1 − 2·alpha is proven and 1 − alpha stands in the "
    "column. Both are promised for frames that come as the training frames did, so for the "
    f"random split. {NOTE}",
)
def coverage(results: Results) -> pd.DataFrame | None:
    """A row for each scene, answer, split and promise, after the most frames there are."""
    lines = []
    for about, rows in measured(results, "coverage"):
        lines += [{**about, **line} for line in _promises(_after_most(rows))]
    for about, rows in measured(results, "values"):
        rows = _after_most(rows[rows.model == "regressor"])
        renamed = rows.rename(columns={"width": "size"})
        lines += [{**about, **line} for line in _promises(renamed)]
    return shown(lines, results, "coverage", "values")


def _after_most(rows: pd.DataFrame) -> pd.DataFrame:
    """The rows after the most frames of their split: another split may leave more to learn."""
    return rows[rows.n == rows.groupby("split")["n"].transform("max")]


def _promises(rows: pd.DataFrame) -> Iterator[dict[str, Any]]:
    """A row for each split and promise; none where nothing was promised."""
    if not len(rows):
        return
    columns = [column for column in PROMISED if column in rows]
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


@STUDY.table(
    "coverage_few",
    title="Label sets after few frames: how often they hold the right label",
    key=("recording", "n"),
    columns=COLUMNS | {"n": Column("Training frames of a class")},
    note="Random split, for which the promise is made. Asked for 80, 90 and 95 %: the share of "
    "sets with the right label, and beside it the mean number of labels of a set. By definition "
    "a class of one to three frames is in every set. Brackets: Student over sensors or input "
    "fields; of one camera, the central 95 % of draws, none of fewer than ten.",
)
def coverage_few(results: Results) -> pd.DataFrame | None:
    """A row for each scene and number of frames; None of records of one number."""
    lines = []
    for about, rows in measured(results, "coverage"):
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
    table = shown(lines, results, "coverage")
    if table is not None:
        table.attrs["columns"] = COLUMNS | _of_promises(table)
    return table


def _of_promises(table: pd.DataFrame) -> dict[str, Column]:
    """How the columns of each promise are shown, and of the number of frames."""
    found = {"n": Column("Training frames of a class")}
    for name in map(str, table):
        kind, _, asked = name.partition("_")
        if not asked.isdigit():
            continue
        if kind == "covered":
            found[name] = Column(f"Asked {asked} %: covered, %", percent)
        else:
            found[name] = Column(f"Labels of a set, {asked} %", number)
    return found
