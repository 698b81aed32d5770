"""Every published number beside ours: one row for each line of published.csv.

How they are judged stands in :data:`HOW`, below the table.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import partial
from typing import Any

import pandas as pd

from experiments.reporting import published
from experiments.reporting.columns import Column
from experiments.reporting.published import Published
from experiments.reporting.study import RUN, Quantity
from experiments.reporting.table import Table, frame
from experiments.reporting.text import interval, number

NAME, TITLE = "comparison", "Published numbers and ours"
HOW = (
    "The paper has one sensor. A number of it is judged by the interval in which the "
    "number of one more sensor of ours lies with 95 %: Student's, over sensors. A ratio "
    "of times has the interval of its median over repetitions instead. A number differs "
    "if it is outside and further off than the margin; it is uninformative if the "
    "interval reaches further than the margin. The margin, stated before, is half of the "
    "smallest difference from which the paper draws a conclusion; for ratios of times it "
    "is a factor of 2, for numbers of samples a half. Not comparable: seconds of another "
    "machine, and what depends on what the paper does not say. Fitted: it chose a "
    "parameter of the simulated sensor; watched: known during the calibration, and chose "
    "none. n: of test samples (of training accuracies: training samples; of times: runs), "
    "all seeds together."
)
COLUMNS = (
    *("experiment", "quantity", "condition", "unit", "published", "published_low"),
    *("published_high", "measured", "low", "high", "margin", "n", "seeds", "verdict"),
    *("made_by", "note"),
)
_SETTINGS = ("table1/learning_rate", "touch/labels")
# What makes an experiment of published.csv where that is not the one of its name.
_MAKES = dict.fromkeys(("finger", "spatial", "tactile"), "all_scenes") | {
    "touch": "table1"
}


def table(
    make: Callable[[pd.DataFrame], pd.DataFrame], experiments: Sequence[str]
) -> Table:
    """The table of the values of :func:`compare`, from frames of these experiments."""
    return Table(
        NAME,
        make,
        of=tuple(dict.fromkeys(experiments)),
        title=TITLE,
        note=HOW,
        shown=tuple(SHOWN),
        columns=SHOWN,
    )


def compare(quantities: Iterable[Quantity]) -> pd.DataFrame:
    """A row for each quantity that was measured, in the order of published.csv."""
    measured = [one for one in quantities if one.value is not None]
    rows = [
        _row(known, ours)
        for name, known in published.numbers().items()
        for ours in measured
        if ours.name == name
    ]
    return frame(rows, COLUMNS)


def verdict(known: Published, ours: Quantity) -> str:
    """Judgement of a number: the first that applies."""
    if known.name in _SETTINGS:
        same = isinstance(ours.value, int | float) and math.isclose(
            ours.value, known.value
        )
        return f"setting, {'same' if same else 'another'}"
    if isinstance(ours.value, str):
        return "not reached"
    if known.not_comparable:
        return "not comparable"
    agreement = _agreement(known, ours)
    if not known.calibration:
        return agreement
    if known.calibration == "fitted" and agreement == "agrees":
        return "fitted"
    return f"{known.calibration}, {agreement}"


def _agreement(known: Published, ours: Quantity) -> str:
    """Whether the interval of our number holds the paper's."""
    asked = (known.value, ours.value, ours.low, ours.high, known.margin)
    numbers = [float(number) for number in asked if number is not None]
    if len(numbers) < len(asked) or not all(map(math.isfinite, numbers)):
        return "no interval"
    paper, value, low, high, margin = numbers
    if known.unit == "×":  # ratios are off by factors
        if low <= 0:
            return "no interval"
        paper, value, low, high, margin = map(math.log, numbers)
    facing = high - value if paper > value else value - low
    if abs(paper - value) > max(facing, margin):
        return "differs"
    return "uninformative" if max(high - value, value - low) > margin else "agrees"


def _row(known: Published, ours: Quantity) -> dict[str, Any]:
    experiment, quantity = known.name.split("/")
    notes = [
        known.not_comparable,
        ours.interval and f"interval: {ours.interval}",
        ours.note,
        known.note and f"calibration: {known.note}",
    ]
    return {
        "experiment": experiment,
        "quantity": quantity,
        "unit": known.unit,
        "published": known.value,
        "published_low": known.low,
        "published_high": known.high,
        "margin": known.margin,
        "verdict": verdict(known, ours),
        "condition": ours.condition,
        "measured": ours.value,
        "low": ours.low,
        "high": ours.high,
        "n": ours.n,
        "seeds": ours.seeds,
        "made_by": ours.made_by or f"{RUN}{_MAKES.get(experiment, experiment)}",
        "note": "; ".join(filter(None, notes)),
    }


def _name(row: Mapping[str, Any]) -> str:
    name = f"{row['experiment']}: {row['quantity']}".replace("_", " ")
    return ", ".join(filter(None, [name, row.get("condition")]))


def _measured(row: Mapping[str, Any]) -> str:
    measured = number(row.get("measured"), 4)
    low, high = number(row.get("low"), 4), number(row.get("high"), 4)
    return interval(measured, low, high)


def _margin(row: Mapping[str, Any]) -> str:
    if row["margin"] is None:
        return "–"
    return f"{'factor ' if row['unit'] == '×' else '±'}{row['margin']:g}"


SHOWN = {
    "quantity": Column("Quantity", cell=_name),
    "verdict": Column("Verdict"),
    "published": Column("Paper", partial(number, digits=4)),
    "measured": Column("Here", cell=_measured),
    "margin": Column("Margin", cell=_margin),
    "unit": Column("Unit"),
    "n": Column("n"),
    "note": Column("Note", lambda text: text or "–"),
}
