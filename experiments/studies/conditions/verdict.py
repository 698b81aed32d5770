"""Whether a condition explains the published row of softmax regression.

A condition is an optimiser, a scaling of the pixels, a split and a start, read by the rule that
fits the sensors best on which conditions are chosen. It explains the *accuracies* if in at least
``share`` of sensors and draws training and test accuracy lie in the published intervals while HDC
has at least ``hdc_at_least`` on the same frames, and if the pattern goes where its cause is
removed: in as many, the test accuracy lies above its interval for the same start projected on the
span of the training frames (where that is not known, from zero weights). It explains the *time* if
in as many, steps to 90 % times the seconds a step of one implementation lie within ``time_factor``
of the published time.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
from omegaconf import OmegaConf

from experiments.records.configs import CONFIGS
from experiments.records.measurement import Measured
from experiments.reporting import published
from experiments.reporting.table import Row
from experiments.studies.conditions.rules import RULES

KEY = ("method", "pixels", "split", "start")
EXPLAINS, ACCURACY, TIME, NO = (
    "explains", "explains accuracy only", "explains time only", "no"
)  # fmt: skip
UNTIMED = "explains accuracy, time not measured"
STEP = {"GD": "softmax_gd", "SGD": "softmax_sgd", "Adam": "softmax_adam"}
_TEXTS = (*KEY, "role", "intervention", "plateau", "diverged", "pipeline", "model")


@dataclass(frozen=True)
class Criterion:
    """What counts as an explanation; see the module and configs/experiment/table1_conditions.yaml.

    Raises:
        ValueError: naming the field that is out of range.
    """

    sensors: str
    share: float
    hdc_at_least: float
    time_factor: float

    def __post_init__(self) -> None:
        if self.sensors not in ("choose", "report"):
            raise ValueError(
                f"criterion.sensors: expected choose or report, found {self.sensors!r}"
            )
        for name, low, high in (("share", 0, 1), ("hdc_at_least", 0, 1), ("time_factor", 1, 1e3)):
            if not low <= getattr(self, name) <= high:
                raise ValueError(
                    f"criterion.{name}: expected a number from {low} to {high}, "
                    f"found {getattr(self, name)!r}"
                )


@cache
def criterion() -> Criterion:
    """That of the config."""
    tree: Any = OmegaConf.load(CONFIGS / "experiment" / "table1_conditions.yaml")
    return Criterion(**tree.criterion)


def rows_of(measured: Measured | None) -> list[dict[str, Any]]:
    """The rows of a measurement with numbers as numbers; none where there is no measurement."""
    found = measured.rows if measured else []
    return [{k: v if k in _TEXTS else float(v) for k, v in row.items()} for row in found]


def implementations(seconds: Iterable[Row]) -> dict[tuple[str, bool], dict[str, float]]:
    """Seconds a step of each model, by pipeline and whether both accuracies are taken in the clock
    after every epoch; of ``hdc``, seconds in all."""
    found: dict[tuple[str, bool], dict[str, float]] = {}
    for row in seconds:
        evaluation = row["seconds_per_evaluated_frame"] * (row["n_train"] + row["n_test"])
        for evaluated in (False, True):
            if row["model"] == "hdc":
                value = row["seconds"] + evaluated * evaluation
            else:
                in_epoch = np.ceil(row["n_train"] / row["batch"])
                value = row["seconds_per_step"] + evaluated * evaluation / in_epoch
            found.setdefault((row["pipeline"], evaluated), {})[row["model"]] = float(value)
    return found


def conditions(
    rows: Sequence[Row], seconds: Iterable[Row], wanted: Criterion
) -> list[dict[str, Any]]:
    """A row for every condition: readings, times and verdict.

    Args:
        rows: of the measurements of softmax regression.
        seconds: of the measurement of seconds a step; none if it was not made.
        wanted: the criterion.
    """
    timed = implementations(seconds)
    groups: dict[tuple[str, ...], list[Row]] = {}
    for row in rows:
        if row["intervention"] == "none":
            groups.setdefault(tuple(row[k] for k in KEY), []).append(row)
    found = []
    for key, group in groups.items():
        told = [row for row in group if row["role"] == wanted.sensors]
        if not told:
            continue
        others = [row for row in group if row["role"] != wanted.sensors]
        shares = {rule: _inside(told, rule, wanted) for rule in RULES}
        chosen = {rule: _inside(others, rule, wanted) if others else None for rule in RULES}
        # The rule is chosen where conditions are; what is told breaks ties.
        rule = max(RULES, key=lambda rule: (chosen[rule] or 0.0, shares[rule]))
        zeros = groups.get((*key[:3], "zeros"), [])
        removed = _removed(told, [r for r in zeros if r["role"] == wanted.sensors], rule)
        times = _times(told, timed, key[0], wanted)
        line: dict[str, Any] = dict(zip(KEY, key, strict=True))
        line["sigma"], line["replicates"] = told[0]["sigma"], len(told)
        line["steps_90"] = _median([row.get("r1_steps") for row in told])
        line |= times
        for name in RULES:
            for part in ("train", "test"):
                line[f"{name}_{part}"] = mean([row.get(f"{name}_{part}") for row in told])
        line |= {
            "hdc": mean([row["hdc"] for row in told]),
            "rule": rule.upper() if shares[rule] or chosen[rule] else None,
            "inside": shares[rule],
            "inside_choosing": chosen[rule],
            "removed": removed,
        }
        accuracy = shares[rule] >= wanted.share and (removed or 0.0) >= wanted.share
        in_time = line["in_time"] is not None and line["in_time"] >= wanted.share
        if accuracy:
            line["verdict"] = EXPLAINS if in_time else ACCURACY if timed else UNTIMED
        else:
            line["verdict"] = TIME if in_time else NO
        found.append(line)
    return found


def conclusion(lines: Sequence[Row], starts: Mapping[str, Mapping[str, Any]]) -> str:
    """What the verdicts amount to.

    Args:
        lines: of :func:`conditions`.
        starts: of the config, by name; ``of`` says who starts so.
    """
    full = [line for line in lines if line["verdict"] == EXPLAINS]
    passed = full or [line for line in lines if line["verdict"] in (ACCURACY, UNTIMED)]
    what = "accuracies and time" if full else "accuracies"
    usual = [line for line in passed if "of" in starts.get(line["start"], {})]
    count = f"{len(passed)} of {len(lines)} conditions explain the {what} of softmax regression"
    if not passed:
        return "No condition explains the published accuracies of softmax regression."
    if len(passed) == 1:
        return f"{count}."
    return (
        f"Not identifiable from the paper: {count}, {len(usual)} of them from initial weights that "
        "are somebody's default. What would decide: optimiser and batch, initial weights, scale of "
        "the pixels, and when training was stopped."
    )


def _inside(rows: Sequence[Row], rule: str, wanted: Criterion) -> float:
    """Share of rows in all published intervals by a rule of reading."""
    known = published.numbers()
    good = []
    for row in rows:
        right = row["hdc"] >= wanted.hdc_at_least - 1e-9
        for part, name in (("train", "training"), ("test", "test")):
            one, value = known[f"table1/softmax_{name}_accuracy"], row.get(f"{rule}_{part}")
            right = right and value is not None and one.low <= 100 * value <= one.high
        good.append(right)
    return float(np.mean(good))


def _removed(rows: Sequence[Row], zeros: Sequence[Row], rule: str) -> float | None:
    """Share of rows whose test accuracy lies above its interval without the cause."""
    above = published.numbers()["table1/softmax_test_accuracy"].high
    values = [row[f"{rule}_projected"] for row in rows if f"{rule}_projected" in row]
    values = values or [row[f"{rule}_test"] for row in zeros if f"{rule}_test" in row]
    return float(np.mean([100 * value > above for value in values])) if values else None


def _times(
    rows: Sequence[Row],
    timed: Mapping[tuple[str, bool], Mapping[str, float]],
    method: str,
    wanted: Criterion,
) -> dict[str, Any]:
    """Range of the median time to 90 % over the implementations, and the one that is nearest."""
    model = STEP[method]
    ways = {way: times for way, times in timed.items() if {model, "hdc"} <= times.keys()}
    steps = [row.get("r1_steps") for row in rows]
    line: dict[str, Any] = dict.fromkeys(
        ("seconds_low", "seconds_high", "nearest", "times_hdc", "in_time")
    )
    paper, middle = published.value("table1/softmax_training_time"), _median(steps)
    if not ways or paper is None or middle is None:
        return line | {"in_time": 0.0 if ways else None}
    seconds = {way: middle * times[model] for way, times in ways.items()}
    near = min(seconds, key=lambda way: abs(np.log(seconds[way] / paper)))
    each = [np.inf if k is None else k * ways[near][model] for k in steps]
    within = [paper / wanted.time_factor <= t <= paper * wanted.time_factor for t in each]
    return {
        "seconds_low": min(seconds.values()),
        "seconds_high": max(seconds.values()),
        "nearest": f"{near[0]}{', evaluated' * near[1]}",
        "times_hdc": seconds[near] / ways[near]["hdc"],
        "in_time": float(np.mean(within)),
    }


def mean(values: Sequence[float | None]) -> float | None:
    """None unless most have a value."""
    known = [value for value in values if value is not None]
    return float(np.mean(known)) if 2 * len(known) > len(values) else None


def _median(values: Sequence[float | None]) -> float | None:
    """What is not reached is larger than any; None where the median is so."""
    middle = np.median([np.inf if value is None else value for value in values])
    return float(middle) if np.isfinite(middle) else None
