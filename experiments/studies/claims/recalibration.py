"""Evidence on recalibration: how much of what drift has cost comes back."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
import pandas as pd

from experiments.reporting.measured import over_units
from experiments.studies.claims.evidence import Evidence
from experiments.studies.claims.frozen import Claim, Rules, Update
from experiments.studies.claims.piece import Piece, are_sensors, piece_of
from experiments.studies.claims.rules import rule_of
from experiments.studies.drift.sessions import accuracies

STORED = "stored"
OWN_LOSS = "its own loss"  # what the update is compared with


def pieces(
    name: str, claim: Claim, frozen: Rules, evidence: Evidence
) -> Iterator[Piece]:
    """Share of the loss in each scene that HDC regains."""
    for rows in evidence.scenes(claim.experiment).values():
        every = accuracies(rows)
        assert claim.update is not None
        form = frozen.forms[claim.form]
        of_hdc = shares_regained(every, form, claim.update)
        if of_hdc is None:
            continue
        yield _judged(name, claim, frozen, rows, of_hdc)


def shares_regained(
    every: pd.DataFrame, model: str, update: Update
) -> pd.DataFrame | None:
    """By seed: accuracy in the old session, in the new before and after the update, what drift has
    ``lost``, and the ``share`` of it that came back; None where one was not measured."""
    of_model = every[every.model == model]
    stored = of_model[of_model.method == STORED].set_index("seed")
    is_update = (
        (of_model.method == update.method)
        & (of_model.n_new == update.n_new)
        & (of_model.p == update.p)
    )
    updated = of_model[is_update]
    after = updated.set_index("seed").new
    if not len(after) or not len(stored):
        return None
    lost = stored.old - stored.new
    gained = after - stored.new
    table = {"before": stored.new, "after": after, "lost": lost}
    return pd.DataFrame({**table, "share": gained / lost}).dropna()


def _judged(
    name: str, claim: Claim, frozen: Rules, rows: pd.DataFrame, of_hdc: pd.DataFrame
) -> Piece:
    """The share that came back, if enough was lost."""
    lost, sensors = of_hdc.lost, are_sensors(rows)
    share = over_units(of_hdc.share.tolist(), seeds=sensors)
    cost = f"drift cost {100 * lost.mean():.1f} points"
    enough = lost.mean() >= claim.lost and (lost > 0).all()
    remark = cost
    if not enough:
        remark = f"{cost}, less than the {100 * claim.lost:g} to be restored"
    update = claim.update
    assert update is not None
    return piece_of(
        rows,
        name,
        OWN_LOSS,
        f"share of the loss regained by bits replaced with p = {update.p:g}, "
        f"{update.n_new} new frames",
        share,
        variance=_variance(of_hdc.share, sensors),
        unit="%",
        n=f"{len(of_hdc)} seeds",
        word=rule_of(claim.rule, frozen, claim.share).of_one(share) if enough else "",
        enters=bool(enough),
        remark=remark,
    )


def _variance(shares: pd.Series, sensors: bool = True) -> float:
    """Variance of the mean of a share per seed; NaN of a single seed, and where all seeds agree,
    which says nothing of how much another would differ. Seeds that are no sensors of their own
    share frames, so that more of them do not make it smaller."""
    if shares.nunique() < 2:
        return math.nan
    of_one = float(np.var(shares, ddof=1))
    return of_one / len(shares) if sensors else of_one
