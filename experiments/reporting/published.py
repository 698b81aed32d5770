"""The paper's numbers, from results/published.csv.

- ``value`` is a number, or the quotient ``A/B`` of two others of the same experiment.
- ``calibration``: ``fitted`` where the number chose a parameter of the sensor, ``watched`` where
  the fit looked at it and it chose none, empty where no fit has seen it.
- ``expected_low``, ``expected_high``: the range that the calibration accepted.
- ``margin``: how far another sensor's number may be off and still mean the same, in the number's
  unit: half of the smallest difference from which the paper concludes anything, rounded down (of
  accuracies 7 points, Table I; of correlations 0.045, Fig. 4(e)); of numbers of samples half; of
  ratios of times a factor of 2.
- ``not_comparable``: why a number is shown and not judged.
- ``samples``: how many an accuracy is of, where the paper says it.
"""

from __future__ import annotations

import csv
import functools
from dataclasses import dataclass

from experiments.records.files import ROOT
from hdc.accuracy import wilson

PATH = ROOT / "results" / "published.csv"


@dataclass(frozen=True)
class Published:
    """A number of the paper.

    Attributes:
        name: ``experiment/quantity``.
        value: in `unit`: ``s``, ``%``, ``samples``, ``classes``, ``×`` or ``1``.
        low, high: 95 % Wilson interval of a share of samples, else None.
        calibration, note, margin, not_comparable: as in the file; the note is the calibration's.
    """

    name: str
    value: float
    unit: str
    low: float | None = None
    high: float | None = None
    calibration: str = ""
    note: str = ""
    margin: float | None = None
    not_comparable: str = ""


@functools.cache
def numbers() -> dict[str, Published]:
    """Every number by its name, in the order of the file."""
    found: dict[str, Published] = {}
    for line in csv.DictReader(PATH.read_text(encoding="utf-8").splitlines()):
        if line["value"]:
            one = _of(line, found)
            found[one.name] = one
    return found


def models_of_table1() -> tuple[str, ...]:
    """The models of the paper's Table I, in its order."""
    ends = "_training_time"
    names = (name.removeprefix("table1/") for name in numbers() if name.endswith(ends))
    return tuple(name.removesuffix(ends) for name in names)


def value(name: str) -> float | None:
    """A number of the paper, a fraction where it has percent; None if it has none."""
    one = numbers().get(name)
    if one is None:
        return None
    return one.value / 100 if one.unit == "%" else one.value


def _of(
    line: dict[str, str],
    above: dict[str, Published],
) -> Published:
    experiment, text = line["experiment"], line["value"]
    name = f"{experiment}/{line['quantity']}"
    if "/" in text:
        one, other = (above[f"{experiment}/{part}"].value for part in text.split("/"))
        number = one / other
    else:
        number = float(text)
    low = high = None
    if n := int(line["samples"] or 0):
        right = round(number / 100 * n)
        low, high = (100 * bound for bound in wilson(right, n))
    margin = float(line["margin"]) if line["margin"] else None
    notes = (
        line["calibration"],
        line["calibration_note"],
        margin,
        line["not_comparable"],
    )
    return Published(name, number, line["unit"], low, high, *notes)
