"""The paper's numbers, and what the simulated sensor's calibration did with each.

results/published.csv says both: ``calibration`` is ``fitted`` where the number chose a parameter of
the sensor, ``watched`` where the fit looked at it and it chose none, and empty where no fit has
seen it; between ``expected_low`` and ``expected_high`` the simulated number was to lie.
"""

from __future__ import annotations

import csv
import functools
from dataclasses import dataclass

from experiments.protocol import evaluate
from experiments.records.files import ROOT

PATH = ROOT / "results" / "published.csv"
TOUCH_TEST_SAMPLES = 100  # Fig. 5(a)
# Samples behind a published accuracy, where the paper says how many.
_SAMPLES = {
    **{
        f"table1/{model}_test_accuracy": TOUCH_TEST_SAMPLES
        for model in ("hdc", "softmax", "cnn1", "cnn3")
    },
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
        unit: ``s``, ``%``, ``samples``, ``classes`` or ``1``.
        low, high: 95 % Wilson interval of a share of samples, else None.
        calibration: ``fitted``, ``watched`` or nothing.
        expected: the range that the calibration accepts, in `unit`; None where it has none.
        note: what a reader of the calibration has to know.
    """

    name: str
    value: float
    unit: str
    low: float | None = None
    high: float | None = None
    calibration: str = ""
    expected: tuple[float, float] | None = None
    note: str = ""


@functools.cache
def numbers() -> dict[str, Published]:
    """Every number by its name, in the order of the file.

    Raises:
        ValueError: naming the file, if it is not a table of them.
    """
    try:
        with PATH.open(encoding="utf-8", newline="") as file:
            lines = list(csv.DictReader(file, strict=True))
        found = [_of(line) for line in lines if line["value"]]
    except (OSError, KeyError, ValueError, csv.Error) as error:
        raise ValueError(
            f"{PATH}: expected experiment, quantity, value and unit in each row, found: {error!r}"
        ) from error
    return {one.name: one for one in found}


def value(name: str) -> float | None:
    """A number of the paper, a fraction where it has percent; None if it has none."""
    one = numbers().get(name)
    return None if one is None else one.value / (100 if one.unit == "%" else 1)


def _of(line: dict[str, str]) -> Published:
    name, number = f"{line['experiment']}/{line['quantity']}", float(line["value"])
    low = high = None
    if (n := _SAMPLES.get(name)) is not None:
        low, high = (100 * p for p in evaluate.wilson(round(number / 100 * n), n))
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
    )
