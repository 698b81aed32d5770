"""Evidence on flipped bits: what HDC loses, and what softmax regression loses beside it."""

from __future__ import annotations

from collections.abc import Iterator

import pandas as pd

from experiments.records import configs
from experiments.records.measurement import Measured
from experiments.records.results import Results
from experiments.reporting.columns import display_name
from experiments.reporting.estimates import mean_difference
from experiments.studies.claims.frozen import Claim, Rules
from experiments.studies.claims.piece import (
    Piece,
    measured_by_scene,
    place_of,
    variance_of,
)
from experiments.studies.claims.rules import rule_of

_INT8 = "_int8"  # ending of a model whose numbers were rounded to eight bits


def rival_at(rival: str, level: float) -> str:
    """A rival at a share of flipped bits, as the tables name it."""
    return f"{rival} at {100 * level:g} %"


def pieces(name: str, claim: Claim, frozen: Rules, results: Results) -> Iterator[Piece]:
    """A piece for each scene and level; then what other models lose by the same flips."""
    for found in measured_by_scene(results, claim.experiment).values():
        measured = found[0]
        for level in claim.levels:
            (rival,) = frozen.rivals_of(name)
            of_hdc = frozen.forms[claim.form]
            yield from _piece(name, claim, frozen, measured, of_hdc, rival, level)
            for other in claim.beside:
                yield from _piece(name, claim, frozen, measured, other, other, level)


def lost(rows: pd.DataFrame, model: str, level: float) -> list[float]:
    """Accuracy with flipped bits less that without, a number a seed.

    Of a model that ends in ``_int8`` after its numbers were rounded.
    """
    kind = "bit_flips_int8" if model.endswith(_INT8) else "bit_flips"
    of_model = rows[rows.model == model.removesuffix(_INT8)]
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
    measured: Measured,
    model: str,
    rival: str,
    level: float,
) -> Iterator[Piece]:
    """What one model loses on one scene, where it was measured."""
    rows = measured.frame
    change = lost(rows, model, level)
    if not change:
        return
    shown = configs.scene_display(measured.record.scene)
    n_test = float(rows.n_test.iloc[0])
    value = mean_difference(change, n_test)
    is_hdc = model == frozen.forms[claim.form]
    remark = "" if is_hdc else "beside, without a word"
    yield Piece(
        name,
        rival_at(rival, level),
        measured.record.scene,
        str(shown["family"]),
        str(shown["kind"]),
        f"{_shown(model)}: change by {100 * level:g} % flipped bits",
        value,
        variance_of(change, n_test, seeds=True),
        n=f"{len(change)} seeds",
        word=rule_of(claim.rule, frozen).of_one(value) if is_hdc else "",
        enters=not remark,
        remark=remark,
        command=measured.record.command,
        record=place_of(measured),
    )


def _shown(model: str) -> str:
    """Name of a model, and of its numbers."""
    if model.endswith(_INT8):
        return f"{display_name(model.removesuffix(_INT8))}, weights of 8 bits"
    return display_name(model)
