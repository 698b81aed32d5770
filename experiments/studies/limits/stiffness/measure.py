"""Training as a stiff problem: the largest stable learning rate, predicted and measured.

Gradient descent is the explicit Euler method on the gradient flow, stable for rates below 2/λ_max
of the Hessian. That limit is computed where training starts, and rates are swept across it: from
zero weights, and from the optimum of the penalised loss, slightly perturbed, where the theory is
local and sharp. For SGD the prediction takes the mean λ_max of the minibatches.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
import torch

from baselines.descent import Descent
from experiments.protocol.experiment import Row, Run, experiment
from experiments.protocol.settings import Split
from experiments.protocol.splits import choose
from experiments.studies.limits.stiffness import softmax

_ROUNDING = 1e-13  # of a loss in float64, relative
_PERTURBATION = 1e-3  # relative, of every coefficient of the optimum


@experiment(revision=1)
def stiffness(
    run: Run,
    scene: Mapping[str, Any],
    split: Split,
    seed: int,
    pixels: Sequence[str],
    batch: int,
    steps: int,
    epochs: int,
    exponents: Sequence[float],
    penalty: float,
) -> Iterator[Row]:
    """One row: descent of softmax regression at one learning rate.

    Columns: ``pixels``, ``method``, ``start``, ``lambda_max`` at the start, ``predicted`` limit,
    ``rate`` and those of :func:`verdict`. Arguments: configs/experiment/stiffness.yaml.
    """
    made = run.scene(scene, seed)
    train, _ = choose(made, split, seed)
    frames, labels = made.frames(train), made.labels[train]
    for name in pixels:
        run.note(f"pixels {name}")
        gram, targets = softmax.kernel(name, frames, labels)
        classes = int(targets.max()) + 1
        at_start = softmax.start_spectrum(gram, classes)
        strength = penalty * float(at_start.mean())
        a, b = softmax.optimum(gram, targets, strength)
        at_optimum = softmax.spectrum(gram, gram @ a + b, 1, strength)
        random = np.random.default_rng(seed)
        noise = torch.from_numpy(random.standard_normal(a.shape))
        zero: dict[str, Any] = {"steps": steps, "each": 1}
        best = zero | {
            "coefficients": a[:, :, None],
            "intercepts": b[:, None],
            "decay": strength,
        }
        perturbed = a * (1 + _PERTURBATION * noise)
        near = best | {"coefficients": perturbed[:, :, None]}
        minibatches = {
            "steps": epochs,
            "each": -(-len(targets) // batch),
            "batch": batch,
        }
        (floor,) = descend(gram, targets, 0.0, **best | {"steps": 0})
        for method, start, lambda_max, how in (
            ("GD", "zero", at_start[0], zero),
            ("GD", "optimum", at_optimum[0], near),
            (
                "SGD",
                "zero",
                softmax.minibatch_lambda(gram, classes, batch, seed),
                minibatches,
            ),
        ):
            least = floor if start == "optimum" else 0.0
            for k in sorted(exponents):
                rate = 2 / float(lambda_max) * 2.0 ** (k / 2 + 0.25)
                losses = descend(gram, targets, rate, seed=seed, **how)
                yield {
                    "origin": made.origin,
                    "pixels": name,
                    "method": method,
                    "start": start,
                    "lambda_max": float(lambda_max),
                    "predicted": 2 / float(lambda_max),
                    "rate": rate,
                    **verdict([loss - least for loss in losses], least),
                }


def descend(
    gram: torch.Tensor,
    targets: torch.Tensor,
    rate: float,
    *,
    steps: int,
    each: int,
    **how: Any,
) -> list[float]:
    """Losses at the start and after every so many (`each`) of ``steps`` times as many steps."""
    descent = Descent(gram, targets, int(targets.max()) + 1, rate, **how)
    losses = []
    for step in range(steps * each + 1):
        if step:
            descent.step()
        if step % each == 0:
            losses.append(descent.losses("decay" in how).item())
    return losses


def verdict(losses: Sequence[float], floor: float = 0.0) -> Row:
    """Whether the loss (less the floor) rises, exceeds the one at the start, and ends above it."""
    slack = _ROUNDING * max(losses[0], floor)
    highest = max(losses)
    if any(map(math.isnan, losses)):
        highest = math.inf
    return {  # a loss that is not a number has not fallen
        "loss_start": losses[0],
        "loss_end": losses[-1],
        "loss_max": highest,
        "rises": any(
            not after <= before + slack for before, after in itertools.pairwise(losses)
        ),
        "exceeds": highest > losses[0] + slack,
        "ends_above": not losses[-1] <= losses[0],
    }
