"""Published numbers beside ours: a row for each that can be judged, by the rule in :data:`HOW`.
Table I alone has what depends on the machine, or on what the paper does not say.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from functools import partial
from typing import Any

import pandas as pd

from experiments.reporting import published
from experiments.reporting.columns import Column
from experiments.reporting.estimates import Estimate
from experiments.reporting.published import Published
from experiments.reporting.study import Quantity
from experiments.reporting.table import Table, frame
from experiments.reporting.text import number

HOW = (
    "The paper has one sensor. A number of it is judged by the interval in which the "
    "number of one more sensor of ours lies with 95 %: Student's, over sensors. A ratio "
    "of times has the range of its measurements instead. A number differs "
    "if it is outside and further off than the margin; it is uninformative if the "
    "interval reaches further than the margin. The margin, stated before, is half of the "
    "smallest difference from which the paper draws a conclusion; for ratios of times it "
    "is a factor of 2, for numbers of samples a half. "
    "Fitted: it chose a "
    "parameter of the simulated sensor; watched: known during the calibration, and chose "
    "none. n: of test samples (of times: fits), all seeds together."
)
SHOWN = {
    "quantity": Column(
        "Quantity", lambda name: name.replace("/", ": ").replace("_", " ")
    ),
    "verdict": Column("Verdict"),
    "published": Column("Paper", partial(number, digits=4)),
    "measured": Column("Here", partial(number, digits=4)),
    "margin": Column("Margin"),
    "unit": Column("Unit"),
    "n": Column("n"),
    "note": Column("Note"),
}


def table(
    make: Callable[[pd.DataFrame], pd.DataFrame], experiments: Sequence[str]
) -> Table:
    """The table of the values of :func:`compare`, from frames of these experiments."""
    return Table(
        "comparison",
        make,
        of=tuple(dict.fromkeys(experiments)),
        title="Published numbers and ours",
        note=HOW,
        shown=tuple(SHOWN),
        columns=SHOWN,
    )


def compare(quantities: Iterable[Quantity]) -> pd.DataFrame:
    """A row for each quantity that was measured, in the order of published.csv."""
    known = published.numbers()
    order = list(known)
    measured = sorted(quantities, key=lambda ours: order.index(ours.name))
    return frame(_row(known[ours.name], ours) for ours in measured)


def _row(known: Published, ours: Quantity) -> dict[str, Any]:
    calibration = known.note and f"calibration: {known.note}"
    return {
        "quantity": ours.name,
        "unit": known.unit,
        "published": known.value,
        **_in_unit(known, ours).columns("measured"),
        "margin": known.margin,
        "n": ours.n,
        "seeds": ours.seeds,
        "verdict": verdict(known, ours),
        "note": "; ".join(filter(None, [ours.note, calibration])),
    }


def _in_unit(known: Published, ours: Quantity) -> Estimate:
    scale = 100 if known.unit == "%" else 1
    return Estimate(*(scale * number for number in ours.estimate))


def verdict(known: Published, ours: Quantity) -> str:
    """Whether the interval of our number holds the paper's, and what the paper's was used for."""
    agreement = _agreement(known, _in_unit(known, ours))
    if known.calibration == "fitted" and agreement == "agrees":
        return "fitted"
    return ", ".join(filter(None, [known.calibration, agreement]))


def _agreement(known: Published, ours: Estimate) -> str:
    numbers: Iterable[float] = (known.value, *ours, known.margin)
    if known.unit == "×":  # ratios are off by factors
        numbers = map(math.log, numbers)
    paper, value, low, high, margin = numbers
    if math.isnan(low):
        return "no interval"
    facing = high - value if paper > value else value - low
    if abs(paper - value) > max(facing, margin):
        return "differs"
    return "uninformative" if max(high - value, value - low) > margin else "agrees"
