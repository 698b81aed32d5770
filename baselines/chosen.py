"""Models that choose their form among a few, by cross-validation on their training frames alone.

Candidates are in order, the simplest first. The first is chosen that is worse than the best by no
more than a margin, in standard errors of the paired differences between the two (the rule of one
standard error: Breiman et al., Classification and Regression Trees (1984), 3.4.3).
"""

from __future__ import annotations

import copy
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
import torch
from torch import Tensor

from baselines import library
from baselines.bank import Bank, Rows
from baselines.base import Classifier, FrameSource
from baselines.folds import folds
from hdc import HDCClassifier
from hdc.parameters import check_choice, is_number


@dataclass(kw_only=True, eq=False)
class Chosen(Classifier):
    """The simplest of several models than which no other is clearly better.

    Folds keep frames of one group together.

    Args:
        forms: untrained models by name, the simplest first; all of them are computed from a bank
            (:func:`baselines.library.has_predict_from`).
        fixed: name of the form that is taken where there are no folds, because a class has one
            frame or one group.
        folds: how many at most, from 2; fewer where a class has fewer frames, or groups.
        margin: in standard errors; 0 takes the form of least error, the first of equal ones.

    Attributes:
        form_: name of the form that was chosen.
        model_: that model, trained.
    """

    forms: Mapping[str, Any]
    fixed: str
    folds: int = 5
    margin: float = 1.0

    revision: ClassVar[int] = 2
    prediction_batch: ClassVar[int] = 500

    def choose(self, bank: Bank, train: np.ndarray) -> tuple[str, Any]:
        """The name of the form for some frames of a bank, and that model, untrained.

        Raises:
            ValueError: naming the field that is wrong.
        """
        check_choice("fixed", self.fixed, tuple(self.forms))
        if not is_number(self.margin) or self.margin < 0:
            raise ValueError(f"margin: expected 0 or more, found {self.margin!r}")
        losses = self._losses(bank, train)
        name = simplest(losses, self.margin) if losses else self.fixed
        return name, copy.deepcopy(self.forms[name])

    def _losses(self, bank: Bank, rows: np.ndarray) -> dict[str, np.ndarray]:
        """1 for each wrong answer of all folds and 0 for each right one, by form; empty without
        folds."""
        made, _ = folds(bank.labels, rows, self.folds, bank.groups)
        losses: dict[str, list[np.ndarray]] = {name: [] for name in self.forms}
        for train, test in made:
            for name, model in self.forms.items():
                answers = library.predict_from(model, bank, train, test)
                losses[name].append((answers != bank.labels[test]).astype(float))
        return {name: np.concatenate(each) for name, each in losses.items() if each}

    def train(
        self, frames: FrameSource, labels: np.ndarray
    ) -> Iterator[Mapping[str, float]]:
        """Choose and learn; yields as the chosen model does."""
        targets = self.start(frames, labels).cpu().numpy()
        groups = None
        if isinstance(frames, Rows):
            groups = frames.bank.groups_of(frames.rows)
        images = self.take(frames, slice(0, len(frames))).cpu()
        bank = Bank(images, targets, len(self.classes_), groups)
        self.form_, self.model_ = self.choose(bank, np.arange(len(bank)))
        yield from library.train(self.model_, images, targets)

    def predict(self, frames: Any) -> np.ndarray:
        """See :meth:`baselines.base.Classifier.predict`."""
        frames = self.queries(frames)
        found = [np.empty(0, np.int64)]
        for start in range(0, len(frames), self.prediction_batch):
            rows = slice(start, start + self.prediction_batch)
            found.append(self.model_.predict(self.take(frames, rows)))
        return self.classes_[np.concatenate(found)]

    def scores(self, batch: Tensor) -> Tensor:
        """Scores of the chosen model; HDC has two columns for two classes, too."""
        if not isinstance(self.model_, HDCClassifier):
            return self.model_.scores(batch)
        found = torch.from_numpy(self.model_.decision_function(batch))
        return found if found.ndim == 2 else torch.stack([-found, found], 1)

    def predict_from(
        self, bank: Bank, train: np.ndarray, queries: np.ndarray
    ) -> np.ndarray:
        """See :func:`experiments.protocol.evaluate.evaluate`."""
        _, model = self.choose(bank, train)
        return library.predict_from(model, bank, train, queries)

    def state_tensors(self) -> dict[str, Tensor] | None:
        """Tensors of the chosen model."""
        return library.state_tensors(self.model_)


def simplest(losses: Mapping[str, np.ndarray], margin: float) -> str:
    """The first name whose losses [n] are no worse than the least by more than the margin.

    Args:
        losses: of the same frames, by name, the simplest first.
        margin: in standard errors of the mean of the paired differences.
    """
    best = min(losses.values(), key=lambda own: own.mean())

    def is_close(own: np.ndarray) -> bool:
        more = own - best
        error = more.std(ddof=1) / np.sqrt(len(more))
        return bool(more.mean() <= margin * error)

    return next(name for name, own in losses.items() if is_close(own))
