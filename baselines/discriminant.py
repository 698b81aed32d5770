"""Discriminant analysis of grey values: what HDC's read-outs ``lda`` and ``kernel`` do with bits.

The problem and its closed forms are described in :mod:`hdc.readouts.discriminant`. The linear form
has the products of the frames as G, and shrinks the covariance in the same way. The form with a
kernel has G = exp(−d/(s·m)), for Euclidean distances d between frames and their median m.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np
from torch import Tensor

from baselines import products
from baselines.bank import Bank, squared_lengths, standardised
from baselines.base import Classifier, FrameSource
from baselines.linear import DualLinearClassifier
from baselines.products import Moments
from baselines.smoothing import smoothed
from hdc.parameters import check_choice
from hdc.readouts.discriminant import Problem
from hdc.readouts.kernel import fewest_errors, likeness
from hdc.readouts.lda import LDA, shrunken

PIXELS = ("raw", "standardised")


@dataclass(kw_only=True, eq=False)
class GreysLDA(DualLinearClassifier):
    """Shrinkage discriminant analysis of grey values; its weights are not rounded.

    Args:
        pixels: ``raw``; or ``standardised``: each frame first has mean 0 and deviation 1.
        smooth: deviation in pixels of a Gaussian that smooths frames first; 0 for none.
        shrinkage: as in :class:`hdc.readouts.LDA`.
    """

    pixels: str = "standardised"
    smooth: int = 0
    shrinkage: float | str = "ledoit_wolf"

    revision: ClassVar[int] = 1

    def start(self, frames: FrameSource, labels: np.ndarray) -> Tensor:
        check_choice("pixels", self.pixels, PIXELS)
        LDA(self.shrinkage).check()
        return super().start(frames, labels)

    def take(self, frames: FrameSource, index: slice | Tensor) -> Tensor:
        return smoothed(super().take(frames, index), self.smooth)

    def _solved(self, bank: Bank, *given: Any) -> tuple[Tensor, float]:
        return super()._solved(bank.smoothed(self.smooth), *given)

    def solve(self, gram: Tensor, targets: Tensor) -> tuple[Tensor, Tensor, float]:
        """A [N, L], b [L], and 0 in the place of the loss, which there is none of."""
        height, width = self.shape_
        problem = Problem.of(gram.clone(), targets)
        _, solution = shrunken(problem, height * width, self.shrinkage)
        return solution.dual, solution.offsets, 0.0


@dataclass(kw_only=True, eq=False)
class GreysKernel(Classifier):
    """Discriminant analysis with a kernel of Euclidean distances; it keeps all training frames.

    Args:
        pixels: as in :class:`GreysLDA`.
        scales, penalties: as in :class:`hdc.readouts.Kernel`, chosen by leave-one-out.

    Attributes:
        frames_: the training frames [N, D].
        dual_, offsets_: float64 [N, L] and [L].
        reach_: s·m, the distance at which the kernel is 1/e.
    """

    pixels: str = "standardised"
    scales: Sequence[float] = (1, 2, 0.5, 0.25)
    penalties: Sequence[float] = (0.1, 0.3, 0.03)

    revision: ClassVar[int] = 1
    prediction_batch: ClassVar[int] = 500  # each batch reads all training frames once

    def train(
        self, frames: FrameSource, labels: np.ndarray
    ) -> Iterator[dict[str, float]]:
        """Solve; yields once: samples_seen = N."""
        targets = self.start(frames, labels)
        self.frames_ = self.read(frames, slice(0, len(frames))).flatten(1)
        self._moments = products.moments(self.frames_)
        greys = products.cross_products(self.frames_, self.frames_)
        self._solve(greys, self._moments, targets)
        yield {"samples_seen": len(frames)}

    def start(self, frames: FrameSource, labels: np.ndarray) -> Tensor:
        check_choice("pixels", self.pixels, PIXELS)
        return super().start(frames, labels)

    def scores(self, batch: Tensor) -> Tensor:
        """The discriminants, float64 [n, L]."""
        images = batch.flatten(1)
        greys = products.cross_products(images, self.frames_)
        return self._scores(greys, products.moments(images), self._moments)

    def predict_from(
        self, bank: Bank, train: np.ndarray, queries: np.ndarray
    ) -> np.ndarray:
        """See :func:`experiments.protocol.evaluate.evaluate`."""
        model = replace(self)
        targets = model.start(bank.at(train), bank.labels[train])
        known, asked = bank.moments.of(train), bank.moments.of(queries)
        model._solve(bank.greys[np.ix_(train, train)], known, targets)
        scores = model._scores(bank.greys[np.ix_(queries, train)], asked, known)
        return model.classes_[scores.argmax(1).numpy(force=True)]

    def state_tensors(self) -> dict[str, Tensor]:
        """frames [N, D], dual [N, L] and offsets [L]."""
        return {"frames": self.frames_, "dual": self.dual_, "offsets": self.offsets_}

    def _solve(self, greys: Tensor, moments: Moments, targets: Tensor) -> None:
        distances = self._distances(greys, moments, moments).cpu()
        distances.fill_diagonal_(0.0)
        best = fewest_errors(distances, targets.cpu(), self.scales, self.penalties)
        self.dual_, self.offsets_, _ = best.solution
        self.reach_ = best.reach

    def _scores(self, greys: Tensor, rows: Moments, columns: Moments) -> Tensor:
        near = likeness(self._distances(greys, rows, columns), self.reach_)
        return near @ self.dual_.to(near.device) + self.offsets_.to(near.device)

    def _distances(self, greys: Tensor, rows: Moments, columns: Moments) -> Tensor:
        """Euclidean distances [n, N] from products and moments of the grey values."""
        if self.pixels == "raw":
            squares = rows.second[:, None] + columns.second - 2 * greys
        else:
            height, width = self.shape_
            n = height * width
            across = standardised(greys, rows, columns, n)
            ours, theirs = squared_lengths(rows, n), squared_lengths(columns, n)
            squares = ours[:, None] + theirs - 2 * across
        return squares.clamp_(min=0).sqrt_()
