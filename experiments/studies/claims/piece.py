"""A piece of evidence on a claim and a baseline: from one recording, scene or implementation."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd

from experiments.records import configs
from experiments.reporting.estimates import Estimate, least_variance_of_difference
from experiments.reporting.text import CAPTURED

EXPLORATORY, CONFIRMATORY = "exploratory", "confirmatory"
FACTORS = {"points": 100, "%": 100}  # of a unit; 1 of others


@dataclass(frozen=True)
class Piece:
    """A number with what is needed to judge it.

    Attributes:
        claim, rival: of rules.yaml.
        evidence: name of the recording, scene or way.
        laboratory: the unit across sensors.
        frames: their kind.
        status: ``exploratory`` or ``confirmatory``.
        quantity: what the number is.
        estimate: the number with the interval of this one sensor, a fraction.
        variance: of the number, for the estimate across sensors; NaN where it is unknown.
        unit: in which tables show it.
        possible: the least and the largest value that a number in points can have: a difference of
            two accuracies, of which one may be given.
        n: frames, seeds or runs, in words.
        word: of this one sensor.
        enters: whether it enters the claim's word.
        remark: why it does not, or what a reader has to know.
        command: that measures it again.
        record: where its rows are, within the folder of results.
    """

    claim: str
    rival: str
    evidence: str
    laboratory: str
    frames: str
    quantity: str
    estimate: Estimate
    variance: float = math.nan
    status: str = EXPLORATORY
    unit: str = "points"
    possible: tuple[float, float] = (-1.0, 1.0)
    n: str = ""
    word: str = ""
    enters: bool = True
    remark: str = ""
    command: str = ""
    record: str = ""

    def row(self) -> dict[str, Any]:
        """The columns of the table of evidence, in the unit of the piece."""
        factor = FACTORS.get(self.unit, 1)
        shown = Estimate(*(factor * value for value in self.estimate))
        return {
            "claim": self.claim,
            "rival": self.rival,
            "evidence": self.evidence,
            "laboratory": self.laboratory,
            "frames": self.frames,
            "status": self.status,
            "quantity": self.quantity,
            **shown.columns("value"),
            "standard_error": factor * math.sqrt(self.variance),
            "unit": self.unit,
            "n": self.n,
            "word": self.word,
            "enters": "yes" if self.enters else "no",
            "remark": self.remark,
            "record": self.record,
            "command": self.command,
        }


def least_variance(value: float, n_test: float) -> float:
    """That of a difference of two shares of the same n test frames, which disagree on as few of
    them as the difference leaves."""
    return least_variance_of_difference(n_test * abs(value), n_test, n_test)


def variance_of(values: Sequence[float], n_test: float, seeds: bool) -> float:
    """Variance of the number of one sensor, the mean of `values`; NaN of a single value.

    Args:
        values: a difference of shares for each seed or draw.
        n_test: test frames of each.
        seeds: whether they are seeds, each with frames of its own; draws of one recording share
            frames, so that more of them do not make the variance smaller.
    """
    if len(values) < 2:
        return math.nan
    of_one = float(np.var(values, ddof=1))
    variance = max(of_one, least_variance(float(np.mean(values)), n_test))
    return variance / len(values) if seeds else variance


def are_sensors(rows: pd.DataFrame) -> bool:
    """Whether the seeds of some rows of one record are sensors, each with frames of its own; seeds
    on a recording by a camera are resamples of its frames."""
    scene = str(rows.scene.iloc[0])
    return bool(configs.scene_display(scene)["kind"] != CAPTURED)


def piece_of(
    rows: pd.DataFrame,
    claim: str,
    rival: str,
    quantity: str,
    estimate: Estimate,
    **more: Any,
) -> Piece:
    """A piece of evidence on the scene of some rows of one record, with what its config and the
    record say of it; `more` are other attributes."""
    scene = str(rows.scene.iloc[0])
    shown = configs.scene_display(scene)
    of_scene = {
        "evidence": scene,
        "laboratory": str(shown["family"]),
        "frames": str(shown["kind"]),
        "command": str(rows.command.iloc[0]),
        "record": str(rows.record.iloc[0]),
    }
    attributes: dict[str, Any] = {**of_scene, **more}
    return Piece(claim, rival, quantity=quantity, estimate=estimate, **attributes)
