"""Softmax regression as a stiff problem: its Hessian and its gradient descent, in sample space.

The mean cross-entropy F of logits Z = X·Wᵀ + b, with the intercept a pixel that is always one, has

    ∇F = RᵀX̃,  R = (P − Y)/N,        H = X̃ᵀ(⊕ᵢ diag(pᵢ) − pᵢpᵢᵀ)X̃ / N,        X̃ = (X, 1).

All gradients lie in the span of the frames, W = AᵀX, so that descent in W by −η∇F is descent in A
by −ηR, at N²L operations a step instead of NDL, with K = XXᵀ. Nothing is approximated: every
minibatch step is the one that the primal form would take. At W = 0, P = 1/L and H has the
eigenvalues of (K + 1)/(NL), each L − 1 times; elsewhere those of BᵀKB/N with
diag(p) − ppᵀ = BBᵀ, B = diag(√p) − p√pᵀ.

Explicit Euler on the gradient flow, which gradient descent is, is stable for η < 2/λ_max only.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import torch
from scipy.sparse.linalg import LinearOperator, eigsh
from torch import Tensor
from torch.nn import functional as F

from baselines.pixels import PixelScaling, fit_scaling
from baselines.softmax import SoftmaxRegression
from baselines.softmax_dual import DualSoftmaxRegression

ADAM = (2 + 2 * 0.9) / (1 - 0.9)  # of torch's β₁ = 0.9
ADAM_EPSILON = 1e-8  # torch's
ROWS = 16  # rows of the frames, all N, that are float64 at a time


@dataclass(frozen=True)
class State:
    """A point of the descent.

    Attributes:
        a: A, float64 [N, L].
        b: intercepts, float64 [L].
    """

    a: Tensor
    b: Tensor


@dataclass(frozen=True)
class Problem:
    """Frames of one pixel scaling as the softmax sees them.

    Attributes:
        kernel: K = XXᵀ, float64 [N, N], without the intercept.
        targets: class indices, int64 [N].
        adam_limit: largest stable rate of Adam, see :func:`problem`.
    """

    kernel: Tensor
    targets: Tensor
    adam_limit: float

    @property
    def classes(self) -> int:
        return int(self.targets.max()) + 1

    def start(self) -> State:
        """All weights zero, as :class:`baselines.softmax.SoftmaxRegression` starts."""
        zeros = self.kernel.new_zeros(len(self.targets), self.classes)
        return State(zeros, zeros[0].clone())

    def logits(self, state: State) -> Tensor:
        return self.kernel @ state.a + state.b

    def loss(self, state: State, penalty: float = 0.0) -> float:
        """Mean cross-entropy + penalty/2·‖W‖²."""
        logits = self.logits(state)
        squared = float((state.a * (logits - state.b)).sum())
        return F.cross_entropy(logits, self.targets).item() + 0.5 * penalty * squared


def problem(pixels: str, frames: Tensor, labels: np.ndarray, batch: int, seed: int = 0) -> Problem:
    """The problem of these frames, and in the same pass over them the limit of Adam.

    Adam divides each slope by √v, v the mean square of the minibatches' slopes. With v standing
    still, that is gradient descent with momentum on the Hessian P^−½·H·P^−½, P = diag(√v), stable
    for η < :data:`ADAM` / λ_max (Cohen et al., arXiv 2207.14484). Here v is that of an epoch at
    W = 0, and its mean over the classes.

    Args:
        pixels: a scaling of baselines.pixels.
        frames: uint8 [N, H, W].
        labels: [N].
        batch: frames in a minibatch of Adam.
        seed: of the minibatches.
    """
    model = SoftmaxRegression(pixels=pixels)
    targets = model.start(frames, labels)
    scaling = fit_scaling(pixels, model, frames)
    n, classes = len(targets), len(model.classes_)
    residual = 1 / classes - F.one_hot(targets, classes).double()
    parts = minibatches(n, batch, seed)
    each = torch.zeros(n, len(parts), classes, dtype=torch.float64)
    for k, part in enumerate(parts):
        each[part, k] = residual[part] / len(part)
    each = each.flatten(1)
    kernel = torch.zeros(n, n, dtype=torch.float64)
    # The intercept first: a pixel that is one everywhere.
    ones = torch.ones(n, 1, dtype=torch.float64)
    weighted = torch.zeros_like(kernel)
    for block in (ones, *_blocks(frames, scaling)):
        if block is not ones:
            kernel += block @ block.T
        slopes = (each.T @ block).square_().mean(dim=0).sqrt_()
        scaled = block / (slopes + ADAM_EPSILON).sqrt_()
        weighted += scaled @ scaled.T
    largest = torch.linalg.eigvalsh(weighted)[-1].item() / (n * classes)
    return Problem(kernel, targets, ADAM / largest)


def minibatches(n: int, batch: int, seed: int) -> tuple[Tensor, ...]:
    """The minibatches of an epoch, int64 [≤ batch] each."""
    return torch.randperm(n, generator=torch.Generator().manual_seed(seed)).split(batch)


def descend(
    problem: Problem,
    rate: float,
    reports: int,
    *,
    batch: int | None = None,
    start: State | None = None,
    penalty: float = 0.0,
    seed: int = 0,
) -> Iterator[tuple[float, State]]:
    """Gradient descent; yields loss (of all frames) and state at the start and after every report.

    Args:
        rate: η.
        reports: steps of the full batch, or epochs of minibatches.
        batch: frames in a minibatch; None for all.
        start: where it starts; zero by default.
        penalty: see :meth:`Problem.loss`.
        seed: of the minibatches.
    """
    state = start or problem.start()
    onehot = F.one_hot(problem.targets, problem.classes).double()
    n = len(onehot)
    yield problem.loss(state, penalty), state
    for report in range(reports):
        for part in minibatches(n, batch, seed + report) if batch else [slice(None)]:
            logits = problem.kernel[part] @ state.a + state.b
            residual = (logits.softmax(dim=1) - onehot[part]) / len(logits)
            a = state.a * (1 - rate * penalty)
            a[part] -= rate * residual
            state = State(a, state.b - rate * residual.sum(dim=0))
        yield problem.loss(state, penalty), state


def optimum(problem: Problem, penalty: float) -> State:
    """The minimiser of the penalised loss, by the dual Newton method."""
    solver = DualSoftmaxRegression(C=1 / (penalty * len(problem.targets)), tol=1e-14)
    solver.classes_ = np.arange(problem.classes)
    centred = problem.kernel - problem.kernel.mean(dim=0)
    centred -= centred.mean(dim=1, keepdim=True)
    a, b, _ = solver.solve(centred, problem.targets)
    a = a - a.mean(dim=0)  # rounding aside it is so already, and W = AᵀX either way
    return State(a, b - (problem.kernel @ a).mean(dim=0))


def start_spectrum(problem: Problem) -> np.ndarray:
    """Eigenvalues of H at W = 0, the N that are not zero, largest first; each is L − 1 fold."""
    values = torch.linalg.eigvalsh(problem.kernel + 1) / (len(problem.targets) * problem.classes)
    return values.flip(0).numpy()


def minibatch_lambda(problem: Problem, batch: int, seed: int = 0) -> float:
    """λ_max of the Hessian of a minibatch at W = 0, mean over the minibatches of an epoch."""
    parts = minibatches(len(problem.targets), batch, seed)
    largest = [
        torch.linalg.eigvalsh(problem.kernel[part][:, part] + 1)[-1].item() / len(part)
        for part in parts
    ]
    return float(np.mean(largest)) / problem.classes


def spectrum(problem: Problem, state: State, count: int, penalty: float = 0.0) -> np.ndarray:
    """The largest eigenvalues of the Hessian at a state, largest first.

    The penalty is added as if the intercept carried it too, which is off by less than itself.
    """
    p = problem.logits(state).softmax(dim=1)
    root = p.sqrt()
    n, classes = p.shape

    def product(vector: np.ndarray) -> np.ndarray:
        v = torch.from_numpy(vector).view(n, classes)
        u = root * v - p * (root * v).sum(dim=1, keepdim=True)  # B·v
        u = problem.kernel @ u + u.sum(dim=0)
        return (root * u - root * (p * u).sum(dim=1, keepdim=True)).flatten().numpy() / n  # Bᵀ·u

    operator = LinearOperator((n * classes, n * classes), matvec=product, dtype=np.float64)
    start = np.random.default_rng(0).standard_normal(n * classes)
    if not product(start).any():  # every p is 0 or 1 to the last digit: ARPACK finds no direction
        return np.full(count, penalty)
    values = eigsh(operator, k=count, which="LA", v0=start, return_eigenvectors=False)
    return np.sort(values)[::-1] + penalty


def _blocks(frames: Tensor, scaling: PixelScaling) -> Iterator[Tensor]:
    """The scaled frames a few rows at a time, float64 [N, rows·W]."""
    for first in range(0, frames.shape[1], ROWS):
        rows = slice(first, first + ROWS)
        offset, scale, shift = (
            x[rows] if isinstance(x, Tensor) else x
            for x in (scaling.offset, scaling.scale, scaling.shift)
        )
        yield frames[:, rows].double().sub_(offset).mul_(scale).sub_(shift).flatten(1)
