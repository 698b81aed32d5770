"""Train softmax regression under the conditions that Table I leaves open.

The paper gives the learning rate, 1e-4, but not the optimiser, the batch, the initial weights or
the scale of the pixels. Gradient descent and SGD are computed exactly in sample space; Adam and the
networks are ordinary runs of ``model=softmax``, ``cnn1`` and ``cnn3``.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import torch
from torch import Tensor

from baselines.dual import Descent
from experiments.protocol import data
from experiments.protocol.experiment import Row, Run, experiment
from experiments.studies.conditions import linear
from experiments.studies.conditions.linear import Problem, Start
from hdc import HDCClassifier

VALUES = ("train", "test", "projected")  # accuracies read at each level


@experiment(revision=1, timed=True)
def table1_conditions(
    run: Run,
    scene: Mapping[str, Any],
    split: Mapping[str, Any],
    seeds: Sequence[int],
    draws: int,
    pixels: Sequence[str],
    starts: Sequence[str],
    normal: Sequence[float],
    methods: Mapping[str, Mapping[str, Any]],
    rate: float,
    levels: Mapping[str, float],
) -> Iterator[Row]:
    """One row: one training of softmax regression from one draw of initial weights.

    Columns: ``seed`` of the sensor, ``pixels``, ``method``, ``start``, ``sigma`` (standard
    deviation of an initial weight), ``draw``; for each level ``NAME`` of training accuracy
    ``steps_NAME``, ``train_NAME``, ``test_NAME`` and ``projected_NAME`` (test accuracy had the
    start been projected on the span of the training frames), None if not reached; ``across`` of
    :class:`~experiments.studies.conditions.linear.Problem`; ``hdc``, test accuracy of HDC.
    Arguments: configs/experiment/table1_conditions.yaml.
    """
    begun = [
        *(Start(rule) for rule in starts),
        *(Start("normal", float(std)) for std in normal),
    ]
    # All starts at zero are one.
    trainings = [
        (s, k) for s in begun for k in range(1 if s.rule == "zeros" else draws)
    ]
    for seed, made in run.scenes(scene, seeds):
        run.note(f"seed {seed}")
        frames = made.frames(range(len(made.labels)))
        train, test = data.choose(made, split, seed)
        hdc = HDCClassifier().fit(frames[train], made.labels[train])
        right = float((hdc.predict(frames[test]) == made.labels[test]).mean())
        classes, dimension = len(made.classes), frames[0].numel()
        products = linear.Products(frames, seed, draws, classes)
        for scaling in pixels:
            problem = Problem(products, made.labels, train, test, scaling)
            for method, how in methods.items():
                readings = train_all(problem, trainings, rate, levels, seed, **how)
                for (start, number), reading in zip(trainings, readings, strict=True):
                    yield {
                        "origin": made.origin, "seed": seed, "pixels": scaling, "method": method,
                        "start": start.rule, "sigma": start.sigma(dimension, classes),
                        "draw": number, **reading, "across": problem.across, "hdc": right,
                    }  # fmt: skip


def train_all(
    problem: Problem,
    trainings: Sequence[tuple[Start, int]],
    rate: float,
    levels: Mapping[str, float],
    seed: int,
    *,
    batch: int | None,
    reports_per_epoch: int,
    steps: int,
) -> list[Row]:
    """Accuracies of each training (a start and the number of its draw) at each level, all trained
    side by side; `seed` is that of the minibatches."""
    n = problem.n_train
    every = max(1, -(-n // (batch or n)) // reports_per_epoch)
    logits, shifts = zip(
        *(problem.start(*training) for training in trainings), strict=True
    )
    to_span = torch.stack(shifts, dim=2)
    starts = torch.stack(logits, dim=2)
    targets, classes = problem.targets[:n], starts.shape[1]
    descent = Descent(
        problem.kernel, targets, classes, rate, logits=starts, batch=batch, seed=seed
    )
    names = [f"{value}_{level}" for level in levels for value in ("steps", *VALUES)]
    readings: list[Row] = [dict.fromkeys(names) for _ in trainings]
    *_, last = levels
    alive = list(range(len(trainings)))
    for step in range(1, steps + 1):
        descent.step()
        if step % every and step != steps:
            continue
        train, test = descent.logits[:n], descent.logits[n:]
        shares = [accuracy(train, targets)]
        shares += [
            accuracy(logits, problem.targets[n:]) for logits in (test, test + to_span)
        ]
        for k, *values in zip(alive, *shares, strict=True):
            for level, least in levels.items():
                passed = (
                    values[0] >= least - 1e-9 if level == last else values[0] > least
                )
                if passed and readings[k][f"steps_{level}"] is None:
                    readings[k][f"steps_{level}"] = step
                    readings[k] |= {
                        f"{x}_{level}": v for x, v in zip(VALUES, values, strict=True)
                    }
        kept = [p for p, k in enumerate(alive) if readings[k][f"steps_{last}"] is None]
        if not kept:
            break
        if len(kept) < len(alive):
            alive = [alive[place] for place in kept]
            descent.drop(torch.tensor(kept))
            to_span = to_span[:, :, kept].contiguous()
    return readings


def accuracy(logits: Tensor, targets: Tensor) -> list[float]:
    """Share of frames whose class has the highest logit, ties included: [n, L, V] → V numbers."""
    right = logits[torch.arange(len(targets)), targets]
    return (right >= logits.amax(dim=1)).double().mean(dim=0).tolist()
