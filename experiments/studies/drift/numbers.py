"""How much of what a drift costs each update wins back, from the lines of the study."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd

from experiments.records.results import own_frames
from experiments.records.rows import unpack_labels
from experiments.reporting import estimates

N_NEW = 50  # at which the paper reports the recovered accuracy
N_ZERO = 30  # frames without labels, of the figure
KEYS = ["scene", "model", "method", "update", "share", "n_new", "p", "origin"]
UPDATES = {
    "stored": "not updated",
    "new": "on new samples alone",
    "replace": "bits replaced, p = {:g}",
    "pooled": "on old and new samples together",
    "balanced": "on old and new samples, equal weights",
    "from_old": "on new samples, starting at the old weights",
    "zeroed": "re-referenced, all classes alike",
}


def update_name(method: str, p: float | None, share: float | None) -> str:
    """An update in words; `share` is that of one class among the unlabelled frames, None or NaN
    where all classes have the same."""
    if share is None or np.isnan(share):
        return UPDATES[method].format(p)
    return f"re-referenced, {100 * share:g} % of one class"


def accuracies(lines: pd.DataFrame) -> pd.DataFrame:
    """The lines of :data:`UPDATES` with the accuracy of each sensor.

    Returns:
        DataFrame: the lines with ``update`` (``method``, ``p`` and ``share`` in words), and by
        session the right answers ``right_new`` and ``right_old`` and the accuracies ``new`` and
        ``old``; ``n_new`` is 0 for the stored model.
    """
    lines = lines[lines.method.isin(UPDATES)]
    names = map(update_name, lines.method, lines.p, lines.share)
    right_new, right_old = [], []
    answers = zip(lines.labels, lines.predicted, lines.n_test_new, strict=True)
    for labels, predicted, n_new in answers:
        right = unpack_labels(labels) == unpack_labels(predicted)
        right_new.append(int(right[:n_new].sum()))
        right_old.append(int(right[n_new:].sum()))
    return lines.assign(
        update=list(names),
        right_new=right_new,
        right_old=right_old,
        new=right_new / lines.n_test_new,
        old=right_old / lines.n_test_old,
    )


def regained(frame: pd.DataFrame) -> pd.DataFrame:
    """How much of what a drift costs each update wins back, in the new session.

    Returns:
        DataFrame, one row for each ``scene``, ``model``, ``update`` and ``n_new``, that of the
        stored model included: ``method``,
        ``p``, ``share``, ``labels`` (whether the update needs them), and as fractions, each with
        its 95 % interval over seeds under ``_low`` and ``_high``: ``before``, the accuracy of the
        stored model in the old session, ``stored`` in the new one, ``updated`` and ``old`` of the
        updated model in the new and in the old one.
    """
    every = accuracies(frame)
    of_sensor = ["scene", "model", "seed"]
    stored = every.loc[every.method == "stored", [*of_sensor, "new", "old"]]
    updated = every.merge(
        stored, on=of_sensor, suffixes=("", "_stored"), validate="m:1"
    )
    lines = []
    for key, way in updated.groupby(KEYS, sort=False, dropna=False):
        first = way.iloc[0]
        line: dict[str, Any] = dict(zip(KEYS, key, strict=True))
        line["labels"] = first.method != "zeroed"
        for name, (shares, n) in {
            "before": (way.old_stored, first.n_test_old),
            "stored": (way.new_stored, first.n_test_new),
            "updated": (way.new, first.n_test_new),
            "old": (way.old, first.n_test_old),
        }.items():
            line |= estimates.mean_share(shares.tolist(), n).columns(name)
        line["seeds"] = len(way)
        line["n_classes"] = len(np.unique(unpack_labels(first.labels)))
        lines.append(line)
    return pd.DataFrame(lines)


def best(rows: pd.DataFrame, *by: str) -> pd.DataFrame:
    """The rows with the highest mean on the test samples, which favours models with many updates;
    one for each combination of values of some columns."""
    return rows.loc[rows.groupby(list(by), sort=False).updated.idxmax()]


def best_updates(frame: pd.DataFrame) -> pd.DataFrame:
    """The rows of :func:`regained` with the best update of each model: with at most :data:`N_NEW`
    labelled samples, and without labels, by equally many frames of all classes."""
    found = regained(frame)
    few = ~found.labels | (found.n_new <= N_NEW)
    is_allowed = (found.n_new > 0) & found.share.isna() & few
    return best(found[is_allowed], "scene", "model", "labels")


def recalibrated(frame: pd.DataFrame) -> pd.DataFrame | None:
    """Updates with labels, rows of :func:`regained`, on the experiment's own scene, which is the
    paper's, or else on the first scene. None where HDC was not updated.

    Returns:
        DataFrame: ``panel`` is ``shares`` for HDC by the share p of its bits that are replaced, 1
        where new samples stand alone; ``models`` for the update of each model that is the best
        after :data:`N_NEW` samples. Models that are updated without labels are left out.
    """
    own = own_frames(frame)
    found = regained(own if len(own) else frame[frame.scene == frame.scene.iloc[0]])
    of_hdc = found[(found.model == "hdc") & found.method.isin(("new", "replace"))]
    if not len(of_hdc):
        return None
    labelled = found[~found.model.isin(found.model[~found.labels])]
    of_models = best(labelled[labelled.n_new == N_NEW], "model")[["model", "update"]]
    shares = of_hdc.fillna({"p": 1}).assign(panel="shares")
    return pd.concat([shares, of_models.merge(labelled).assign(panel="models")])


def unlabelled(frame: pd.DataFrame) -> pd.DataFrame:
    """Rows of :func:`regained`: models re-referenced by :data:`N_ZERO` frames without labels, and
    the updates that these are compared with.

    Returns:
        DataFrame: ``way`` is ``stored`` before the update, ``alike`` with frames of all classes
        alike, ``one_class`` of one class alone, ``new`` after training on :data:`N_NEW` labelled
        frames alone.
    """
    found = regained(frame)
    referenced = found[found.model.isin(found.model[~found.labels])]
    zeroed = referenced[~referenced.labels & (referenced.n_new == N_ZERO)]
    new = referenced[(referenced.method == "new") & (referenced.n_new == N_NEW)]
    ways = {
        "stored": referenced[referenced.method == "stored"],
        "alike": zeroed[zeroed.share.isna()],
        "one_class": zeroed[zeroed.share == 1],
        "new": new,
    }
    return pd.concat([rows.assign(way=way) for way, rows in ways.items()])
