"""Linear models that start from old weights: min over W of loss(new frames) + penalty·‖W − W_old‖².

The change of the weights is a combination of the new frames, so the old model enters by its scores
of them alone.
"""

from __future__ import annotations

import numpy as np
import torch
from scipy.optimize import minimize
from scipy.special import logsumexp
from torch import Tensor
from torch.nn import functional as F

from baselines.ridge import RidgeReadout
from baselines.softmax_dual import DualSoftmaxRegression
from experiments.protocol.subsets import Products


def scores_from_old(
    products: Products,
    model: RidgeReadout | DualSoftmaxRegression,
    old: np.ndarray,
    new: np.ndarray,
    asked: np.ndarray,
) -> Tensor:
    """Scores after an update, float64 [n, L].

    Args:
        products: of the frames.
        model: whose loss and penalty count.
        old: samples that the old weights were trained on.
        new: samples to update with.
        asked: samples to score [n].
    """
    scores = products.scores(model, old, np.concatenate([new, asked]))
    before, after = scores[: len(new)], scores[len(new) :]
    inside, across = products.centred(new, asked)
    onehot = F.one_hot(products.labels[new], products.n_classes).double()
    if isinstance(model, RidgeReadout):
        left = 2 * onehot - 1 - before
        mean = left.mean(0)
        system = inside + model.alpha * torch.eye(len(new), dtype=torch.float64)
        return after + mean + across @ torch.linalg.solve(system, left - mean)
    change, bias = _softmax(inside.numpy(), onehot.numpy(), before.numpy(), model.C)
    return after + torch.from_numpy(bias) + across @ torch.from_numpy(change)


def _softmax(
    gram: np.ndarray, onehot: np.ndarray, old: np.ndarray, c: float
) -> tuple[np.ndarray, np.ndarray]:
    """Coefficients [n, L] and intercept [L] that minimise C·Σ loss + ½‖W − W_old‖²."""
    value, vectors = np.linalg.eigh(gram)
    kept = value > 1e-12 * value[-1]
    root = np.sqrt(value[kept])
    features = vectors[:, kept] * root  # of which the weights' change is u, ‖u‖ = ‖W − W_old‖
    n_classes = onehot.shape[1]

    def objective(x: np.ndarray) -> tuple[float, np.ndarray]:
        u, b = x[n_classes:].reshape(-1, n_classes), x[:n_classes]
        logits = old + features @ u + b
        total = logsumexp(logits, axis=1, keepdims=True)
        slope = c * (np.exp(logits - total) - onehot)
        loss = c * float((total[:, 0] - (logits * onehot).sum(1)).sum())
        gradient = np.concatenate([slope.sum(0), (features.T @ slope + u).ravel()])
        return loss + 0.5 * float((u * u).sum()), gradient

    start = np.zeros((1 + features.shape[1]) * n_classes)
    options = {"maxiter": 2000, "ftol": 1e-12, "gtol": 1e-6}
    x = minimize(objective, start, jac=True, method="L-BFGS-B", options=options).x
    u = x[n_classes:].reshape(-1, n_classes)
    return vectors[:, kept] @ (u / root[:, None]), x[:n_classes]
