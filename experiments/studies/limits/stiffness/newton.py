"""Newton's method on a stiff problem, in the precision of its start."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from experiments.studies.limits.stiffness.problem import (
    Array,
    Evaluate,
    Problem,
    contrasts,
    curvature,
)

_STEPS = 200  # it needs some ten
_LENGTHS = 2.0 ** -np.arange(30)  # of a step, tried in this order
_DECREASE = 1e-4  # of what the slope promises (Armijo)


def newton(
    problem: Problem, start: Array, evaluate: Evaluate, lengths: Array = _LENGTHS
) -> Iterator[Array]:
    """The iterates [L, D], until no step of one of the `lengths` lowers the loss; loss and gradient
    by ``evaluate``.

    Steps are of the contrasts between classes: all others change nothing but the penalty.

    Raises:
        numpy.linalg.LinAlgError: where rounding makes the Hessian indefinite.
    """
    weights = start
    basis = contrasts(len(start)).astype(start.dtype)
    loss, gradient = evaluate(weights)
    yield weights
    for _ in range(_STEPS):
        hessian = curvature(problem.x, basis, weights)
        hessian.flat[:: len(hessian) + 1] += np.tile(problem.penalty, basis.shape[1])
        slope = basis.T @ gradient
        step = basis @ -solve(hessian, slope.ravel()).reshape(slope.shape)
        promise = (gradient * step).sum()
        for length in lengths:
            trial = weights + length * step
            trial_loss, trial_gradient = evaluate(trial)
            if trial_loss < loss + _DECREASE * length * promise:
                break
        else:
            return
        weights, loss, gradient = trial, trial_loss, trial_gradient
        yield weights


def optimum(problem: Problem) -> Array:
    """The minimiser, ``numpy.longdouble`` [L, D]: Newton's method in that precision from where it
    ends in float64."""
    near = problem.start
    # Where float64 fails, the higher precision goes on from there.
    with suppress(np.linalg.LinAlgError):
        for weights in newton(problem, problem.start, problem.evaluate):
            near = weights
    *_, best = newton(problem, near.astype(np.longdouble), problem.evaluate)
    return best


def solve(matrix: Array, right: Array) -> Array:
    """Solution [M] of a positive definite system [M, M], in the precision of the matrix."""
    if matrix.dtype == np.float64:
        return cho_solve(cho_factor(matrix, lower=True), right)
    # LAPACK has no such numbers: Gauss-Jordan elimination, whose pivots stay positive.
    rows = np.column_stack([matrix, right])
    for k in range(len(matrix)):
        if not rows[k, k] > 0:
            raise np.linalg.LinAlgError("expected a positive definite matrix")
        pivot = rows[k] / rows[k, k]
        rows -= np.outer(rows[:, k], pivot)
        rows[k] = pivot
    return rows[:, -1]
