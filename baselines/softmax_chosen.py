"""Converged softmax regression, with the penalty that cross-validation chooses.

The folds are those by which HDC's form is chosen (:mod:`hdc.selection`), on the same training
frames, by group where the frames have groups.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
from torch import Tensor

from baselines.base import Classifier, FrameSource
from baselines.softmax_dual import DualSoftmaxRegression
from hdc.bank import Bank
from hdc.selection import Frames, Method, cross_validate, folds, in_bank


@dataclass(frozen=True)
class _Penalty:
    """Softmax regression with one C, as what is compared in the folds."""

    pixels: str
    C: float

    @property
    def name(self) -> str:
        return f"C = {self.C:g}"

    def model(self) -> DualSoftmaxRegression:
        return DualSoftmaxRegression(pixels=self.pixels, C=self.C)

    def answers(
        self, frames: Frames, train: np.ndarray, test: np.ndarray
    ) -> np.ndarray:
        return self.model().predict_from(frames.bank, train, test)


@dataclass(kw_only=True, eq=False)
class ChosenSoftmaxRegression(Classifier):
    """Softmax regression whose C has the least error in the folds, the first of equal ones.

    Args:
        pixels: as of :class:`baselines.softmax_dual.DualSoftmaxRegression`.
        choices: of C, the one for frames without folds (a class has one frame) first.

    Attributes:
        model_: the classifier with the chosen C, trained.
    """

    pixels: str = "unit"
    choices: Sequence[float] = (1.0, 0.01, 0.1, 10.0, 100.0)

    revision: ClassVar[int] = 1

    def train(
        self, frames: FrameSource, labels: np.ndarray
    ) -> Iterator[dict[str, float]]:
        """Choose and solve; yields once: samples_seen = N, epoch = 1 and the loss."""
        targets = self.start(frames, labels).cpu().numpy()
        bank, rows = in_bank(frames, targets)
        chosen = self._choose(bank, rows)
        self.model_ = replace(chosen, device=self.device)
        yield from self.model_.train(frames, labels)

    def scores(self, batch: Tensor) -> Tensor:
        """W·x + b, float32 [n, L]."""
        return self.model_.scores(batch)

    def predict_from(
        self, bank: Bank, train: np.ndarray, queries: np.ndarray
    ) -> np.ndarray:
        """See :func:`experiments.protocol.evaluate.evaluate`."""
        model = self._choose(bank, train)
        return model.predict_from(bank, train, queries)

    @property
    def scale_(self) -> float:
        return self.model_.scale_

    def state_tensors(self) -> dict[str, Tensor]:
        """weight [L, D] and bias [L]."""
        return self.model_.state_tensors()

    def _choose(self, bank: Bank, rows: np.ndarray) -> DualSoftmaxRegression:
        tried = [_Penalty(self.pixels, c) for c in self.choices]
        best: Method = tried[0]
        frames = Frames(bank, (), (), bank.groups, None)
        made, _ = folds(frames, rows)
        if made:
            best = cross_validate(tried, frames, made).best(_Penalty) or best
        assert isinstance(best, _Penalty)
        return best.model()
