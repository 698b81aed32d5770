"""The paper's numbers, what the sensor's calibration did with each, and how they are judged.

results/published.csv says all three:

- ``value`` is a number, or the quotient ``A/B`` of two others of the same experiment.
- ``calibration`` is ``fitted`` where the number chose a parameter of the sensor, ``watched`` where
  the fit looked at it and it chose none, and empty where no fit has seen it; between
  ``expected_low`` and ``expected_high`` the simulated number was to lie.
- ``margin`` is how far another sensor's number may be off and still mean the same, in the number's
  unit: half of the smallest difference from which the paper concludes anything, rounded down. Of
  accuracies that is HDC's lead over the networks (7 points in Table I), of correlations what the
  prototypes' contrast has over the speckle's (0.045 in Fig. 4(e)). A number of samples may be off
  by half; a ratio of times by a factor of 2, which another way to compute either is good for.
- ``not_comparable`` says why a number is shown and not judged.
"""

from __future__ import annotations

import csv
import functools
from dataclasses import dataclass

from experiments.records.files import ROOT
from hdc.accuracy import wilson

PATH = ROOT / "results" / "published.csv"
# Samples behind a published accuracy, where the paper says how many.
_SAMPLES = {
    **{f"table1/{model}_test_accuracy": 100 for model in ("hdc", "softmax", "cnn1", "cnn3")},
    **{f"table1/{model}_training_accuracy": 400 for model in ("softmax", "cnn1", "cnn3")},
    "finger/test_accuracy": 140,  # 20 samples for each of 7 labels
    "tactile/test_accuracy": 120,
}


@dataclass(frozen=True)
class Published:
    """A number of the paper.

    Attributes:
        name: ``experiment/quantity``.
        value: in `unit`.
        unit: ``s``, ``%``, ``samples``, ``classes``, ``×`` or ``1``.
        low, high: 95 % Wilson interval of a share of samples, else None.
        calibration: ``fitted``, ``watched`` or nothing.
        expected: the range that the calibration accepts, in `unit`; None where it has none.
        note: what a reader of the calibration has to know.
        margin: how far another number may be off and still mean the same, in `unit`; a factor for
            ratios (unit ``×``).
        not_comparable: why it is not judged, if it is not.
    """

    name: str
    value: float
    unit: str
    low: float | None = None
    high: float | None = None
    calibration: str = ""
    expected: tuple[float, float] | None = None
    note: str = ""
    margin: float | None = None
    not_comparable: str = ""


@functools.cache
def numbers() -> dict[str, Published]:
    """Every number by its name, in the order of the file.

    Raises:
        ValueError: naming the file, if it is not a table of them.
    """
    try:
        with PATH.open(encoding="utf-8", newline="") as file:
            lines = list(csv.DictReader(file, strict=True))
        found: dict[str, Published] = {}
        for line in lines:
            if line["value"]:
                one = _of(line, found)
                found[one.name] = one
    except (OSError, KeyError, ValueError, ZeroDivisionError, csv.Error) as error:
        raise ValueError(
            f"{PATH}: expected experiment, quantity, value and unit in each row, found: {error!r}"
        ) from error
    return found


def value(name: str) -> float | None:
    """A number of the paper, a fraction where it has percent; None if it has none."""
    one = numbers().get(name)
    return None if one is None else one.value / (100 if one.unit == "%" else 1)


def _of(line: dict[str, str], above: dict[str, Published]) -> Published:
    experiment, text = line["experiment"], line["value"]
    name = f"{experiment}/{line['quantity']}"
    if "/" in text:
        one, other = (above[f"{experiment}/{part}"].value for part in text.split("/"))
        number = one / other
    else:
        number = float(text)
    low = high = None
    if (n := _SAMPLES.get(name)) is not None:
        low, high = (100 * p for p in wilson(round(number / 100 * n), n))
    window = (line["expected_low"], line["expected_high"])
    return Published(
        name,
        number,
        line["unit"],
        low,
        high,
        line["calibration"],
        (float(window[0]), float(window[1])) if all(window) else None,
        line["calibration_note"],
        float(line["margin"]) if line["margin"] else None,
        line["not_comparable"],
    )
