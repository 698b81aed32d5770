"""How the accuracies of the networks depend on initial weights, pixel scale and when one reads.

A network trains for a number of steps that is the same for all, whatever its accuracies; they are
evaluated as training goes on, often until they have passed all that is read off the curve, then
seldom. A row is one evaluation: what a reader would have written down is decided by ``readings``,
from the same curve.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from omegaconf import OmegaConf
from rich.console import Console
from torch import Tensor

from experiments.protocol import data
from experiments.protocol.clock import Clock
from experiments.protocol.model import Model
from experiments.protocol.scenes import at_seed, scene_at
from experiments.protocol.trial import instantiate
from experiments.records.measurement import Row, in_parts, measure

NAME = "table1_conditions_networks"


def run(
    scene: Mapping[str, Any],
    split: Mapping[str, Any],
    models: Mapping[str, Mapping[str, Any]],
    cases: Sequence[Mapping[str, Any]],
    seeds: Sequence[int],
    steps: int,
    target: float,
    reports_per_epoch: int,
    later_per_epoch: int,
    evaluated_together: int,
    cache: bool = True,
    force: bool = False,
) -> Path:
    """Measure, and write ``measured/table1_conditions_networks-HASH/``; after a break it goes on.

    Args:
        scene, split: configurations.
        models: by name, what a file of ``configs/model`` holds; only its part ``model`` counts.
        cases: each a ``model`` by name, ``init``, ``init_std`` and ``pixels`` of it.
        seeds: each one a sensor, its session, a split and initial weights.
        steps: of the optimiser, for each case.
        target: training accuracy up to which, and for as many steps again, there are
            ``reports_per_epoch`` evaluations an epoch.
        reports_per_epoch, later_per_epoch: evaluations, before and after.
        evaluated_together: frames in a batch of an evaluation; of no consequence but for speed.
        cache: keep made frames in the results' cache.
        force: measure again.

    Returns:
        Path: the folder. The columns of its rows: ``origin`` of the frames; ``model``, ``init``,
        ``init_std``, ``pixels``, ``seed``; ``step``, the mean ``loss`` of the steps since the last
        evaluation, ``train_accuracy``, ``test_accuracy`` of ``n_test`` samples; ``training_s``,
        seconds of the steps so far, evaluations aside.

    Raises:
        ValueError: naming the key of a model that there is not, or of a number of evaluations that
            does not fit the other.
    """
    if unknown := [case["model"] for case in cases if case["model"] not in models]:
        raise ValueError(
            f"task.cases: expected models among {', '.join(models)}, found {unknown[0]}"
        )
    if reports_per_epoch % later_per_epoch:
        raise ValueError(
            f"task.later_per_epoch: expected a divisor of {reports_per_epoch}, "
            f"found {later_per_epoch}"
        )
    console = Console(highlight=False)
    own = {"_target_": f"{__name__}.run"}
    fixed: dict[str, Any] = {
        "scene": scene,
        "split": split,
        "steps": steps,
        "target": target,
        "reports_per_epoch": reports_per_epoch,
        "later_per_epoch": later_per_epoch,
        "evaluated_together": evaluated_together,
    }

    def part(case: Mapping[str, Any], seed: int) -> tuple[Row, Callable[[], Iterator[Row]]]:
        name = case["model"]
        start = {key: case[key] for key in ("init", "init_std", "pixels")}
        model = {**models[name]["model"], **start, "reports_per_epoch": reports_per_epoch}

        def compute() -> Iterator[Row]:
            console.print(f"[dim]{NAME}: {name}, {start}, seed {seed}[/dim]")
            made = scene_at(scene, seed, cache, console)
            for row in curve(made, model, seed, **{k: v for k, v in fixed.items() if k != "scene"}):
                yield {"origin": made.origin, "model": name, **start, "seed": seed, **row}

        return own | fixed | {"model": model, "seed": seed}, compute

    chosen = {name: {"model": part["model"]} for name, part in models.items()}
    config = own | fixed | {"models": chosen, "cases": cases, "seeds": seeds}
    parts = (part(case, seed) for case in cases for seed in seeds)
    return measure(
        NAME, config, lambda: in_parts(NAME, parts, force=force), force=force, console=console
    )


def curve(
    scene: Any,
    model: Mapping[str, Any],
    seed: int,
    *,
    split: Mapping[str, Any],
    steps: int,
    target: float,
    reports_per_epoch: int,
    later_per_epoch: int,
    evaluated_together: int,
) -> Iterator[Row]:
    """A row an evaluation of one training, until its steps are done or its loss is not finite."""
    clock = Clock()
    (train, truth), (test, test_truth) = (
        (data.take(scene, indices, clock)[:], scene.labels[indices])
        for indices in data.choose(scene, split, seed)
    )
    network: Model = instantiate(OmegaConf.create(at_seed(dict(model), seed)), "model")
    batch = min(int(model["batch_size"]), len(truth))

    def accuracy(frames: Tensor, labels: np.ndarray) -> float:
        parts = (
            network.predict(frames[first : first + evaluated_together])
            for first in range(0, len(labels), evaluated_together)
        )
        return float((np.concatenate(list(parts)) == labels).mean())

    reports = iter(network.train(train, truth))
    step, losses, crossed, sparse = 0, 0, math.inf, reports_per_epoch // later_per_epoch
    total = 0.0
    for number in range(1, 10**9):
        with clock.running():
            report = next(reports, None)
        if report is None:
            return
        # The last batch of an epoch may be a smaller one.
        epoch, rest = divmod(round(report["samples_seen"]), len(truth))
        last, step = step, epoch * math.ceil(len(truth) / batch) + math.ceil(rest / batch)
        losses, total = losses + step - last, total + (step - last) * report["loss"]
        over = step >= steps or not math.isfinite(report["loss"])
        if step > 2 * crossed and number % sparse and not over:
            continue
        row = {"step": step, "loss": total / losses, "n_test": len(test_truth)}
        losses, total = 0, 0.0
        if math.isfinite(report["loss"]):
            row["train_accuracy"] = accuracy(train, truth)
            row["test_accuracy"] = accuracy(test, test_truth)
            if row["train_accuracy"] >= target:
                crossed = min(crossed, step)
        yield {**row, "training_s": clock.seconds}
        if over:
            return
