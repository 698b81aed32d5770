"""Classifiers computed in the space of samples instead of the space of pixels.

The weights that minimise any loss with an L2 penalty are combinations of the training frames,
W = Aᵀ·X (representer theorem), so the N×N Gram matrix K = X·Xᵀ carries the whole problem.
:class:`Products` is that matrix, exact in integers; from it a classifier is trained on any subset
of the frames. :class:`Descent` is gradient descent on it.
"""

from __future__ import annotations

import copy
import functools
from abc import abstractmethod
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
from torch import Tensor
from torch.nn import functional as F

from baselines.base import Classifier, FrameSource, choose
from baselines.integer import integer_product
from baselines.pixels import SCALINGS, PixelScaling, fit_scaling, signs

PIXELS = 32768  # columns of the frames handled at a time
FRAMES = 20  # rows turned into floats at a time
Moments = tuple[Tensor, Tensor]  # Σ x and Σ x² of each frame
KERNELS = [
    name for name in SCALINGS if name != "standard"
]  # scalings that have a Gram matrix


def cross_products(a: Tensor, b: Tensor) -> Tensor:
    """Exact Σ x·x′ over the pixels of frames [n, D] and [m, D], float64 [n, m]: uint8, or int32 for
    16-bit pixels, all less :func:`constant_of` their type; or int8."""
    products = torch.zeros(len(a), len(b), dtype=torch.float64, device=a.device)
    for start in range(0, a.shape[1], PIXELS):
        columns = slice(start, start + PIXELS)
        rights = _planes(b[:, columns])
        for weight, left in _planes(a[:, columns]):
            for other, right in rights:
                products += weight * other * integer_product(left, right.T)
    return products


def moments(images: Tensor) -> Moments:
    """Exact Σ x and Σ x² over the pixels of each frame [N, D], less :func:`constant_of` their type:
    float64 [N] each."""
    sums = []
    for rows in images.split(FRAMES):
        block = rows.int() - constant_of(images)
        sums.append(
            torch.stack([block.sum(dim=1), block.square_().sum(dim=1)]).double()
        )
    first, second = torch.cat(sums, dim=1)
    return first, second


def constant_of(images: Tensor) -> int:
    """The grey value subtracted so that a byte is signed."""
    return {torch.uint8: 128, torch.int8: 0}.get(images.dtype, 256 * 128 + 128)


def _planes(block: Tensor) -> list[tuple[int, Tensor]]:
    """Pixels less their constant as Σ weight·plane, each plane int8."""
    if block.dtype == torch.int8:
        return [(1, block.contiguous())]
    if block.dtype == torch.uint8:
        return [(1, (block ^ 128).view(torch.int8))]  # 0…255 → −128…127
    parts = (256, block >> 8), (1, block & 255)
    return [
        (weight, (part ^ 128).to(torch.uint8).view(torch.int8))
        for weight, part in parts
    ]


class Products:
    """Inner products of frames with those that may train, by every scaling of their pixels.

    Args:
        frames: uint8 or uint16 [N, H, W] or [N, D].
        labels: class indices int64 [N].
        n_classes: L.
        n_train: the first so many frames may train; all, if None.

    Example:
        >>> from baselines.ridge import RidgeReadout
        >>> frames = torch.tensor([[[0, 255]], [[255, 0]], [[9, 99]]], dtype=torch.uint8)
        >>> products = Products(frames, np.array([0, 1, 0]), n_classes=2)
        >>> products.scores(RidgeReadout(), np.array([0, 1]), np.array([2])).argmax(1)
        tensor([0])
    """

    def __init__(
        self, frames: Tensor, labels: Any, n_classes: int, n_train: int | None = None
    ) -> None:
        self.white = 255 if frames.dtype == torch.uint8 else 65535
        images = frames if frames.dtype == torch.uint8 else frames.to(torch.int32)
        self._images = images.flatten(1)
        self.dimension = self._images.shape[1]
        self.labels, self.n_classes = (
            torch.as_tensor(labels, device=frames.device),
            n_classes,
        )
        self._n_train = len(frames) if n_train is None else n_train

    @functools.cached_property
    def greys(self) -> Tensor:
        """Products of grey values less :func:`constant_of` them, float64 [N, M]."""
        return cross_products(self._images, self._images[: self._n_train])

    @functools.cached_property
    def bits(self) -> Tensor:
        """Products of hypervectors in ±1, float64 [N, M]."""
        hypervectors = signs(self._images)
        return cross_products(hypervectors, hypervectors[: self._n_train])

    @functools.cached_property
    def _moments(self) -> Moments:
        return moments(self._images)

    def moments(self, rows: np.ndarray) -> Moments:
        """:func:`moments` of some of the frames."""
        first, second = self._moments
        return first[rows], second[rows]

    def scores(self, model: Any, train: np.ndarray, queries: np.ndarray) -> Tensor:
        """Scores of queries [n] by a model trained on others: float64 [n, L], the largest wins.

        Args:
            model: one with ``scores_from``; it is left as it was.
            train: indices below ``n_train``; one that occurs k times counts k times.
            queries: indices [n].
        """
        return model.scores_from(self, train, queries)

    def kernel(
        self, train: np.ndarray, queries: np.ndarray, pixels: str = "unit"
    ) -> tuple[Tensor, Tensor]:
        """Inner products of frames in a scaling: of training frames with each other [N, N], and of
        queries with training frames [n, N]. A mean over training frames is over these."""
        choose("pixels", pixels, KERNELS)
        rows, n = np.concatenate([train, queries]), len(train)
        part = (self.bits if pixels == "bits" else self.greys)[np.ix_(rows, train)]
        ours, theirs, d = self.moments(rows), self.moments(train), self.dimension
        if pixels == "standardised":
            part = standardised(part, ours, theirs, d)
        elif pixels != "bits":
            mean = float(theirs[0].mean()) / d
            centred = pixels in ("unit_centred", "standard_global")
            offset = mean if centred else -constant_of(self._images)
            scale = 1.0 if pixels == "raw" else 1 / self.white
            if pixels == "standard_global":
                scale = (float(theirs[1].mean()) / d - mean**2) ** -0.5
            shift = offset * (ours[0][:, None] + theirs[0])
            part = scale**2 * (part - shift + offset**2 * d)
        return part[:n], part[n:]

    def centred(
        self, train: np.ndarray, queries: np.ndarray, pixels: str = "unit"
    ) -> tuple[Tensor, Tensor]:
        """:meth:`kernel` of scaled frames less the mean scaled training frame."""
        if pixels in ("raw", "unit", "unit_centred"):
            # The offset cancels: the small integers do without it, and lose nothing to it.
            scale = 1.0 if pixels == "raw" else 1 / self.white
            inside, across = (
                scale**2 * self.greys[np.ix_(x, train)] for x in (train, queries)
            )
        else:
            inside, across = self.kernel(train, queries, pixels)
        mean, square = inside.mean(0), inside.mean()
        return (
            inside - mean - mean[:, None] + square,
            across - mean - across.mean(1, keepdim=True) + square,
        )


def standardised(
    products: Tensor, rows: Moments, columns: Moments, dimension: int
) -> Tensor:
    """Products of standardised frames [n, N] from those of their greys and the moments of both."""
    s, t = (deviations(*part, dimension) for part in (rows, columns))
    return (products - torch.outer(rows[0], columns[0]) / dimension) / torch.outer(s, t)


def deviations(first: Tensor, second: Tensor, dimension: int) -> Tensor:
    """Standard deviation of the pixels of each frame, from its moments; 1 for a constant frame."""
    variance = second / dimension - (first / dimension) ** 2
    # The least variance of a frame of whole numbers that is not constant is about 1/D.
    return torch.where(variance > 0.1 / dimension, variance, 1.0).sqrt()


@dataclass(kw_only=True, eq=False)
class DualLinearClassifier(Classifier):
    """A linear classifier whose subclass writes ``solve``.

    All N frames are held at once, as bytes. One pass over them makes K, a second the weights.

    Args:
        pixels: a scaling of baselines.pixels other than ``standard``, by name.
        device: where it is computed; needs float64.

    Attributes:
        weight_: float32 [L, D], for pixels as the camera gives them; for ``standardised`` and
            ``bits`` for the scaled pixels.
        bias_: float32 [L].
        coefficients_: A, float64 [N, L], each column summing to zero.
    """

    pixels: str = "unit"

    @abstractmethod
    def solve(self, gram: Tensor, targets: Tensor) -> tuple[Tensor, Tensor, float]:
        """A [N, L], b [L] and the loss from the centred K float64 [N, N] and class indices
        int64 [N]."""

    def train(
        self, frames: FrameSource, labels: np.ndarray
    ) -> Iterator[dict[str, float]]:
        """Solve; yields once: samples_seen = N, epoch = 1 and the loss."""
        choose("pixels", self.pixels, KERNELS)
        targets = self.start(frames, labels)
        images = self.read(frames, slice(0, len(frames)))
        everyone = np.arange(len(frames))
        products = Products(images, targets, len(self.classes_))
        gram, _ = products.centred(everyone, everyone[:0], self.pixels)
        coefficients, bias, loss = self.solve(gram, targets)
        # Exactly zero-sum columns leave the mean frame no part in the weights.
        self.coefficients_ = coefficients - coefficients.mean(dim=0)
        self._scaling, factor = fit_scaling(self.pixels, self, frames), 1.0
        if isinstance(self._scaling, PixelScaling):  # folded into the weights
            factor = float(self._scaling.scale) ** 2
            self._scaling = PixelScaling()
        # Weights [L, D] and the mean scaled frame [D] in one pass over the frames.
        n = len(images)
        mean = self.coefficients_.new_full((n, 1), 1 / n)
        combine = torch.cat([self.coefficients_, mean], dim=1).T.float().contiguous()
        sums = torch.zeros(len(combine), products.dimension, device=images.device)
        for start in range(0, n, FRAMES):
            rows = slice(start, start + FRAMES)
            sums.addmm_(combine[:, rows], self._scaling(images[rows]).flatten(1))
        self.weight_, self._mean = sums[:-1].mul_(factor), sums[-1]
        self.bias_ = (bias - self.weight_.double() @ self._mean.double()).float()
        yield {"samples_seen": len(frames), "epoch": 1.0, "loss": loss}

    def scores(self, batch: Tensor) -> Tensor:
        """W·x + b, float32 [n, L]."""
        return torch.addmm(self.bias_, self._scaling(batch).flatten(1), self.weight_.T)

    def scores_from(
        self, products: Products, train: np.ndarray, queries: np.ndarray
    ) -> Tensor:
        """See :meth:`Products.scores`."""
        scores, bias = self._solved(products, train, queries)
        return scores + bias

    def _solved(
        self,
        products: Products,
        train: np.ndarray,
        queries: np.ndarray,
        *before: Tensor,
    ) -> tuple[Tensor, Tensor]:
        solver = copy.copy(self)
        solver.classes_ = np.arange(products.n_classes)
        inside, across = products.centred(train, queries, self.pixels)
        coefficients, bias, _ = solver.solve(inside, products.labels[train], *before)
        return across @ (coefficients - coefficients.mean(0)), bias

    def state_tensors(self) -> dict[str, Tensor]:
        """weight [L, D] and bias [L]."""
        return {"weight": self.weight_, "bias": self.bias_}


class PenalisedClassifier(DualLinearClassifier):
    """A linear classifier with an L2 penalty, which can go on from weights that it is given.

    Its ``solve`` takes a third argument, scores ``before`` [N, L], and finds the change of them,
    with the penalty on the change alone.
    """

    def scores_from_old(
        self, products: Products, old: np.ndarray, new: np.ndarray, queries: np.ndarray
    ) -> Tensor:
        """Scores float64 [n, L] of queries after an update of weights from samples ``old`` with
        samples ``new``: min over W of loss(new frames) + penalty·‖W − W_old‖².

        The change of the weights is a combination of the new frames, so the old model enters by its
        scores of them alone.
        """
        before = self.scores_from(products, old, np.concatenate([new, queries]))
        change, bias = self._solved(products, new, queries, before[: len(new)])
        return before[len(new) :] + change + bias


class Descent:
    """Gradient descent on softmax regression from several starts at once, in sample space.

    A step on the batch B changes the logits of every frame, seen in training or not, by products
    with the training frames alone, and initial weights enter through their logits:

        Z ← Z − η·(K[:, B] + 1)·(P − Y)[B] / |B|,        K = X·X_trainᵀ.

    Args:
        kernel: K, float64 [N + M, N], training frames first (:meth:`Products.kernel`).
        targets: class indices of the training frames, int64 [N].
        n_classes: L.
        rate: η.
        logits: of the V starts, float64 [N + M, L, V], their intercepts included; by default of
            `coefficients` and `intercepts`, one start at zero if there are none.
        coefficients: initial A, float64 [N, L, V], of weights W = Aᵀ·X.
        intercepts: initial b, float64 [L, V].
        decay: λ: weights shrink by 1 − ηλ a step, which is descent with the penalty λ/2·‖W‖².
        batch: frames a step; None for all.
        seed: of the permutation of every epoch, as in :mod:`baselines.training`.

    Attributes:
        logits, coefficients, intercepts: now.
    """

    def __init__(
        self,
        kernel: Tensor,
        targets: Tensor,
        n_classes: int,
        rate: float,
        *,
        logits: Tensor | None = None,
        coefficients: Tensor | None = None,
        intercepts: Tensor | None = None,
        decay: float = 0.0,
        batch: int | None = None,
        seed: int = 0,
    ) -> None:
        self._kernel, self._targets, self._rate, self._batch = (
            kernel,
            targets,
            rate,
            batch,
        )
        self._decay, self._order = decay, torch.Generator().manual_seed(seed)
        self._onehot = F.one_hot(targets, n_classes).to(kernel.dtype)[:, :, None]
        starts = next((x.shape[-1] for x in (logits, coefficients) if x is not None), 1)
        if coefficients is None:
            coefficients = kernel.new_zeros(kernel.shape[1], n_classes, starts)
        if intercepts is None:
            intercepts = kernel.new_zeros(n_classes, starts)
        if logits is None:
            logits = torch.einsum("ij,jlv->ilv", kernel, coefficients) + intercepts
        self.logits, self.coefficients, self.intercepts = (
            x.to(kernel.dtype).clone().contiguous()
            for x in (logits, coefficients, intercepts)
        )
        self._parts = self.parts()

    def parts(self) -> Iterator[Tensor | slice]:
        """The training frames of each step, epoch after epoch without end."""
        n = len(self._targets)
        while True:
            if self._batch is None or self._batch >= n:
                yield slice(0, n)
            else:
                yield from torch.randperm(n, generator=self._order).split(self._batch)

    def step(self, part: Tensor | slice | None = None) -> None:
        """One step on these training frames; by default on the next minibatch."""
        part = next(self._parts) if part is None else part
        residual = self.logits[part].softmax(dim=1) - self._onehot[part]
        residual *= self._rate / len(residual)
        if self._decay:
            keep = 1 - self._rate * self._decay
            self.logits = keep * (self.logits - self.intercepts) + self.intercepts
            self.coefficients *= keep
        change = residual.sum(dim=0)
        self.coefficients[part] -= residual
        self.intercepts -= change
        flat = self.logits.view(len(self.logits), -1)
        flat.addmm_(self._kernel[:, part], residual.flatten(1), alpha=-1).sub_(
            change.flatten()
        )

    def losses(self, penalty: bool = False) -> Tensor:
        """Mean cross-entropy of the training frames, float64 [V]; with ``penalty`` plus λ/2·‖W‖²
        of the weights Aᵀ·X."""
        n, starts = len(self._targets), self.logits.shape[2]
        targets = self._targets[:, None].expand(n, starts)
        loss = F.cross_entropy(self.logits[:n], targets, reduction="none").mean(dim=0)
        if penalty:
            a = self.coefficients
            squares = torch.einsum("ilv,ij,jlv->v", a, self._kernel[:n], a)
            loss += 0.5 * self._decay * squares
        return loss

    def drop(self, kept: Tensor) -> None:
        """Go on with these starts only, int64 [V']."""
        for name in ("logits", "coefficients", "intercepts"):
            setattr(self, name, getattr(self, name)[..., kept].contiguous())
