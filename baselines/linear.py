"""Linear classifiers that are solved in the space of samples instead of the space of pixels.

The weights that minimise any loss with an L2 penalty are combinations of the training frames,
W = Aᵀ·X (representer theorem), so a problem of D pixels becomes one of N samples, given by the
inner products of the frames (:class:`baselines.bank.Bank`).
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
import torch
from torch import Tensor

from baselines.bank import Bank
from baselines.base import (
    Classifier,
    FrameSource,
    arithmetic,
    first_of_the_best,
)
from baselines.pixels import scaling

FRAMES = 20  # turned into floats at a time


@dataclass(kw_only=True, eq=False)
class DualLinearClassifier(Classifier):
    """A linear classifier whose subclass writes ``solve``.

    All N frames are held at once, as bytes. One pass over them makes K, a second the weights.

    Args:
        pixels: one of the scalings in baselines.pixels, by name.
        device: where it is computed; needs float64.

    Attributes:
        weight_: float32 [L, D], for pixels as the camera gives them; for ``standardised`` for the
            scaled pixels.
        bias_: float32 [L].
        coefficients_: A, float64 [N, L], each column summing to zero.
    """

    pixels: str = "unit"

    @abstractmethod
    def solve(
        self,
        gram: Tensor,
        targets: Tensor,
    ) -> tuple[Tensor, Tensor, float]:
        """A [N, L], b [L] and the loss from the centred K float64 [N, N] and class indices
        int64 [N]."""

    def train(
        self, frames: FrameSource, labels: np.ndarray
    ) -> Iterator[dict[str, float]]:
        """Solve; yields once: samples_seen = N, epoch = 1 and the loss."""
        targets = self.start(frames, labels)
        images = self.take(frames, slice(0, len(frames)))
        everyone = np.arange(len(frames))
        bank = Bank(images, targets, len(self.classes_))
        gram, _ = bank.centred(everyone, everyone[:0], self.pixels)
        coefficients, bias, loss = self.solve(gram, targets)
        # With columns that sum to exactly zero, the mean frame has no part in the weights.
        self.coefficients_ = coefficients - coefficients.mean(dim=0)
        self._scale = _scale(gram, self.coefficients_, bias)
        in_weights = self.pixels == "unit"  # the factor of all pixels
        known = "raw" if in_weights else self.pixels
        self._scaling = scaling(known, self.frame_dtype_)
        sums = self._combine(images)
        self.weight_ = sums[:-1].mul_((1 / bank.white) ** 2 if in_weights else 1.0)
        self._mean = sums[-1]
        of_mean = self.weight_.double() @ self._mean.double()
        self.bias_ = (bias - of_mean).float()
        yield {"samples_seen": len(frames), "epoch": 1.0, "loss": loss}

    def _combine(self, images: Tensor) -> Tensor:
        """Weights [L, D], and the mean scaled frame [D] below them, in one pass over the frames."""
        n = len(images)
        mean = self.coefficients_.new_full((n, 1), 1 / n)
        columns = torch.cat([self.coefficients_, mean], dim=1)
        combine = columns.T.float().contiguous()
        dimension = images[0].numel()
        sums = torch.zeros(len(combine), dimension, device=images.device)
        for start in range(0, n, FRAMES):
            rows = slice(start, start + FRAMES)
            scaled = self._scaling(arithmetic(images[rows])).flatten(1)
            sums.addmm_(combine[:, rows], scaled)
        return sums

    def scores(self, batch: Tensor) -> Tensor:
        """W·x + b, float32 [n, L]."""
        scaled = self._scaling(batch).flatten(1)
        return torch.addmm(self.bias_, scaled, self.weight_.T)

    def predict_from(
        self, bank: Bank, train: np.ndarray, queries: np.ndarray
    ) -> np.ndarray:
        """See :func:`experiments.protocol.evaluate.evaluate`."""
        solver = replace(self)
        targets = solver.start(bank.at(train), bank.labels[train])
        scores, scale = solver._solved(bank, train, targets, queries)
        best = first_of_the_best(scores, scale)
        return solver.classes_[best.numpy(force=True)]

    def predict_zeroed(
        self,
        bank: Bank,
        train: np.ndarray,
        queries: np.ndarray,
        before: np.ndarray,
        after: np.ndarray,
    ) -> np.ndarray:
        """Labels [Q] of queries minus a reference frame, which differs from the one of training.

        The reference of training is the mean of the scaled frames `before`, the reference of the
        queries the mean of the frames `after`; all are indices of frames. A score is linear in the
        frame, so only the scores of the references are needed.
        """
        solver = replace(self)
        targets = solver.start(bank.at(train), bank.labels[train])
        asked = np.concatenate([queries, before, after])
        scores, scale = solver._solved(bank, train, targets, asked)
        of_queries, of_before, of_after = scores.split(
            [len(queries), len(before), len(after)]
        )
        moved = of_queries + of_before.mean(0) - of_after.mean(0)
        best = first_of_the_best(moved, scale)
        return solver.classes_[best.numpy(force=True)]

    def _solved(
        self,
        bank: Bank,
        train: np.ndarray,
        targets: Tensor,
        queries: np.ndarray,
        *before: Tensor,
    ) -> tuple[Tensor, float]:
        """Scores of queries [Q, L], minus the scores before, and the size of the terms of their
        sums."""
        inside, across = bank.centred(train, queries, self.pixels)
        coefficients, bias, _ = self.solve(inside, targets, *before)
        coefficients = coefficients - coefficients.mean(dim=0)
        scale = _scale(inside, coefficients, bias)
        return across @ coefficients + bias, scale

    @property
    def scale_(self) -> float:
        return self._scale

    def state_tensors(self) -> dict[str, Tensor]:
        """weight [L, D] and bias [L]."""
        return {"weight": self.weight_, "bias": self.bias_}


class PenalisedClassifier(DualLinearClassifier):
    """A linear classifier with an L2 penalty that can update given weights.

    Its ``solve`` takes a third argument, the scores ``before`` [N, L] by these weights, and finds
    their change, with the penalty on the change alone.
    """

    def predict_from_old(
        self,
        bank: Bank,
        old: np.ndarray,
        new: np.ndarray,
        queries: np.ndarray,
    ) -> np.ndarray:
        """Labels [Q] of queries after an update of weights from samples ``old`` with samples
        ``new``: min over W of loss(new frames) + penalty·‖W − W_old‖².

        Both have every class.
        """
        scores = self.scores_from_old(bank, old, new, queries)
        best = scores.argmax(1).numpy(force=True)
        return np.unique(bank.labels[old])[best]

    def scores_from_old(
        self,
        bank: Bank,
        old: np.ndarray,
        new: np.ndarray,
        queries: np.ndarray,
    ) -> Tensor:
        """Scores float64 [Q, L] of :meth:`predict_from_old`.

        The change of the weights is a combination of the new frames, so of the old model only its
        scores of these frames are needed.
        """
        solver = replace(self)
        targets = solver.start(bank.at(old), bank.labels[old])
        asked = np.concatenate([new, queries])
        before, _ = solver._solved(bank, old, targets, asked)
        of_new, of_queries = before.tensor_split([len(new)])
        targets = solver.start(bank.at(new), bank.labels[new])
        change, _ = solver._solved(bank, new, targets, queries, of_new)
        return of_queries + change


def _scale(
    gram: Tensor,
    coefficients: Tensor,
    bias: Tensor,
) -> float:
    """Largest sum of the absolute terms in the score of a training frame."""
    parts = gram.abs() @ coefficients.abs() + bias.abs()
    return float(parts[parts.isfinite()].max())
