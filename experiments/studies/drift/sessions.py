"""Accuracies in an old and a new session, before and after an update, from rows of drift."""

from __future__ import annotations

import numpy as np
import pandas as pd

from experiments.records.rows import unpack_labels
from experiments.reporting.measured import truths

UPDATES = {
    "stored": "not updated",
    "new": "new samples alone",
    "replace": "bits replaced, p = {:g}",
    "pooled": "old and new together",
    "balanced": "old and new, equal votes",
    "from_old": "new, from the old weights",
    "zeroed": "re-referenced, all classes alike",
    "untouched": "re-referenced, no touch",
}
SESSIONS = ("new", "old")


def with_right(rows: pd.DataFrame) -> pd.DataFrame:
    """The rows with ``right_new`` and ``right_old``, counted from what was predicted."""
    labels = truths(rows, ("seed",))
    new, old = [], []
    for text, truth, first in zip(rows.predicted, labels, rows.n_test_new, strict=True):
        right = unpack_labels(text) == truth
        new.append(int(right[:first].sum()))
        old.append(int(right[first:].sum()))
    return rows.assign(right_new=new, right_old=old)


def update_name(method: str, p: float | None, share: float | None) -> str:
    """An update in words; `share` is that of one class among the unlabelled frames, None or NaN
    where all classes have the same."""
    if share is None or np.isnan(share):
        return UPDATES[method].format(p)
    return f"re-referenced, {100 * share:g} % of one class"


def accuracies(rows: pd.DataFrame) -> pd.DataFrame:
    """Accuracy of each sensor.

    Returns:
        DataFrame: ``model``, ``method``, ``p``, ``share``, ``update`` (the three in words),
        ``n_new`` (0 for the stored model), ``seed``; accuracies ``new`` and ``old`` by session.
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
    keys = ["model", "method", "p", "share", "update", "n_new", "seed"]
    return shares[[*keys, *SESSIONS]]
