"""The paper's numbers, from results/published.csv.

- ``calibration``: ``fitted`` where the number chose a parameter of the sensor, ``watched`` where
  the fit looked at it and it chose none, empty where no fit has seen it; ``calibration_note``, how.
- ``expected_low``, ``expected_high``: the range that the calibration accepted.
- ``margin``: how far another sensor's number may be off and still mean the same, in the number's
  unit: half of the smallest difference from which the paper concludes anything, rounded down (of
  accuracies 7 points, Table I; of correlations 0.045, Fig. 4(e)); of numbers of samples half; of
  ratios of times a factor of 2.
- ``not_comparable``: why a number has no margin and is not judged.
- ``samples``: how many an accuracy is of, where the paper says it.
"""

from __future__ import annotations

import csv
import functools
import math
from dataclasses import dataclass

from experiments.records.files import ROOT

PATH = ROOT / "results" / "published.csv"


@dataclass(frozen=True)
class Published:
    """A number of the paper.

    Attributes:
        value: in `unit`: ``s``, ``%``, ``samples``, ``classes``, ``×`` or ``1``.
        margin, calibration, note: as in the file, the note of the calibration; a margin is NaN
            where the number is not judged.
    """

    value: float
    unit: str
    margin: float = math.nan
    calibration: str = ""
    note: str = ""


@functools.cache
def numbers() -> dict[str, Published]:
    """Every number by its name, ``experiment/quantity``, in the order of the file."""
    with PATH.open(encoding="utf-8", newline="") as file:
        return {
            f"{line['experiment']}/{line['quantity']}": Published(
                float(line["value"]),
                line["unit"],
                float(line["margin"] or math.nan),
                line["calibration"],
                line["calibration_note"],
            )
            for line in csv.DictReader(file)
        }


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
