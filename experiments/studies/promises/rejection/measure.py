"""Rejection of unknown frames, where whole groups are held out.

In each draw some classes are left out in turn. A model learns the others; test frames of the class
that is left out are unknown. Known test frames are of groups, such as objects, sessions or
positions, of which no frame trains, and the model knows the groups of its training frames. So the
share of known frames that are refused should be about the share that was asked for.

Which data sets were used when the rule of :mod:`hdc.rejection` was chosen is not recorded, so none
of these numbers is confirmatory.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
import pandas as pd
from sklearn.metrics import roc_auc_score

from baselines import library
from baselines.bank import Bank
from experiments.protocol.data import at_seed
from experiments.protocol.evaluate import bank_of
from experiments.protocol.model import models_of
from experiments.protocol.settings import Split
from experiments.protocol.task import Context, Row
from experiments.studies.promises.values.measure import Drawn, of_classes
from hdc import HDCClassifier
from scenes.frames import Scene


class Rejection(Drawn, frozen=True):
    """One row: a model that has not learned the class ``left_out``, in one draw.

    Lists over groups of known test frames: the ``group``, its number of ``known`` frames, and how
    many of them are ``refused``. Numbers: ``unknown`` test frames, and how many of them are
    refused (``unknown_refused``); the ``area`` under the curve of unknown against known frames by
    the distance that :meth:`hdc.HDCClassifier.is_known` compares, and by the largest class score of
    the read-out (``area_of_scores``). An area is 1 if all unknown frames are farther than all known
    ones, and 0.5 by chance.
    Arguments: configs/experiment/rejection.yaml.

    Raises:
        ValueError: naming the key that is wrong.
    """

    split: Split
    models: Mapping[str, Any]
    n_per_class: int
    n_left_out: int
    alpha: float | int

    def rows(self, context: Context) -> Iterator[Row]:
        if self.split.group is None:
            raise ValueError(
                "split.kind: expected grouped or leave_group_out, with a split.group, found "
                f"{self.split.kind!r}; name a scene whose split has groups"
            )
        models = models_of(at_seed(self.models, 0))
        for recording, row, pool, test in self.parts(context, {"counts": self.split}):
            train, n = of_classes(recording, row, pool, self.n_per_class)
            chosen = np.concatenate([train, test])
            bank = bank_of(recording, chosen)
            groups = groups_of(recording, self.split)[chosen]
            row |= {"n": n, "alpha": self.alpha}
            # Those after the ones that the draw before has left out.
            first = row["draw"] * self.n_left_out
            for k in range(min(self.n_left_out, bank.n_classes)):
                left_out = (first + k) % bank.n_classes
                row["left_out"] = recording.classes[left_out]
                for name, model in models.items():
                    given = bank, groups, len(train), left_out, self.alpha
                    yield {**row, "model": name, **answers(model, *given)}


def groups_of(scene: Scene, split: Split) -> np.ndarray:
    """The group of each sample, int64 [N]. Where each class draws its test groups for itself,
    groups of two classes with one name are two."""
    _, groups = np.unique(scene.samples[split.group or ""], return_inverse=True)
    if split.kind == "leave_group_out":
        groups = groups + (1 + groups.max()) * scene.labels
    return groups


def answers(
    model: HDCClassifier,
    bank: Bank,
    groups: np.ndarray,
    n_train: int,
    left_out: int,
    alpha: float,
) -> Row:
    """Known and unknown frames that a model refuses, and how well it tells them apart.

    Args:
        model: left as it is; one like it is trained.
        bank: training frames, then test frames.
        groups: the group of each of them, int64 [N].
        n_train: number of training frames; the class `left_out` is not learned.
        left_out: the class whose test frames are unknown.
        alpha: share of known frames that may be refused.
    """
    train = np.flatnonzero(bank.labels[:n_train] != left_out)
    test = np.arange(n_train, len(bank))
    fitted = HDCClassifier(**model.get_params(deep=False))
    words = library.words_of(model, bank, train, train)
    fitted.fit(words, bank.labels[train], groups[train])
    asked = library.words_of(model, bank, test, train)
    refused = ~fitted.is_known(asked, alpha)
    head = fitted._head
    distances = head.rejection.nearest(asked.packed).numpy(force=True)
    scores = head.scores(asked).amax(1).numpy(force=True)
    unknown = bank.labels[test] == left_out
    of_groups = pd.Series(refused[~unknown]).groupby(groups[test[~unknown]])
    counts = of_groups.agg(["size", "sum"])
    return {
        "group": counts.index.tolist(),
        "known": counts["size"].tolist(),
        "refused": counts["sum"].tolist(),
        "unknown": int(unknown.sum()),
        "unknown_refused": int(refused[unknown].sum()),
        "area": float(roc_auc_score(unknown, distances)),
        "area_of_scores": float(roc_auc_score(unknown, -scores)),
    }
