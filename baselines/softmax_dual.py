"""Softmax regression fitted to convergence by Newton's method in the space of samples.

Minimises the objective of scikit-learn's multinomial LogisticRegression,

    F(W, b) = C Σᵢ −log softmax(W·xᵢ + b)[yᵢ] + ½ ‖W‖²,      b not penalised,

with W = Aᵀ·X and f = K·A + b (see baselines.linear). In A the gradient is A + C(P − Y), read in the
inner product ⟨A, A'⟩ = tr(Aᵀ·K·A'), which is that of the weights. Each Newton step is solved by
conjugate gradients, one product K·[N, L] an iteration, so that a singular K does no harm.

With two classes F counts each weight twice, ½(‖w₀‖² + ‖w₁‖²) = ¼‖w₁ − w₀‖², whereas scikit-learn
then switches to the logistic form; its optimum at C is this one's at C/2.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import torch
from torch import Tensor
from torch.nn import functional as F

from baselines.linear import PenalisedClassifier


@dataclass(kw_only=True, eq=False)
class DualSoftmaxRegression(PenalisedClassifier):
    """Converged softmax regression.

    Args:
        C: inverse strength of the penalty, as in scikit-learn.
        tol: stop when the predicted relative decrease of F in a Newton step is below this.
        max_iter: most Newton steps.

    Attributes:
        objective_: F at the end; ``train`` yields F/(C·N) as the loss.

    For others see :class:`baselines.linear.DualLinearClassifier`.
    """

    C: float = 1.0
    tol: float = 1e-9
    max_iter: int = 100

    revision: ClassVar[int] = 1

    def solve(
        self, gram: Tensor, targets: Tensor, before: Tensor | None = None
    ) -> tuple[Tensor, Tensor, float]:
        """A [N, L], b [L] and F/(C·N) at the optimum; logits ``before`` are added to K·A + b."""
        n, n_classes = len(targets), len(self.classes_)
        onehot = F.one_hot(targets, n_classes).double()
        a = torch.zeros_like(onehot)
        b = onehot.new_zeros(n_classes)
        logits = torch.zeros_like(onehot) if before is None else before.clone()
        square = 0.0  # tr(Aᵀ·K·A)
        objective = self._objective(logits, targets, square)
        for _ in range(self.max_iter):
            probability = logits.softmax(dim=1)
            residual = probability - onehot
            gradient = a + self.C * _centre(residual)
            gradient_b = self.C * residual.sum(dim=0)
            step = _newton_step(gram, probability, self.C, gradient, gradient_b)
            step_a, step_k_a, step_b = step[:n], step[n:-1], step[-1]
            change = step_k_a + step_b
            slope = _dot(gradient, step_k_a) + float(gradient_b @ step_b)
            promise = 0.5 * slope
            if -promise <= self.tol * objective:
                break
            # As a function of the length of the step, everything but the softmax is a parabola.
            across = _dot(a, step_k_a)
            curved = _dot(step_a, step_k_a)
            length = 1.0
            while length > 1e-12:
                trial_square = square + 2 * length * across + length**2 * curved
                trial = self._objective(logits + length * change, targets, trial_square)
                if trial <= objective + 1e-4 * length * 2 * promise:
                    break
                length /= 2
            else:
                break  # rounding is all that is left to gain
            a = a + length * step_a
            b = b + length * step_b
            logits = logits + length * change
            square, objective = trial_square, trial
        self.objective_ = objective
        return a, b, objective / (self.C * n)

    def _objective(
        self,
        logits: Tensor,
        targets: Tensor,
        square: float,
    ) -> float:
        loss = F.cross_entropy(logits, targets, reduction="sum").item()
        return self.C * loss + 0.5 * square


def _newton_step(
    gram: Tensor,
    probability: Tensor,
    c: float,
    gradient: Tensor,
    gradient_b: Tensor,
) -> Tensor:
    """Solution of H·step = −gradient by conjugate gradients, H the Hessian of F at ``probability``:
    one tensor [2N + 1, L] of A, K·A carried along, and b."""
    n, p = len(gram), probability

    def stacked(a: Tensor, k_a: Tensor, b: Tensor) -> Tensor:
        return torch.cat([a, k_a, b[None]])

    def dot(x: Tensor, y: Tensor) -> float:
        of_a = _dot(x[:n], y[n:-1])
        of_b = float(x[-1] @ y[-1])
        return of_a + of_b

    def hessian(x: Tensor) -> Tensor:
        a, k_a, b = x[:n], x[n:-1], x[-1]
        logits = k_a + b
        mean = (p * logits).sum(dim=1, keepdim=True)
        change = p * (logits - mean)
        centred = c * _centre(change)
        of_b = c * change.sum(dim=0)
        return stacked(a + centred, k_a + gram @ centred, of_b)

    residual = stacked(-gradient, gram @ -gradient, -gradient_b)
    solution = torch.zeros_like(residual)
    direction, square = residual, dot(residual, residual)
    enough = 1e-6 * square  # small beside the gradient
    # The Hessian has at most one distinct eigenvalue an unknown; far fewer are needed.
    for _ in range(gradient.numel()):
        if square <= enough:
            break
        product = hessian(direction)
        curvature = dot(direction, product)
        if curvature <= 0:  # rounding
            break
        length = square / curvature
        solution = solution + length * direction
        residual = residual - length * product
        square, previous = dot(residual, residual), square
        direction = residual + square / previous * direction
    return solution


def _centre(x: Tensor) -> Tensor:
    return x - x.mean(dim=0)


def _dot(x: Tensor, y: Tensor) -> float:
    return float(torch.sum(x * y))
