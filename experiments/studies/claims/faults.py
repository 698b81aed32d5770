"""Evidence on flipped bits: what HDC loses, and what softmax regression loses beside it."""

from __future__ import annotations

from collections.abc import Iterator

import pandas as pd

from experiments.reporting.columns import display_name
from experiments.reporting.estimates import mean_difference
from experiments.reporting.measured import over_units
from experiments.studies.claims.evidence import Evidence
from experiments.studies.claims.frozen import Claim, Rules
from experiments.studies.claims.piece import (
    Piece,
    are_sensors,
    piece_of,
    variance_of,
)
from experiments.studies.claims.rules import rule_of

# Models of the rules whose numbers were rounded to eight bits before bits flipped: the model that
# was measured, and the name of those flips.
ROUNDED = {"softmax_dual_int8": ("softmax_dual", "bit_flips_int8")}


def rival_at(rival: str, level: float) -> str:
    """A baseline at a share of flipped bits, as the tables name it."""
    return f"{rival} at {100 * level:g} %"


def pieces(
    name: str, claim: Claim, frozen: Rules, evidence: Evidence
) -> Iterator[Piece]:
    """A piece for each scene and level; then what other models lose by the same flips."""
    for rows in evidence.scenes(claim.experiment).values():
        for level in claim.levels:
            (rival,) = frozen.rivals_of(name)
            of_hdc = frozen.forms[claim.form]
            yield from _piece(name, claim, frozen, rows, of_hdc, rival, level)
            for other in claim.beside:
                yield from _piece(name, claim, frozen, rows, other, other, level)


def lost(rows: pd.DataFrame, model: str, level: float) -> list[float]:
    """Accuracy with flipped bits minus that without, a number per seed.

    Of one of :data:`ROUNDED` after its numbers were rounded.
    """
    measured, kind = ROUNDED.get(model, (model, "bit_flips"))
    of_model = rows[rows.model == measured]
    accuracy = of_model.right / of_model.n_test
    by_seed = accuracy.groupby(of_model.seed)
    clean = by_seed.apply(lambda part: part[of_model.disturbance == "none"].mean())
    is_flipped = (of_model.disturbance == kind) & (of_model.level == level)
    flipped = by_seed.apply(lambda part: part[is_flipped].mean())
    return (flipped - clean).dropna().tolist()


def _piece(
    name: str,
    claim: Claim,
    frozen: Rules,
    rows: pd.DataFrame,
    model: str,
    rival: str,
    level: float,
) -> Iterator[Piece]:
    """Loss of one model on one scene, where it was measured."""
    change = lost(rows, model, level)
    if not change:
        return
    n_test, sensors = float(rows.n_test.iloc[0]), are_sensors(rows)
    value = over_units(change, seeds=False)
    if sensors:
        value = mean_difference(change, n_test)
    is_hdc = model == frozen.forms[claim.form]
    remark = "" if is_hdc else "beside, without a word"
    yield piece_of(
        rows,
        name,
        rival_at(rival, level),
        f"{_shown(model)}: change by {100 * level:g} % flipped bits",
        value,
        variance=variance_of(change, n_test, seeds=sensors),
        n=f"{len(change)} seeds",
        word=rule_of(claim.rule, frozen).of_one(value) if is_hdc else "",
        enters=not remark,
        remark=remark,
    )


def _shown(model: str) -> str:
    """Name of a model, and of its numbers."""
    if model in ROUNDED:
        return f"{display_name(ROUNDED[model][0])}, weights of 8 bits"
    return display_name(model)
