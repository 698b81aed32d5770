"""Accuracies in an old and a new session, before and after an update, from lines of drift."""

from __future__ import annotations

import numpy as np
import pandas as pd

from experiments.records.rows import unpack_labels

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


def update_name(method: str, p: float | None, share: float | None) -> str:
    """An update in words; `share` is that of one class among the unlabelled frames, None or NaN
    where all classes have the same."""
    if share is None or np.isnan(share):
        return UPDATES[method].format(p)
    return f"re-referenced, {100 * share:g} % of one class"


def accuracies(lines: pd.DataFrame) -> pd.DataFrame:
    """The lines with the accuracy of each sensor.

    Returns:
        DataFrame: the lines with ``share``, NaN where it was not measured, ``update`` (``method``,
        ``p`` and ``share`` in words) and the accuracies ``new`` and ``old`` by session; ``n_new``
        is 0 for the stored model.
    """
    lines = lines.assign(share=lines.get("share", np.nan))
    names = map(update_name, lines.method, lines.p, lines.share)
    new, old = [], []
    answers = zip(lines.labels, lines.predicted, lines.n_test_new, strict=True)
    for labels, predicted, first in answers:
        right = unpack_labels(labels) == unpack_labels(predicted)
        new.append(right[:first].mean())
        old.append(right[first:].mean())
    return lines.assign(update=list(names), new=new, old=old)
