"""Numbers at their limits: ``experiment=stability`` runs every case and writes one row for each.

The cases are in :mod:`experiments.studies.stability.cases`. Both forms of a case, the obvious one
and ours, get the same input, an error against an exact reference, and a time: the least of some
repeats, taken in turns so that a busy machine slows both.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

from rich.console import Console

from experiments.protocol.clock import timed
from experiments.records.measurement import Row, measure
from experiments.studies.stability.case import CASES, Case
from experiments.studies.stability.cases import (  # noqa: F401  (their cases register themselves)
    camera,
    correlations,
    hypervectors,
    layer,
    prototypes,
    speckle,
    sums,
    touches,
    training,
)

PARTS = ("hypervectors", "correlations", "training", "sensor")


def run(
    parts: Sequence[str] = PARTS,
    repeats: int = 5,
    budget_s: float = 1.0,
    small: bool = False,
    force: bool = False,
) -> Path:
    """Run the cases and write ``measured/stability-HASH/``.

    Args:
        parts: some of :data:`PARTS`.
        repeats: the most that each form is timed.
        budget_s: no form is timed again after both took this long together.
        small: the cases' small sizes, for a quick look.
        force: run even if the same code did so before.

    Raises:
        ValueError: for an unknown part.
    """
    for part in parts:
        if part not in PARTS:
            raise ValueError(f"task.parts: expected some of {', '.join(PARTS)}, found {part!r}")
    config = {
        "_target_": f"{__name__}.run",
        "parts": list(parts),
        "repeats": repeats,
        "budget_s": budget_s,
        "small": small,
    }
    console = Console(highlight=False)

    def rows() -> Iterator[Row]:
        for one in (c for part in PARTS if part in parts for c in CASES.values() if c.part == part):
            row = case_row(one, repeats, budget_s, small)
            line = (
                f"{row['verdict']}  {one.part}: {one.name}  naive {row['error_naive']:.3g}, "
                f"ours {row['error_ours']:.3g}, tolerance {row['tolerance']:.3g} {one.unit}"
            )
            console.print(line, markup=False, soft_wrap=True)
            yield row

    return measure("stability", config, rows, force=force, console=console)


def case_row(one: Case, repeats: int = 1, budget_s: float = 0.0, small: bool = False) -> Row:
    """Both forms of a case: their errors, times and the verdict."""
    trial = one.prepare(**(one.small if small else {}))
    forms = {"naive": trial.naive, "ours": trial.ours}
    results: dict[str, Any] = {}

    def keep(name: str) -> None:
        results[name] = _outcome(forms[name])

    seconds: dict[str, list[float]] = {name: [] for name in forms}
    spent = 0.0
    while not spent or (spent < budget_s and len(seconds["ours"]) < repeats):
        for name, taken in seconds.items():
            taken.append(timed(lambda name=name: keep(name)))  # type: ignore[misc]
            spent += taken[-1]
    errors = {name: _error(trial.error, result) for name, result in results.items()}
    tolerance = one.tolerance if trial.tolerance is None else trial.tolerance
    remarks = [trial.remark()] if trial.remark else []
    remarks += [
        f"{name} raised {type(result).__name__}: {' '.join(str(result).split())[:100]}"
        for name, result in results.items()
        if isinstance(result, Exception)
    ]
    return {
        "part": one.part,
        "case": one.name,
        "extreme": one.extreme,
        "expected": one.expected,
        "reference": one.reference,
        "unit": one.unit,
        "naive": one.naive,
        "ours": one.ours,
        "error_naive": errors["naive"],
        "error_ours": errors["ours"],
        "tolerance": tolerance,
        "time_naive_s": min(seconds["naive"]),
        "time_ours_s": min(seconds["ours"]),
        # NaN is no error to hold by.
        "verdict": "holds" if errors["ours"] <= tolerance else "fails",
        "note": "; ".join(remarks),
    }


def _outcome(form: Callable[[], Any]) -> Any:
    """The result of a form, or the exception it raised; its warnings are not shown."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            return form()
        except Exception as error:
            return error


def _error(error: Callable[[Any], float], result: Any) -> float:
    """The error of an outcome: infinite where there is no result to compare."""
    try:
        return float(error(result))
    except Exception:
        if isinstance(result, Exception):
            return math.inf
        raise
