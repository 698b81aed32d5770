"""The simulated sensor beside the paper: which numbers were fitted."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import pandas as pd

from experiments import studies
from experiments.records.results import Results
from experiments.reporting import published, study
from experiments.reporting.columns import Column
from experiments.reporting.comparison import compare
from experiments.reporting.estimates import crossing
from experiments.reporting.study import RUN, Study
from experiments.reporting.text import number
from experiments.studies.sensor.measure import CURVE

STUDY = Study(
    "sensor",
    "The simulated sensor",
    "How close is the simulated sensor to the paper, and which of its numbers were fitted?",
    3.5,
)
_PLACES = ("smaller", "fitted", "larger")


def _four(value: float) -> str:
    return number(value, 4)


def _named(name: str) -> str:
    """``accuracy vs n: n for 90 percent, samples`` of a number of published.csv."""
    unit = published.numbers()[name].unit
    return name.replace("/", ": ").replace("_", " ") + ("" if unit == "1" else f", {unit}")


def _range(name: str) -> str:
    expected = published.numbers()[name].expected
    return "{:g} to {:g}".format(*expected) if expected else ""


@STUDY.table(
    "calibration", title="The simulated sensor beside the paper",
    columns={
        "quantity": Column("Quantity"), "paper": Column("Paper", _four),
        "here": Column("Here [95 %]", _four),
        "expected": Column("Expected"), "met": Column("Met"), "status": Column("Status"),
        "note": Column("Note", lambda text: text or "–"),
    },
    note="Fitted: the number chose a parameter of the sensor, on seeds that are not among these; "
    "watched: the fit looked at it and it chose none. Met: the value here is in the range that the "
    "fit accepted, whatever its interval, which is that of one more sensor.",
    commands=[f"{RUN}{n}" for n in ("table1", "accuracy_vs_n", "correlation", "scenes", "drift")],
)  # fmt: skip
def calibration(results: Results) -> pd.DataFrame:
    """The rows of the comparison for which the calibration expected something."""
    every = study.studies(studies)
    rows = compare(quantity for each in every for quantity in each.quantities_of(results)).data
    table = []
    for row in rows.to_dict("records"):
        known = published.numbers()[f"{row['experiment']}/{row['quantity']}"]
        if known.expected is None or row["measured"] is None:
            continue
        low, high = known.expected
        met = isinstance(row["measured"], int | float) and low <= row["measured"] <= high
        table.append({
            "quantity": ", ".join(filter(None, [_named(known.name), row["condition"]])),
            "paper": known.value, "here": row["measured"], "here_low": row["low"],
            "here_high": row["high"], "expected": _range(known.name),
            "met": "yes" if met else "no", "status": known.calibration, "note": known.note,
        })  # fmt: skip
    return pd.DataFrame(table)


@STUDY.table(
    "sensor_fit", of="calibration", title="Every fitted parameter beside its neighbours",
    shown=("parameter", "quantity", "paper", "expected", *_PLACES),
    columns={
        "parameter": Column("Parameter"), "quantity": Column("Quantity", _named),
        "paper": Column("Paper", _four), "expected": Column("Expected"),
        **{place: Column(place.capitalize(), cell=lambda row, place=place: (  # type: ignore[misc]
            f"{number(row[place], 3)} ({row[f'{place}_value']:g})")) for place in _PLACES},
    },
    note="Means over seeds that no other result uses; in brackets the value of the parameter. All "
    "other parameters are at their own.",
)  # fmt: skip
def fit(rows: pd.DataFrame, config: Mapping[str, Any]) -> pd.DataFrame:
    """Each fitted parameter at three values, and the numbers that it was fitted to."""
    table = []
    for scene, parameters in config["fitted"].items():
        of_scene = rows[rows.scene == scene]
        middle = fitted_to(of_scene[of_scene.parameter.isna()])
        for parameter, values in parameters.items():
            moved = of_scene[of_scene.parameter == parameter]
            smaller, larger = (fitted_to(moved[moved["at"] == values[k]]) for k in (0, 2))
            for name in middle:
                line: dict[str, Any] = {
                    "parameter": f"{scene}: {parameter}", "quantity": name,
                    "paper": published.numbers()[name].value, "expected": _range(name),
                }  # fmt: skip
                at = zip(_PLACES, (smaller, middle, larger), values, strict=True)
                for place, numbers, value in at:
                    line |= {f"{place}_value": value, place: numbers[name]}
                table.append(line)
    return pd.DataFrame(table)


def fitted_to(rows: pd.DataFrame) -> dict[str, float]:
    """Quantities of published.csv by name, means over seeds."""
    plain = rows[rows.quantity != CURVE]
    numbers = plain.groupby("quantity", sort=False).value.mean().to_dict()
    curve = rows[rows.quantity == CURVE].groupby("n_train").value.mean()
    if len(curve):
        sizes, accuracies = curve.index.tolist(), curve.tolist()
        numbers["accuracy_vs_n/n_for_90_percent"] = crossing(sizes, accuracies, 90)
        numbers["table1/hdc_test_accuracy"] = accuracies[-1]
    return numbers
