"""Hessian of softmax regression, computed in sample space.

The mean cross-entropy F of logits Z = X·Wᵀ + b, with the intercept a pixel that is always one, has

    H = X̃ᵀ(⊕ᵢ diag(pᵢ) − pᵢpᵢᵀ)X̃ / N,        X̃ = (X, 1).

At W = 0 every p is 1/L, and the eigenvalues of H other than zero are those of (K + 1)/(NL) with
K = X·Xᵀ, each L − 1 times. Elsewhere they are those of Bᵀ(K + 1)B/N with diag(p) − ppᵀ = BBᵀ,
B = diag(√p) − p√pᵀ.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import torch
from scipy.sparse.linalg import LinearOperator, eigsh
from torch import Tensor

from baselines.pixels import fit_scaling
from baselines.softmax import SoftmaxRegression
from baselines.softmax_dual import DualSoftmaxRegression

_ROWS = 16  # rows of the frames, all N, in float64 at a time


def kernel(
    pixels: str,
    frames: Tensor,
    labels: np.ndarray,
) -> tuple[Tensor, Tensor]:
    """K float64 [N, N] of frames uint8 [N, H, W] in a scaling, and class indices int64 [N].

    ``standard`` pixels have no Gram matrix in integers, so that all are multiplied in float64.
    """
    model = SoftmaxRegression(pixels=pixels)
    targets = model.start(frames, labels)
    scaling: Any = fit_scaling(pixels, model, frames)
    offset, scale, shift = (
        torch.as_tensor(x, dtype=torch.float64).expand(frames.shape[1:])
        for x in (scaling.offset, scaling.scale, scaling.shift)
    )
    gram = torch.zeros(len(frames), len(frames), dtype=torch.float64)
    for first in range(0, frames.shape[1], _ROWS):
        rows = slice(first, first + _ROWS)
        block = (
            frames[:, rows]
            .double()
            .sub_(offset[rows])
            .mul_(scale[rows])
            .sub_(shift[rows])
        )
        gram += block.flatten(1) @ block.flatten(1).T
    return gram, targets


def optimum(
    gram: Tensor,
    targets: Tensor,
    penalty: float,
) -> tuple[Tensor, Tensor]:
    """Minimiser of F + penalty/2·‖W‖²: A float64 [N, L] of W = AᵀX, and b [L]."""
    solver = DualSoftmaxRegression(C=1 / (penalty * len(targets)), tol=1e-14)
    solver.classes_ = np.arange(int(targets.max()) + 1)
    centred = gram - gram.mean(dim=0)
    centred -= centred.mean(dim=1, keepdim=True)
    a, b, _ = solver.solve(centred, targets)
    a = a - a.mean(dim=0)  # zero but for rounding
    return a, b - (gram @ a).mean(dim=0)


def start_spectrum(gram: Tensor, classes: int) -> np.ndarray:
    """The N eigenvalues of H at W = 0 that are not zero, largest first."""
    values = torch.linalg.eigvalsh(gram + 1)
    scaled = values / (len(gram) * classes)
    return scaled.flip(0).numpy()


def minibatch_lambda(
    gram: Tensor,
    classes: int,
    batch: int,
    seed: int,
) -> float:
    """λ_max of the Hessian of a minibatch at W = 0, mean over the minibatches of an epoch."""
    random = torch.Generator().manual_seed(seed)
    order = torch.randperm(len(gram), generator=random)
    parts = order.split(batch)
    return float(
        np.mean([start_spectrum(gram[part][:, part], classes)[0] for part in parts])
    )


def spectrum(
    gram: Tensor, logits: Tensor, count: int, penalty: float = 0.0
) -> np.ndarray:
    """The largest eigenvalues of the Hessian at logits [N, L], largest first.

    The penalty is added as if the intercept carried it too, which is off by less than itself.
    """
    p = logits.softmax(dim=1)
    root = p.sqrt()
    n, classes = p.shape

    def product(vector: np.ndarray) -> np.ndarray:
        v = torch.from_numpy(vector).view(n, classes)
        u = root * v - p * (root * v).sum(dim=1, keepdim=True)  # B·v
        u = gram @ u + u.sum(dim=0)
        return (
            root * u - root * (p * u).sum(dim=1, keepdim=True)
        ).flatten().numpy() / n  # Bᵀ·u

    operator = LinearOperator(
        (n * classes, n * classes), matvec=product, dtype=np.float64
    )
    start = np.random.default_rng(0).standard_normal(n * classes)
    values = eigsh(
        operator,
        k=count,
        which="LA",
        v0=start,
        return_eigenvectors=False,
    )
    return np.sort(values)[::-1] + penalty
