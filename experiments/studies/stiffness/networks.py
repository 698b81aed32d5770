"""The same questions to any network of baselines.training: its Hessian, and its loss at a rate.

Products of the Hessian with a vector come from differentiating twice (Pearlmutter, Neural Comput.
6, 147 (1994)), its largest eigenvalue from Lanczos iterations on them.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Sequence

import numpy as np
import torch
from scipy.sparse.linalg import LinearOperator, eigsh
from torch import Tensor
from torch.nn import functional as F
from torch.nn.utils import parameters_to_vector

from baselines.training import IterativeClassifier
from experiments.studies.stiffness.softmax import ADAM, ADAM_EPSILON, minibatches


@dataclasses.dataclass(frozen=True)
class Start:
    """A network at its initial weights.

    Attributes:
        loss: mean cross-entropy of all frames.
        lambda_max: largest eigenvalue of its Hessian.
        adam_limit: largest stable rate of Adam, as in
            :func:`experiments.studies.stiffness.softmax.problem`.
    """

    loss: float
    lambda_max: float
    adam_limit: float


def start(model: IterativeClassifier, frames: Tensor, labels: np.ndarray, batch: int) -> Start:
    """Where training this model begins.

    Args:
        model: any; it is left as it is.
        frames: uint8 [N, H, W].
        labels: [N].
        batch: frames in a minibatch of Adam.
    """
    # A step of length zero leaves the network at its initial weights.
    still = dataclasses.replace(model, optimizer="SGD", lr=0.0, batch_size=None, max_epochs=1)
    local = _Loss(still.fit(frames, labels), frames, labels)
    parts = minibatches(len(labels), batch, model.seed)
    mean_square = torch.stack([local.gradient(part).square() for part in parts]).mean(dim=0)
    scale = (mean_square.sqrt() + ADAM_EPSILON).rsqrt()  # P^−½
    preconditioned = _largest(lambda v: scale * local.hessian(scale * v), local.full)
    return Start(local.value, _largest(local.hessian, local.full), ADAM / preconditioned)


def sharpness(model: IterativeClassifier, frames: Tensor, labels: np.ndarray) -> float:
    """λ_max of the Hessian where a trained model stands."""
    local = _Loss(model, frames, labels)
    return _largest(local.hessian, local.full)


def losses(model: IterativeClassifier, frames: Tensor, labels: np.ndarray) -> list[float]:
    """The loss that each report of a training tells, up to the first that is not finite."""
    found: list[float] = []
    for report in model.train(frames, labels):
        found.append(report["loss"])
        if not math.isfinite(found[-1]):
            break
    return found


def window(frames: Tensor, side: int) -> Tensor:
    """The middle of each frame, side × side pixels at most."""
    cuts: Sequence[slice] = [
        slice((n - min(n, side)) // 2, (n + min(n, side)) // 2) for n in frames.shape[1:]
    ]
    return frames[:, cuts[0], cuts[1]].contiguous()


class _Loss:
    """Mean cross-entropy of a trained network on these frames, and its derivatives there.

    Attributes:
        value: the loss.
        full: its gradient, float32 [parameters].
    """

    def __init__(self, model: IterativeClassifier, frames: Tensor, labels: np.ndarray) -> None:
        self._targets = torch.from_numpy(np.searchsorted(model.classes_, labels))
        self._logits = model.scores(model.read(frames, slice(None)))
        self._weights = list(model.network_.parameters())
        loss = F.cross_entropy(self._logits, self._targets)
        self._slopes = torch.autograd.grad(loss, self._weights, create_graph=True)
        self.value = loss.item()
        self.full = parameters_to_vector(self._slopes).detach()

    def gradient(self, part: Tensor) -> Tensor:
        """Of the loss of some frames."""
        loss = F.cross_entropy(self._logits[part], self._targets[part])
        return parameters_to_vector(torch.autograd.grad(loss, self._weights, retain_graph=True))

    def hessian(self, vector: Tensor) -> Tensor:
        """The product H·v."""
        pieces = torch.split(vector, [p.numel() for p in self._weights])
        shaped = [x.view_as(p) for x, p in zip(pieces, self._weights, strict=True)]
        product = torch.autograd.grad(self._slopes, self._weights, shaped, retain_graph=True)
        return parameters_to_vector(tuple(x.contiguous() for x in product))


def _largest(hessian: Callable[[Tensor], Tensor], start: Tensor) -> float:
    """Largest eigenvalue to a hundredth."""

    def product(vector: np.ndarray) -> np.ndarray:
        return hessian(torch.from_numpy(vector).float()).double().numpy()

    size = len(start)
    operator = LinearOperator((size, size), matvec=product, dtype=np.float64)
    v0 = start.double().numpy()
    return float(eigsh(operator, k=1, which="LA", v0=v0, tol=1e-2, return_eigenvectors=False)[0])
