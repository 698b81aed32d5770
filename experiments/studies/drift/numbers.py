"""Numbers of the study of drift, of its rows: accuracies, and the share of the loss regained."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd

from experiments.records.rows import unpack_labels
from experiments.reporting import estimates
from experiments.reporting.estimates import Estimate

N_NEW = 50  # at which the paper reports the recovered accuracy
UPDATES = {
    "stored": "not updated",
    "new": "new samples alone",
    "replace": "bits replaced, p = {:g}",
    "pooled": "old and new together",
    "balanced": "old and new, equal votes",
    "from_old": "new, from the old weights",
    "zeroed": "re-zeroed, all classes alike",
    "untouched": "re-zeroed, nobody touches",
}
UNLABELLED = ("zeroed", "untouched")
SESSIONS = ("new", "old")


def with_right(rows: pd.DataFrame) -> pd.DataFrame:
    """The rows with ``right_new`` and ``right_old``, counted from what was predicted; rows of
    version 1.0 have the counts themselves."""
    if "predicted" not in rows:
        return rows
    draws = rows.groupby(["seed", "order"]).labels
    labels = draws.transform("first").map(unpack_labels)
    new, old = [], []
    for text, truth, first in zip(rows.predicted, labels, rows.n_test_new, strict=True):
        right = unpack_labels(text) == truth
        new.append(int(right[:first].sum()))
        old.append(int(right[first:].sum()))
    return rows.assign(right_new=new, right_old=old)


def update_name(method: str, p: float | None, share: float | None) -> str:
    """An update in words."""
    if method == "zeroed" and share == share and share is not None:
        if share == 1:
            return "re-zeroed, one class only"
        return f"re-zeroed, {100 * share:g} % of one class"
    return UPDATES[method].format(p)


def accuracies(rows: pd.DataFrame) -> pd.DataFrame:
    """Accuracy of each sensor, mean over draws.

    Returns:
        DataFrame: ``order``, ``model``, ``method``, ``p``, ``share``, ``update`` (the three in
        words), ``n_new`` (0 for the stored model), ``seed``; accuracies ``new`` and ``old`` by
        session.
    """
    rows = with_right(rows)
    if "share" not in rows:
        rows = rows.assign(share=np.nan)
    ways = zip(rows.method, rows.p, rows.share, strict=True)
    shares = rows.assign(
        new=rows.right_new / rows.n_test_new,
        old=rows.right_old / rows.n_test_old,
        update=[update_name(*way) for way in ways],
    )
    keys = ["order", "model", "method", "p", "share", "update", "n_new", "seed"]
    by_seed = shares.groupby(keys, sort=False, dropna=False)
    return by_seed[list(SESSIONS)].mean().reset_index()


def regained(rows: pd.DataFrame) -> pd.DataFrame:
    """How much of what a drift costs each update wins back, in the new session.

    Args:
        rows: of the study, of one scene.

    Returns:
        DataFrame, one row for each ``order``, ``model``, ``update`` and ``n_new``: ``method``,
        ``share``, ``labels`` (whether the update needs them), and as fractions, each with its 95 %
        interval over seeds under ``_low`` and ``_high``: ``before``, the accuracy of the stored
        model in the old session, ``stored`` in the new one, ``updated`` of the updated model in the
        new one, ``lost`` = before − stored, and ``regained`` = (updated − stored)/lost, a ratio of
        means.
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
