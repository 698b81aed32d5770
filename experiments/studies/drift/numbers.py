"""How much of what a drift costs each update wins back, from the rows of the study."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd

from experiments.reporting import estimates
from experiments.reporting.estimates import Estimate
from experiments.studies.drift.sessions import SESSIONS, accuracies

N_NEW = 50  # at which the paper reports the recovered accuracy
UNLABELLED = ("zeroed", "untouched")


def regained(rows: pd.DataFrame) -> pd.DataFrame:
    """How much of what a drift costs each update wins back, in the new session.

    Args:
        rows: of the study, of one scene.

    Returns:
        DataFrame, one row for each ``order``, ``model``, ``update`` and ``n_new``: ``method``,
        ``share``, ``labels`` (whether the update needs them), and as fractions, each with its 95 %
        interval over seeds under ``_low`` and ``_high``: ``before``, the accuracy of the stored
        model in the old session, ``stored`` in the new one, ``updated`` and ``old`` of the updated
        model in the new and in the old one, ``lost`` = before − stored, and ``regained`` =
        (updated − stored)/lost, a ratio of means.
    """
    n_new, n_old = (int(rows[f"n_test_{name}"].iloc[0]) for name in SESSIONS)
    lines: list[dict[str, Any]] = []
    for (order, model), part in accuracies(rows).groupby(
        ["order", "model"], sort=False
    ):
        stored = part[part.method == "stored"].set_index("seed")
        updated = part[part.method != "stored"]
        keys = ["method", "update", "share", "n_new"]
        for key, way in updated.groupby(keys, sort=False, dropna=False):
            after = way.set_index("seed").new
            at = stored.loc[after.index]
            lost = at.old - at.new
            gained = after - at.new
            line: dict[str, Any] = {"order": order, "model": model}
            line |= dict(zip(keys, key, strict=True))
            line["labels"] = key[0] not in UNLABELLED
            line |= estimates.mean_share(at.old.tolist(), n_old).columns("before")
            line |= estimates.mean_share(at.new.tolist(), n_new).columns("stored")
            line |= estimates.mean_share(after.tolist(), n_new).columns("updated")
            line |= estimates.mean_share(way.old.tolist(), n_old).columns("old")
            line |= estimates.mean_interval(lost.tolist()).columns("lost")
            line |= ratio(gained, lost).columns("regained")
            lines.append(line)
    return pd.DataFrame(lines)


def ratio(parts: pd.Series, wholes: pd.Series) -> Estimate:
    """Mean of the parts over mean of the wholes, a value a seed, with Student's interval of the
    linearised ratio (Cochran, Sampling Techniques, 1977, Sec. 6.4)."""
    whole = float(wholes.mean())
    if whole <= 0:
        return Estimate(np.nan)
    value = float(parts.mean()) / whole
    linear = value + (parts - value * wholes) / whole
    return estimates.mean_interval(linear.tolist())


def best_updates(found: pd.DataFrame, most: int = N_NEW) -> pd.DataFrame:
    """Of :func:`regained`, every model's best update in the order of time with at most so many
    labelled samples, and its best without labels, by frames of all classes alike or of no touch.

    The best is the highest mean on the test samples: the choice favours models with many updates.
    """
    in_time = found[(found.order == "time") & found.share.isna()]
    allowed = in_time[~in_time.labels | (in_time.n_new <= most)]
    best = allowed.groupby(["model", "labels"], sort=False).updated.idxmax()
    return allowed.loc[best.tolist()]
