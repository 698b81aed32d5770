"""Train softmax regression under the conditions that Table I leaves open.

The paper gives the learning rate, 1e-4, but not the optimiser, the batch, the initial weights or
the scale of the pixels. Gradient descent and SGD are computed exactly in sample space; Adam and the
networks are ordinary runs of ``model=softmax``, ``cnn1`` and ``cnn3``.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import torch
from torch import Tensor

from baselines.descent import Descent
from experiments.protocol import data
from experiments.protocol.experiment import Row, Run, experiment
from experiments.studies.conditions.linear import Problem, Start, StartProducts
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
    trainings = _trainings(starts, normal, draws)
    for seed, made in run.scenes(scene, seeds):
        run.note(f"seed {seed}")
        frames = made.frames(range(len(made.labels)))
        train, test = data.choose(made, split, seed)
        # Kernels that are compiled meanwhile would take time from what is timed here.
        hdc = HDCClassifier(backend="numpy").fit(frames[train], made.labels[train])
        is_right = hdc.predict(frames[test]) == made.labels[test]
        right = float(is_right.mean())
        classes, dimension = len(made.classes), frames[0].numel()
        products = StartProducts(frames, seed, draws, classes)
        for scaling in pixels:
            problem = Problem(products, made.labels, train, test, scaling)
            for method, how in methods.items():
                readings = train_all(problem, trainings, rate, levels, seed, **how)
                for (start, number), reading in zip(trainings, readings, strict=True):
                    yield {
                        "origin": made.origin,
                        "seed": seed,
                        "pixels": scaling,
                        "method": method,
                        "start": start.rule,
                        "sigma": start.sigma(dimension, classes),
                        "draw": number,
                        **reading,
                        "across": problem.across,
                        "hdc": right,
                    }


def _trainings(
    starts: Sequence[str], normal: Sequence[float], draws: int
) -> list[tuple[Start, int]]:
    """Every start with the number of each draw of it; all starts at zero are one."""
    begun = [Start(rule) for rule in starts]
    begun += [Start("normal", float(deviation)) for deviation in normal]
    trainings = []
    for start in begun:
        n = 1 if start.rule == "zeros" else draws
        trainings += [(start, number) for number in range(n)]
    return trainings


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
    steps_an_epoch = math.ceil(n / (batch or n))
    steps_between = max(1, steps_an_epoch // reports_per_epoch)
    starts, to_span = side_by_side(problem, trainings)
    classes = starts.shape[1]
    targets = problem.targets[:n]
    descent = Descent(
        problem.kernel,
        targets,
        classes,
        rate,
        logits=starts,
        batch=batch,
        seed=seed,
    )
    readings = [Reading(levels) for _ in trainings]
    alive = readings
    reports = {*range(steps_between, steps, steps_between), steps}
    for step in range(1, steps + 1):
        descent.step()
        if step not in reports:
            continue
        shares = accuracies(descent.logits, to_span, problem)
        for reading, share in zip(alive, shares, strict=True):
            reading.note(step, share)
        goes_on = [not reading.ended for reading in alive]
        if not any(goes_on):
            break
        if not all(goes_on):
            alive = list(itertools.compress(alive, goes_on))
            kept = torch.tensor(goes_on).nonzero().flatten()
            descent.drop(kept)
            to_span = to_span[:, :, kept].contiguous()
    return [reading.columns for reading in readings]


def side_by_side(
    problem: Problem, trainings: Sequence[tuple[Start, int]]
) -> tuple[Tensor, Tensor]:
    """Initial logits [N + M, L, V], and changes of test logits by projection [M, L, V]."""
    begun = [problem.start(*training) for training in trainings]
    logits, shifts = zip(*begun, strict=True)
    return torch.stack(logits, dim=2), torch.stack(shifts, dim=2)


class Reading:
    """When one training first passed each level, and its accuracies then.

    Training accuracy exceeds a level; the last one, at which the training ends, it only reaches.
    """

    def __init__(self, levels: Mapping[str, float]):
        self._levels = levels
        *_, self._last = levels
        self.columns: Row = {}
        for level in levels:
            for value in ("steps", *VALUES):
                self.columns[f"{value}_{level}"] = None

    @property
    def ended(self) -> bool:
        return self.columns[f"steps_{self._last}"] is not None

    def note(self, step: int, shares: Sequence[float]) -> None:
        """Accuracies, as :data:`VALUES` names them, after so many steps."""
        for level, least in self._levels.items():
            if self.columns[f"steps_{level}"] is not None:
                continue
            passed = shares[0] > least
            if level == self._last:
                passed = shares[0] >= least - 1e-9
            if passed:
                self.columns[f"steps_{level}"] = step
                for name, share in zip(VALUES, shares, strict=True):
                    self.columns[f"{name}_{level}"] = share


def accuracies(
    logits: Tensor, to_span: Tensor, problem: Problem
) -> list[tuple[float, float, float]]:
    """Accuracies of V trainings as :data:`VALUES` names them, from all logits [N + M, L, V]."""
    n = problem.n_train
    targets = problem.targets
    of_train = accuracy(logits[:n], targets[:n])
    of_test = accuracy(logits[n:], targets[n:])
    projected = accuracy(logits[n:] + to_span, targets[n:])
    return list(zip(of_train, of_test, projected, strict=True))


def accuracy(logits: Tensor, targets: Tensor) -> list[float]:
    """Share of frames whose class has the highest logit, ties included: [n, L, V] → V numbers."""
    right = logits[torch.arange(len(targets)), targets]
    is_highest = right >= logits.amax(dim=1)
    return is_highest.double().mean(dim=0).tolist()
