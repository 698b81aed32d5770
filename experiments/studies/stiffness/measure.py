"""Training as a stiff problem: the largest stable learning rate, predicted and found.

Gradient descent is the explicit Euler method on the gradient flow, stable for a rate below 2/λ_max
of the Hessian. That limit is computed where training starts, and rates are swept across it. Since
the gradient of a softmax is bounded, an unstable rate makes its loss rise and swing, and seldom
overflow, so three things are looked for in a fixed number of reports (steps of the full batch,
epochs of minibatches):

- ``rises``: the loss is above that of the report before;
- ``exceeds``: some loss is above the one at the start;
- ``ends_above``: the last loss is above the one at the start, or not finite.

The predictions: 2/λ_max for gradient descent, the same with the mean λ_max of the minibatches for
SGD, and 38 over the λ_max of the preconditioned Hessian for Adam (``softmax.problem``). Softmax
regression descends in the space of samples (exactly, all pixels), once from zero weights and once
from the optimum of the penalised loss, slightly perturbed, where the theory is local and sharp.
Adam's steps leave the span of the frames: it runs as the baseline does, on all pixels. The
convolutional networks see fewer frames and only the middle of each: their limits are those of that
smaller problem.
"""

from __future__ import annotations

import itertools
import math
import time
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import torch
from rich.console import Console
from torch import Tensor

from baselines.cnn import CNN
from baselines.softmax import SoftmaxRegression
from baselines.training import IterativeClassifier
from experiments.protocol import data
from experiments.protocol.scenes import scene_at
from experiments.records.measurement import Row, measure
from experiments.studies.stiffness import networks as curvature
from experiments.studies.stiffness import softmax as dual
from scenes.split import learning_curve_subsets

NETWORKS = {"cnn1": (16,), "cnn3": (16, 32, 64)}  # configs/model
_ROUNDING = 1e-13  # of a loss in float64, relative
_PERTURBATION = 1e-3  # relative, of every coefficient of the optimum


def run(
    scene: Mapping[str, Any],
    split: Mapping[str, Any],
    seed: int,
    force: bool = False,
    cache: bool = True,
    **settings: Any,
) -> Path:
    """The task of configs/experiment/stiffness.yaml: ``measured/stiffness-HASH/``.

    Args:
        scene, split: as in the configuration of a run.
        seed: of scene, split, minibatches and perturbation.
        force: measure again.
        cache: keep made frames.
        settings: arguments of :func:`rows`.
    """
    console = Console(highlight=False)
    config = {
        "_target_": f"{__name__}.run",
        "scene": scene,
        "split": split,
        "seed": seed,
        **settings,
    }

    def compute() -> Iterator[Row]:
        made = scene_at(scene, seed, cache, console)
        train, _ = data.choose(made, split, seed)
        return rows(made.frames(train), made.labels[train], seed=seed, **settings)

    return measure("stiffness", config, compute, force=force, console=console)


def rows(
    frames: Tensor,
    labels: np.ndarray,
    *,
    softmax: Mapping[str, Any],
    adam: Mapping[str, Any],
    networks: Mapping[str, Any],
    batch: int,
    seed: int = 0,
) -> Iterator[Row]:
    """Rows of kind ``spectrum`` (one an eigenvalue) and ``sweep`` (one a rate).

    Args:
        frames: uint8 [N, H, W].
        labels: [N].
        softmax: of :func:`softmax_rows`.
        adam: of :func:`adam_rows`.
        networks: of :func:`network_rows`.
        batch: frames in a minibatch.
        seed: of minibatches and initial weights.
    """
    common = {"model": "softmax", "n": len(labels), "d": frames[0].numel()}
    for pixels in softmax["pixels"]:
        here = dual.problem(pixels, frames, labels, batch, seed)
        name = {**common, "pixels": pixels}
        for row in softmax_rows(here, batch=batch, seed=seed, **softmax):
            yield {**name, **row}
        model = SoftmaxRegression(pixels=pixels, batch_size=batch, seed=seed)
        start = math.log(here.classes)
        for row in adam_rows(model, start, here.adam_limit, frames, labels, **adam):
            yield {**name, "start": "zero", **row}
    yield from network_rows(frames, labels, batch=batch, seed=seed, **networks)


def softmax_rows(
    problem: dual.Problem,
    *,
    steps: int,
    epochs: int,
    exponents: Sequence[int],
    penalty: float,
    eigenvalues: int,
    batch: int,
    seed: int,
    pixels: Sequence[str] = (),
) -> Iterator[Row]:
    """Spectrum and sweeps of gradient descent and SGD.

    Args:
        problem: the frames.
        steps: of gradient descent at each rate.
        epochs: of SGD.
        exponents: k of the rates 2^(k/2 + 1/4) times the predicted one, which lies between two.
        penalty: of the loss at whose optimum the descent starts the second time, in mean
            eigenvalues of the Hessian at the first start.
        eigenvalues: how many of the leading ones are told, with a few of the rest.
        batch: frames in a minibatch.
        seed: of the minibatches and the perturbation.
        pixels: all scalings that are tried; for the caller.
    """
    at_start = dual.start_spectrum(problem)
    penalty *= float(at_start.mean())
    best = dual.optimum(problem, penalty)
    at_optimum = dual.spectrum(problem, best, eigenvalues, penalty)
    leading = [*range(1, eigenvalues + 1)]
    rest = np.unique(np.geomspace(eigenvalues + 1, len(at_start), 20).astype(int)).tolist()
    for index in leading + rest:
        row: Row = {"kind": "spectrum", "index": index, "eigenvalue": at_start[index - 1]}
        if index in leading:
            row["eigenvalue_optimum"] = at_optimum[index - 1]
        yield row
    noise = torch.from_numpy(np.random.default_rng(seed).standard_normal(best.a.shape))
    near = dual.State(best.a * (1 + _PERTURBATION * noise), best.b)
    floor = problem.loss(best, penalty)
    for method, start, lambda_max in (
        ("GD", "zero", float(at_start[0])),
        ("GD", "optimum", float(at_optimum[0])),
        ("SGD", "zero", dual.minibatch_lambda(problem, batch, seed)),
    ):
        local = start == "optimum"
        for rate in _rates(2 / lambda_max, exponents):
            clock = time.perf_counter()
            path = dual.descend(
                problem,
                rate,
                epochs if method == "SGD" else steps,
                batch=batch if method == "SGD" else None,
                start=near if local else None,
                penalty=penalty if local else 0.0,
                seed=seed,
            )
            losses, states = zip(*path, strict=True)
            row = {
                "kind": "sweep",
                "method": method,
                "start": start,
                "lambda_max": lambda_max,
                "predicted": 2 / lambda_max,
                "rate": rate,
                "penalty": penalty * local,
                **verdict([x - floor * local for x in losses], floor * local),
                "seconds": time.perf_counter() - clock,
            }
            if method == "GD" and not local:
                row["lambda_end"] = float(dual.spectrum(problem, states[-1], 1)[0])
            yield row


def adam_rows(
    model: IterativeClassifier,
    start: float,
    limit: float,
    frames: Tensor,
    labels: np.ndarray,
    *,
    epochs: int,
    exponents: Sequence[int],
) -> Iterator[Row]:
    """Sweep of Adam; the loss of a report is the mean over its epoch.

    Args:
        model: its hyperparameters, learning rate and epochs aside.
        start: the loss before training.
        limit: the predicted rate.
        frames, labels: what it learns.
        epochs: at each rate.
        exponents: as in :func:`softmax_rows`.
    """
    for rate in _rates(limit, exponents):
        clock = time.perf_counter()
        model.set_params(optimizer="Adam", lr=rate, max_epochs=epochs)
        found = verdict([start, *curvature.losses(model, frames, labels)])
        yield {
            "kind": "sweep",
            "method": "Adam",
            "predicted": limit,
            "rate": rate,
            **found,
            "seconds": time.perf_counter() - clock,
        }


def network_rows(
    frames: Tensor,
    labels: np.ndarray,
    *,
    n: int,
    side: int,
    steps: int,
    exponents: Sequence[int],
    adam: Mapping[str, Any],
    batch: int,
    seed: int,
) -> Iterator[Row]:
    """Sweeps of gradient descent and Adam for the convolutional networks, on pixels in 0…1.

    Args:
        n: frames they see.
        side: pixels a side that they see, in the middle of each frame.
        steps: of gradient descent at each rate.
        exponents: as in :func:`softmax_rows`.
        adam: of :func:`adam_rows`, for the networks.
        batch: frames in a minibatch of Adam.
        seed: of initial weights and minibatches.
    """
    chosen = learning_curve_subsets(np.arange(len(labels)), labels, [n], seed)[n]
    seen, truth = curvature.window(frames[torch.from_numpy(chosen)], side), labels[chosen]
    for name, filters in NETWORKS.items():
        common = {"model": name, "n": n, "d": seen[0].numel(), "pixels": "unit", "start": "random"}
        model = CNN(filters=filters, batch_size=batch, seed=seed)
        begin = curvature.start(model, seen, truth, batch)
        plain = CNN(filters=filters, optimizer="SGD", batch_size=None, max_epochs=steps, seed=seed)
        for rate in _rates(2 / begin.lambda_max, exponents):
            clock = time.perf_counter()
            plain.set_params(lr=rate)
            # Of the full batch a report tells the loss before its step: the first is the start.
            found = verdict(curvature.losses(plain, seen, truth))
            row = {
                "kind": "sweep",
                **common,
                "method": "GD",
                "lambda_max": begin.lambda_max,
                "predicted": 2 / begin.lambda_max,
                "rate": rate,
                **found,
                "seconds": time.perf_counter() - clock,
            }
            if found["exceeds"] == "no":
                row["lambda_end"] = curvature.sharpness(plain, seen, truth)
            yield row
        for row in adam_rows(model, begin.loss, begin.adam_limit, seen, truth, **adam):
            yield {**common, **row}


def _rates(predicted: float, exponents: Sequence[int]) -> list[float]:
    return [predicted * 2 ** (k / 2 + 0.25) for k in sorted(exponents)]


def verdict(losses: Sequence[float], floor: float = 0.0) -> Row:
    """What the losses say: the one of the start, then one a report.

    Args:
        losses: above the floor.
        floor: loss of the optimum, where it is known, else zero.
    """
    slack = _ROUNDING * max(losses[0], floor)
    pairs = enumerate(itertools.pairwise(losses), start=1)
    first = next((k for k, (a, b) in pairs if not b <= a + slack), None)  # NaN is no fall
    highest = math.inf if any(map(math.isnan, losses)) else max(losses)
    return {
        "reports": len(losses) - 1,
        "loss_start": losses[0],
        "loss_end": losses[-1],
        "loss_max": highest,
        "first_rise": first,
        "rises": "no" if first is None else "yes",
        "exceeds": "yes" if highest > losses[0] + slack else "no",
        "ends_above": "no" if losses[-1] <= losses[0] else "yes",
    }
