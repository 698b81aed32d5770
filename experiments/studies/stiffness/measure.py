"""Training as a stiff problem: the largest stable learning rate, predicted and measured.

Gradient descent is the explicit Euler method on the gradient flow, stable for rates below 2/λ_max of
the Hessian. That limit is computed where training starts, and rates are swept across it: from zero
weights, and from the optimum of the penalised loss, slightly perturbed, where the theory is local
and sharp. For SGD the prediction takes the mean λ_max of the minibatches.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
import torch
from torch import Tensor

from baselines.dual import Descent
from experiments.protocol import data
from experiments.protocol.experiment import Row, Run, experiment
from experiments.studies.stiffness import softmax

_ROUNDING = 1e-13  # of a loss in float64, relative
_PERTURBATION = 1e-3  # relative, of every coefficient of the optimum


class Problem(NamedTuple):
    """Training frames in one scaling.

    Attributes:
        pixels: name of the scaling.
        gram: K, float64 [N, N].
        targets: class indices, int64 [N].
        at_start: eigenvalues of the Hessian at zero weights, largest first.
        penalty: of the loss whose optimum is a second start.
        optimum: A [N, L] and b [L] there.
    """

    pixels: str
    gram: Tensor
    targets: Tensor
    at_start: np.ndarray
    penalty: float
    optimum: tuple[Tensor, Tensor]

    @property
    def classes(self) -> int:
        return int(self.targets.max()) + 1

    def at_optimum(self, count: int) -> np.ndarray:
        """The largest eigenvalues of the penalised Hessian at the optimum, largest first."""
        a, b = self.optimum
        return softmax.spectrum(self.gram, self.gram @ a + b, count, self.penalty)


def problems(
    run: Run, scene: Any, split: Any, seed: int, pixels: Sequence[str], penalty: float
) -> Iterator[Problem]:
    """The training frames in each scaling; the penalty is given in mean eigenvalues at the start."""
    made = run.scene(scene, seed)
    train, _ = data.choose(made, split, seed)
    frames, labels = made.frames(train), made.labels[train]
    for name in pixels:
        gram, targets = softmax.kernel(name, frames, labels)
        at_start = softmax.start_spectrum(gram, int(targets.max()) + 1)
        strength = penalty * float(at_start.mean())
        optimum = softmax.optimum(gram, targets, strength)
        yield Problem(name, gram, targets, at_start, strength, optimum)


@experiment
def stiffness(
    run: Run,
    scene: Mapping[str, Any],
    split: Mapping[str, Any],
    seed: int,
    pixels: Sequence[str],
    batch: int,
    steps: int,
    epochs: int,
    exponents: Sequence[int],
    penalty: float,
) -> Iterator[Row]:
    """One row: descent of softmax regression at one learning rate.

    Columns: ``pixels``, ``method``, ``start``, ``lambda_max`` at the start, ``predicted`` limit,
    ``rate``, those of :func:`verdict`, and ``lambda_end``, λ_max at the end of gradient descent from
    zero weights (None elsewhere).

    Args:
        scene, split: as in the configuration of a run.
        seed: of scene, split, minibatches and perturbation.
        pixels: scalings of ``baselines.pixels``.
        batch: frames in a minibatch of SGD.
        steps: of gradient descent at each rate.
        epochs: of SGD at each rate.
        exponents: k of the rates 2^(k/2 + 1/4) times the predicted limit, which lies between two.
        penalty: of the loss whose optimum is the second start, in mean eigenvalues of the Hessian at
            the first.
    """
    for problem in problems(run, scene, split, seed, pixels, penalty):
        run.note(f"pixels {problem.pixels}")
        a, b = problem.optimum
        noise = torch.from_numpy(np.random.default_rng(seed).standard_normal(a.shape))
        near = {"coefficients": (a * (1 + _PERTURBATION * noise))[:, :, None]}
        near |= {"intercepts": b[:, None], "decay": problem.penalty}
        best = dict(near, coefficients=a[:, :, None])
        floor = descent(problem, 0.0, **best).losses(penalty=True).item()
        in_epoch = -(-len(problem.targets) // batch)
        minibatch = softmax.minibatch_lambda(problem.gram, problem.classes, batch, seed)
        for method, start, lambda_max in (
            ("GD", "zero", float(problem.at_start[0])),
            ("GD", "optimum", float(problem.at_optimum(1)[0])),
            ("SGD", "zero", minibatch),
        ):
            how: dict[str, Any] = near if start == "optimum" else {}
            if method == "SGD":
                how = {"batch": batch, "seed": seed}
            least = floor if start == "optimum" else 0.0
            for k in sorted(exponents):
                rate = 2 / lambda_max * 2 ** (k / 2 + 0.25)
                path = descent(problem, rate, **how)
                losses = [path.losses(penalty=True).item()]
                for _ in range(epochs if method == "SGD" else steps):
                    for _ in range(in_epoch if method == "SGD" else 1):
                        path.step()
                    losses.append(path.losses(penalty=True).item())
                lambda_end = None
                if (method, start) == ("GD", "zero"):
                    logits = path.logits[:, :, 0]
                    lambda_end = float(softmax.spectrum(problem.gram, logits, 1)[0])
                yield {
                    "pixels": problem.pixels,
                    "method": method,
                    "start": start,
                    "lambda_max": lambda_max,
                    "predicted": 2 / lambda_max,
                    "rate": rate,
                    **verdict([loss - least for loss in losses], least),
                    "lambda_end": lambda_end,
                }


def descent(problem: Problem, rate: float, **how: Any) -> Descent:
    """Gradient descent on a problem."""
    return Descent(problem.gram, problem.targets, problem.classes, rate, **how)


def verdict(losses: Sequence[float], floor: float = 0.0) -> Row:
    """Whether the loss rises, exceeds the one at the start, and ends above it.

    Args:
        losses: at the start and at every report, less the floor.
        floor: loss of the optimum, where it is known, else zero.
    """
    slack = _ROUNDING * max(losses[0], floor)
    highest = math.inf if any(map(math.isnan, losses)) else max(losses)
    return {
        "loss_start": losses[0],
        "loss_end": losses[-1],
        "loss_max": highest,
        # A loss that is not a number has not fallen.
        "rises": any(not after <= before + slack for before, after in itertools.pairwise(losses)),
        "exceeds": highest > losses[0] + slack,
        "ends_above": not losses[-1] <= losses[0],
    }


@experiment
def stiffness_spectrum(
    run: Run,
    scene: Mapping[str, Any],
    split: Mapping[str, Any],
    seed: int,
    pixels: Sequence[str],
    penalty: float,
    eigenvalues: int,
) -> Iterator[Row]:
    """One row: an eigenvalue of the Hessian of softmax regression at zero weights.

    Columns: ``pixels``, ``index`` from 1, ``eigenvalue``, and ``eigenvalue_optimum`` at the optimum of
    the penalised loss for the first ``eigenvalues`` (None for the few others that are told).
    """
    for problem in problems(run, scene, split, seed, pixels, penalty):
        at_optimum = problem.at_optimum(eigenvalues).tolist()
        rest = np.geomspace(eigenvalues + 1, len(problem.at_start), 20).astype(int)
        for index in [*range(1, eigenvalues + 1), *np.unique(rest).tolist()]:
            yield {
                "pixels": problem.pixels,
                "index": index,
                "eigenvalue": float(problem.at_start[index - 1]),
                "eigenvalue_optimum": at_optimum[index - 1] if index <= eigenvalues else None,
            }
