"""How much of what a drift costs each update wins back, from the rows of the study."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from experiments.records.results import once
from experiments.reporting import estimates
from experiments.reporting.estimates import Estimate
from experiments.studies.drift.sessions import SESSIONS, accuracies

N_NEW = 50  # at which the paper reports the recovered accuracy
UNLABELLED = ("zeroed", "untouched")


@once
def regained(rows: pd.DataFrame) -> pd.DataFrame:
    """How much of what a drift costs each update wins back, in the new session.

    Args:
        rows: of the study, of one scene.

    Returns:
        DataFrame, one row for each ``model``, ``update`` and ``n_new``: ``method``, ``share``,
        ``labels`` (whether the update needs them), and as fractions, each with its 95 % interval
        over seeds under ``_low`` and ``_high``: ``before``, the accuracy of the stored model in the
        old session, ``stored`` in the new one, ``updated`` and ``old`` of the updated model in the
        new and in the old one, ``lost`` = before − stored, and ``regained`` = (updated −
        stored)/lost, a ratio of means.
    """
    n_new, n_old = (int(rows[f"n_test_{name}"].iloc[0]) for name in SESSIONS)
    every = accuracies(rows)
    stored = every[every.method == "stored"]
    at = ["model", "seed"]
    updated = every[every.method != "stored"].merge(
        stored[[*at, *SESSIONS]], on=at, suffixes=("", "_stored"), validate="m:1"
    )
    lines: list[dict[str, Any]] = []
    keys = ["method", "update", "share", "n_new"]
    for model, part in updated.groupby("model", sort=False):
        for key, way in part.groupby(keys, sort=False, dropna=False):
            new, old = way.new.to_numpy(), way.old.to_numpy()
            new_stored, before = way.new_stored.to_numpy(), way.old_stored.to_numpy()
            lost = before - new_stored
            line: dict[str, Any] = {"model": model}
            line |= dict(zip(keys, key, strict=True))
            line["labels"] = key[0] not in UNLABELLED
            line |= estimates.mean_share(before.tolist(), n_old).columns("before")
            line |= estimates.mean_share(new_stored.tolist(), n_new).columns("stored")
            line |= estimates.mean_share(new.tolist(), n_new).columns("updated")
            line |= estimates.mean_share(old.tolist(), n_old).columns("old")
            line |= estimates.mean_interval(lost.tolist()).columns("lost")
            line |= ratio(new - new_stored, lost).columns("regained")
            lines.append(line)
    return pd.DataFrame(lines)


def ratio(parts: NDArray[np.float64], wholes: NDArray[np.float64]) -> Estimate:
    """Mean of the parts over mean of the wholes, a value a seed, with Student's interval of the
    linearised ratio (Cochran, Sampling Techniques, 1977, Sec. 6.4)."""
    whole = float(wholes.mean())
    if whole <= 0:
        return Estimate(np.nan)
    value = float(parts.mean()) / whole
    linear = value + (parts - value * wholes) / whole
    return estimates.mean_interval(linear.tolist())


def best_updates(found: pd.DataFrame, most: int = N_NEW) -> pd.DataFrame:
    """Of :func:`regained`, every model's best update with at most so many labelled samples, and its
    best without labels, by frames of all classes alike or of no touch.

    The best is the highest mean on the test samples: the choice favours models with many updates.
    """
    alike = found[found.share.isna()]
    allowed = alike[~alike.labels | (alike.n_new <= most)]
    best = allowed.groupby(["model", "labels"], sort=False).updated.idxmax()
    return allowed.loc[best.tolist()]
