"""How close the simulated sensor is to the paper: what was fitted, what it then says, controls.

The calibration measures nothing itself: its table holds what the other studies say of the same
quantities beside the range in which the fit was to bring them.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from experiments.records.measurement import Measured
from experiments.records.results import Group, Results
from experiments.reporting import published
from experiments.reporting import rows as rows_of
from experiments.reporting.estimates import crossing, mean_interval, mean_share, share
from experiments.reporting.published import Published
from experiments.reporting.study import RUN, Quantity, Study
from experiments.reporting.table import Row, Table, frame, interval, number, percent
from experiments.studies.accuracy.view import quantities as of_accuracy
from experiments.studies.correlation.view import contrast, matrices
from experiments.studies.correlation.view import quantities as of_correlation
from experiments.studies.drift.view import quantities as of_drift
from experiments.studies.scenes.view import quantities as of_scenes
from experiments.studies.table1.view import quantities as of_table1

_MEASURED_BY = (of_table1, of_accuracy, of_correlation, of_scenes, of_drift)

_CONTROLS = {
    "tactile": "nothing",
    "tactile_texture": "texture only: all objects as thick",
    "tactile_same_patch": "texture only, every touch meets the same patch",
    "tactile_precise": "the same, depth repeated to 0.1 %, place to 10 µm",
    "tactile_depth": "thickness only: all objects smooth",
}


def tables(results: Results) -> Iterator[Table]:
    """The calibration, the fit, the errors on finger and the controls of tactile."""
    yield from calibration(results)
    if (measured := results.measured("calibration")) is not None:
        yield fit(measured)
    finger = results.group("finger", "hdc")
    if finger.runs:
        yield confusions(finger)
    yield from controls(results)


# Calibration --------------------------------------------------------------------------------------


def calibration(results: Results) -> Iterator[Table]:
    """Every quantity that the calibration expected something of, as the other studies have it."""
    found: dict[str, list[Quantity]] = {}
    for quantities in _MEASURED_BY:
        for quantity in quantities(results):
            found.setdefault(quantity.name, []).append(quantity)
    rows = [
        _judged(known, ours)
        for known in published.numbers().values()
        if known.expected is not None
        for ours in found.get(known.name, [])
    ]
    if not rows:
        return
    yield Table(
        "calibration",
        "The simulated sensor beside the paper",
        frame(rows),
        {
            "Quantity": lambda row: row["quantity"],
            "Paper": lambda row: number(row["paper"], 4),
            "Here [95 %]": lambda row: interval(
                *(number(row[key], 4) for key in ("here", "low", "high"))
            ),
            "Expected": lambda row: row["expected"],
            "Met": lambda row: row["met"],
            "Status": lambda row: row["status"],
            "Note": lambda row: row["note"] or "–",
        },
        "Fitted: the number chose a parameter of the sensor, on seeds that are not among these; "
        "watched: the fit looked at it and it chose none. Met: the value here is in the range that "
        "the fit accepted, whatever its interval, which is that of one more sensor.",
        [f"{RUN}{name}" for name in ("table1", "accuracy_vs_n", "correlation", "scenes", "drift")],
    )


def _judged(known: Published, ours: Quantity) -> Row:
    assert known.expected is not None
    low, high = known.expected
    inside = isinstance(ours.value, int | float) and low <= ours.value <= high
    return {
        "quantity": ", ".join(filter(None, [_named(known), ours.condition])),
        "paper": known.value,
        "here": ours.value,
        "low": ours.low,
        "high": ours.high,
        "expected": _range(known),
        "met": "yes" if inside else "no",
        "status": known.calibration,
        "note": known.note,
    }


def _named(known: Published) -> str:
    unit = "" if known.unit == "1" else f", {known.unit}"
    return known.name.replace("/", ": ").replace("_", " ") + unit


def _range(known: Published) -> str:
    return "" if known.expected is None else "{:g} to {:g}".format(*known.expected)


# Fit ----------------------------------------------------------------------------------------------


_PLACES = ("smaller", "fitted", "larger")


def fit(measured: Measured) -> Table:
    """Each fitted parameter beside its neighbours: what it was fitted to, at each of them."""
    rows = []
    for scene, parameters in measured.record.config["fitted"].items():
        mine = [row for row in measured.rows if row["scene"] == scene]
        own = fitted_to([row for row in mine if "parameter" not in row], measured)
        for parameter, values in parameters.items():
            moved = [row for row in mine if row.get("parameter") == parameter]
            smaller, larger = (
                fitted_to([row for row in moved if float(row["at"]) == values[k]], measured)
                for k in (0, 2)
            )
            for name in own:
                known = published.numbers()[name]
                row: dict[str, Any] = {
                    "parameter": f"{scene}: {parameter}",
                    "quantity": _named(known),
                    "paper": known.value,
                    "expected": _range(known),
                }
                for key, at, value in zip(_PLACES, (smaller, own, larger), values, strict=True):
                    row |= {f"{key}_value": value, key: at[name]}
                rows.append(row)
    seeds = measured.record.config["seeds"]
    return Table(
        "sensor_fit",
        "Every fitted parameter beside its neighbours",
        frame(rows),
        {
            "Parameter": lambda row: row["parameter"],
            "Quantity": lambda row: row["quantity"],
            "Paper": lambda row: number(row["paper"], 4),
            "Expected": lambda row: row["expected"],
            **{key.capitalize(): partial(_at, key=key) for key in _PLACES},
        },
        f"Means over the seeds {', '.join(map(str, seeds))}, which no other result is of; in "
        "brackets the value of the parameter. All other parameters are at their own.",
        [measured.record.command],
    )


def _at(row: Row, key: str) -> str:
    return f"{number(row[key], 3)} ({row[f'{key}_value']:g})"


def fitted_to(rows: Sequence[dict[str, str]], measured: Measured) -> dict[str, float]:
    """Quantities of published.csv, in its units, by the estimators of the other studies."""
    found: dict[str, float] = {}
    by_kind: dict[tuple[str, int], list[float]] = {}
    for row in rows:
        if row["kind"] != "speckle":
            key = row["kind"], int(row["n_train"])
            by_kind.setdefault(key, []).append(100 * int(row["right"]) / int(row["n_test"]))
    scene = rows[0]["scene"]
    if scene == "touch":
        pairs = [row for row in rows if row["kind"] == "speckle"]
        _, values, _ = matrices(replace(measured, rows=pairs), "speckle", "all")
        largest = [float(np.diag(c).max()) for c in values]
        found["correlation/max_same_class_speckle"] = mean_interval(largest).value
        found["correlation/contrast_speckle"] = mean_interval(list(map(contrast, values))).value
        sizes = sorted(n for _, n in by_kind)
        curve = [float(np.mean(by_kind["accuracy", n])) for n in sizes]
        found["accuracy_vs_n/n_for_90_percent"] = crossing(sizes, curve, 90)
        found["table1/hdc_test_accuracy"] = curve[-1]
        return found
    for (kind, _), right in by_kind.items():
        name = "test_accuracy" if kind == "accuracy" else f"{kind}_accuracy"
        found[f"{scene}/{name}"] = float(np.mean(right))
    return found


# Errors and controls ------------------------------------------------------------------------------


def confusions(group: Group) -> Table:
    """What each label of the finger is taken for."""
    counts = group.confusion()
    rows = []
    for k, (label, line) in enumerate(zip(group.classes, counts, strict=True)):
        n = int(line.sum())
        others = zip(group.classes, line, strict=True)
        wrong = {name: int(k) for name, k in others if k and name != label}
        of_label = [run.record.right[np.equal(run.record.test_labels, k)] for run in group.runs]
        right = mean_share(
            [float(one.mean()) for one in of_label], float(np.mean([len(one) for one in of_label]))
        )
        taken = sorted(wrong, key=wrong.__getitem__, reverse=True)
        rows.append(
            {
                "label": label,
                "n": n,
                "accuracy": right.value,
                "ci_low": right.low,
                "ci_high": right.high,
                "taken_for": ", ".join(f"{name} {percent(wrong[name] / n)} %" for name in taken),
            }
        )
    return Table(
        "finger_confusions",
        "What the labels of the finger are taken for",
        frame(rows),
        {
            "Label": lambda row: row["label"],
            "Test samples": lambda row: number(row["n"]),
            "Right, % [95 %]": lambda row: interval(
                *(percent(row[key]) for key in ("accuracy", "ci_low", "ci_high"))
            ),
            "Taken for": lambda row: row["taken_for"] or "–",
        },
        "In the paper R1 is confused with R2, and None is taken for R2 or R3.",
        rows_of.commands([group]),
    )


def controls(results: Results) -> Iterator[Table]:
    """Accuracy on the scene tactile and on what is left of it."""
    groups = {scene: results.group(scene, "hdc") for scene in _CONTROLS}
    if not any(group.runs for scene, group in groups.items() if scene != "tactile"):
        return
    rows: list[dict[str, Any]] = []
    for scene, group in groups.items():
        row: dict[str, Any] = {"scene": scene, "changed": _CONTROLS[scene]}
        if group.runs:
            right = share(group)
            row |= {
                "accuracy": right.value,
                "ci_low": right.low,
                "ci_high": right.high,
                "chance": 1 / len(group.classes),
                "n_test": len(group.right),
            }
        rows.append({**row, "seeds": len(group.runs), "status": group.status})
    yield Table(
        "tactile_controls",
        "What three objects are told apart by",
        frame(rows),
        {
            "Scene": lambda row: row["scene"],
            "Changed": lambda row: row["changed"],
            "Seeds": lambda row: number(row["seeds"]),
            "Test accuracy, % [95 %]": lambda row: interval(
                *(percent(row[key]) for key in ("accuracy", "ci_low", "ci_high"))
            ),
            "Chance, %": lambda row: percent(row["chance"]),
            "Status": lambda row: row["status"],
        },
        "The thickness of the three sheets is assumed; the paper gives none.",
        [f"{RUN}tactile_controls"],
    )


STUDY = Study(
    "sensor",
    "The simulated sensor",
    "How close is the simulated sensor to the paper, which of its numbers were fitted, and what "
    "does it tell objects apart by?",
    3.5,
    tables,
)
