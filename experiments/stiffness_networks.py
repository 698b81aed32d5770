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
from experiments.stiffness_softmax import ADAM, ADAM_EPSILON, minibatches


@dataclasses.dataclass(frozen=True)
class Start:
    """A network at its initial weights.

    Attributes:
        loss: mean cross-entropy of all frames.
        lambda_max: largest eigenvalue of its Hessian.
        adam_limit: largest stable rate of Adam, as in
            :func:`experiments.stiffness_softmax.problem`.
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
    still.fit(frames, labels)
    targets = torch.from_numpy(np.unique(labels, return_inverse=True)[1])
    logits = still.scores(still.load(frames, slice(None)))
    weights = list(still.network_.parameters())

    def gradient(part: Tensor | slice) -> Tensor:
        loss = F.cross_entropy(logits[part], targets[part])
        return parameters_to_vector(torch.autograd.grad(loss, weights, retain_graph=True))

    loss = F.cross_entropy(logits, targets)
    slopes = torch.autograd.grad(loss, weights, create_graph=True)

    def hessian(vector: Tensor) -> Tensor:
        pieces = torch.split(vector, [p.numel() for p in weights])
        shaped = [piece.view_as(p) for piece, p in zip(pieces, weights, strict=True)]
        product = torch.autograd.grad(slopes, weights, shaped, retain_graph=True)
        return parameters_to_vector(tuple(x.contiguous() for x in product))

    full = gradient(slice(None))
    parts = minibatches(len(labels), batch, model.seed)
    mean_square = torch.stack([gradient(part).square() for part in parts]).mean(dim=0)
    scale = (mean_square.sqrt() + ADAM_EPSILON).rsqrt()  # P^−½
    preconditioned = _largest(lambda v: scale * hessian(scale * v), full)
    return Start(loss.item(), _largest(hessian, full), ADAM / preconditioned)


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


def _largest(hessian: Callable[[Tensor], Tensor], start: Tensor) -> float:
    """Largest eigenvalue to a hundredth."""

    def product(vector: np.ndarray) -> np.ndarray:
        return hessian(torch.from_numpy(vector).float()).double().numpy()

    size = len(start)
    operator = LinearOperator((size, size), matvec=product, dtype=np.float64)
    v0 = start.double().numpy()
    return float(eigsh(operator, k=1, which="LA", v0=v0, tol=1e-2, return_eigenvectors=False)[0])
