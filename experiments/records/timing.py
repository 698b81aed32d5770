"""Runs that took unlike as long as others that did the same: something else was on the machine.

Siblings have the same configuration but for their seeds, and were made by the same code on the same
processor. They go through a sample, and so a step, in about the same time. One whose seconds a
sample are more than :data:`FACTOR` times the median of the siblings (of two: the other's), or less
than a part in it, was disturbed, or they were.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

import numpy as np

from experiments.records.record import Curve, Finished

if TYPE_CHECKING:
    from experiments.records.results import Run

FACTOR = 1.5
_SHORTEST = 0.01
"""Seconds of training below which a run is not judged: the system alone may take as long."""


def seconds_a_sample(record: Finished, curve: Curve) -> float:
    """Seconds of training for each time that a sample was gone through."""
    seen = curve[-1].get("samples_seen") if curve else None
    return record.training_s / (seen or record.n_train)


def unlike_siblings(runs: Iterable[Run]) -> list[Run]:
    """Those of these runs that took unlike as long a sample as their siblings among them."""
    families: dict[tuple[object, ...], list[Run]] = {}
    for run in runs:
        families.setdefault(_family(run), []).append(run)
    return [run for same in families.values() for run in _unlike(same)]


def _family(run: Run) -> tuple[object, ...]:
    config, made = run.record.config, run.record.environment
    coordinates = config["split"]["n_train"], config["data"]["pixels"]
    return run.configuration, *coordinates, made.code, made.cpu


def _unlike(same: Sequence[Run]) -> list[Run]:
    same = [run for run in same if run.record.training_s >= _SHORTEST]
    if len(same) < 2:
        return []
    times = np.array([seconds_a_sample(run.record, run.curve) for run in same])
    usual = times[::-1] if len(times) == 2 else np.median(times)
    ratios = times / usual
    return [
        run for run, ratio in zip(same, ratios, strict=True) if not 1 / FACTOR <= ratio <= FACTOR
    ]
