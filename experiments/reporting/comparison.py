"""Every published number beside ours.

One row for each line of published.csv, or several where the paper leaves a condition open. The
verdict, from the first of these that applies:

- ``missing``: nothing was measured.
- ``setting``: the paper's choice and not its result (learning rate, number of labels): the ``same``
  here, or ``another``.
- ``not reached``: the median run never got where the number is taken.
- ``no interval``: measured, but not often enough for an interval. Such a number never matches.
- ``matches``: the published number lies within its interval: zero is in the 95 % interval of the
  difference ours − paper, which the intervals of both make up (Newcombe, Statist. Med. 17, 873
  (1998); Zou and Donner, ibid. 27, 1693 (2008)). A published number without one counts as exact.
- ``differs``: it does not.

Before it stands what the simulated sensor's calibration did with the number: ``fitted`` chose a
parameter, so a fitted number that agrees is called ``fitted`` and never ``matches``; ``watched``
was looked at in the fit and chose none.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from typing import Any

from experiments.reporting import published
from experiments.reporting.published import Published
from experiments.reporting.study import RUN, Quantity
from experiments.reporting.table import Table, frame, interval, number

TITLE = "Published numbers and ours, with 95 % intervals"
HOW = (
    "Intervals hold with 95 %. A number matches if the difference from the published one is within "
    "the interval that both have, and never without an interval; fitted: it chose a parameter of "
    "the simulated sensor; watched: the calibration looked at it and it chose none."
)
COLUMNS = (
    "experiment",
    "quantity",
    "condition",
    "unit",
    "published",
    "published_low",
    "published_high",
    "measured",
    "ci_low",
    "ci_high",
    "n",
    "seeds",
    "verdict",
    "made_by",
    "note",
)
_SETTINGS = ("table1/learning_rate", "touch/labels")
# What makes an experiment of published.csv where that is not the one of its name.
_MAKES = {"finger": "scenes", "spatial": "scenes", "tactile": "scenes", "touch": "table1"}


def compare(quantities: Iterable[Quantity]) -> Table:
    """The table, in the order of published.csv, of what was measured of it."""
    found: dict[str, list[Quantity | None]] = {}
    for quantity in quantities:
        found.setdefault(quantity.name, []).append(quantity)
    rows = [
        _row(known, ours)
        for name, known in published.numbers().items()
        for ours in found.get(name, [None])
    ]
    return Table(
        "comparison",
        TITLE,
        frame(rows, COLUMNS),
        {
            "Quantity": _name,
            "Verdict": lambda row: row["verdict"],
            "Paper": lambda row: _value(row, "published", "published_low", "published_high"),
            "Here": lambda row: _value(row, "measured", "ci_low", "ci_high"),
            "Unit": lambda row: row["unit"],
            "n": lambda row: number(row["n"]),
            "Seeds": lambda row: number(row["seeds"]),
            "Note": lambda row: row["note"] or "–",
            "Made by": lambda row: row["made_by"],
        },
        key=("Quantity",),
        common=("Paper", "Unit", "Note", "Made by"),
    )


def verdict(known: Published, ours: Quantity | None) -> str:
    """What to think of a number: see the module's docstring."""
    if ours is None:
        return "missing"
    if known.name in _SETTINGS:
        same = isinstance(ours.value, int | float) and math.isclose(ours.value, known.value)
        return f"setting, {'same' if same else 'another'}"
    if isinstance(ours.value, str):
        return "not reached"
    if ours.low is None or ours.high is None:
        agreement = "no interval"
    else:
        agreement = "matches" if _agrees(known, ours.value, ours.low, ours.high) else "differs"
    if known.calibration == "fitted" and agreement == "matches":
        return "fitted"
    return f"{known.calibration}, {agreement}" if known.calibration else agreement


def _row(known: Published, ours: Quantity | None) -> dict[str, Any]:
    experiment, quantity = known.name.split("/")
    row: dict[str, Any] = {
        "experiment": experiment,
        "quantity": quantity,
        "unit": known.unit,
        "published": known.value,
        "published_low": known.low,
        "published_high": known.high,
        "verdict": verdict(known, ours),
        "made_by": f"{RUN}{_MAKES.get(experiment, experiment)}",
    }
    if ours is None:
        return row
    notes = [
        ours.interval and f"interval: {ours.interval}",
        ours.note,
        known.note and f"calibration: {known.note}",
    ]
    return row | {
        "condition": ours.condition,
        "measured": ours.value,
        "ci_low": ours.low,
        "ci_high": ours.high,
        "n": ours.n,
        "seeds": ours.seeds,
        "made_by": ours.made_by or row["made_by"],
        "note": "; ".join(filter(None, notes)),
    }


def _agrees(known: Published, ours: float, low: float, high: float) -> bool:
    """Whether zero lies in the interval of the difference ours − paper."""
    paper = known.value
    paper_low, paper_high = (paper if x is None else x for x in (known.low, known.high))
    if ours >= paper:
        return ours - paper <= math.hypot(ours - low, paper_high - paper)
    return paper - ours <= math.hypot(high - ours, paper - paper_low)


def _name(row: Mapping[str, Any]) -> str:
    name = f"{row['experiment']}: {row['quantity']}".replace("_", " ")
    return ", ".join(filter(None, [name, row.get("condition")]))


def _value(row: Mapping[str, Any], value: str, low: str, high: str) -> str:
    return interval(*(number(row.get(key), 4) for key in (value, low, high)))
