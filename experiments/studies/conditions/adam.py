"""The same question for Adam, on all pixels.

Adam divides each slope by a mean of its own squares, pixel by pixel: its steps leave the span of
the frames, the part of the start that frames do not see is no longer left alone, and there is no
form in the space of samples. Different starts are trained side by side, on the same frames in the
same order: they share the reading of pixels and nothing else. In float32, as the baseline is.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import torch
from rich.console import Console
from torch import Tensor
from torch.nn import functional as F

from baselines.pixels import fit_scaling
from baselines.softmax import SoftmaxRegression
from experiments.protocol import data, evaluate
from experiments.protocol.scenes import scene_at
from experiments.records.measurement import Row, in_parts, measure
from experiments.studies.conditions import linear
from experiments.studies.conditions.linear import Start
from experiments.studies.conditions.measure import levels_of
from experiments.studies.conditions.readings import Curve, Levels, read, report
from hdc import HDCClassifier

NAME = "table1_conditions_adam"
_CHUNK = 20  # frames scaled at a time


def run(
    scene: Mapping[str, Any],
    split: Mapping[str, Any],
    sensors: Mapping[str, Sequence[int]],
    pixels: Sequence[str],
    starts: Mapping[str, Mapping[str, Any]],
    rate: float,
    batch: int,
    reports_per_epoch: int,
    epochs: int,
    reading: Mapping[str, Any],
    cache: bool = True,
    force: bool = False,
) -> Path:
    """The task of configs/experiment/table1_conditions_adam.yaml.

    Args:
        scene, split: as in the configuration of a run.
        sensors, pixels, starts, rate, reading, cache, force: as in ``measure.run``, with scalings
            of ``baselines.pixels``; one draw of initial weights for each sensor.
        batch: frames a step.
        reports_per_epoch: how often in an epoch a curve has a point.
        epochs: after which it ends.

    Returns:
        Path: the folder; its rows are those of ``measure.run``, without what is of the span.

    Raises:
        ValueError: naming the key that is wrong.
    """
    console = Console(highlight=False)
    levels = levels_of(reading)
    parsed = linear.starts_of(starts, "task.starts")
    how: dict[str, Any] = {
        "rate": rate, "batch": batch, "reports_per_epoch": reports_per_epoch, "epochs": epochs
    }  # fmt: skip
    config = {
        "_target_": f"{__name__}.run",
        "scene": scene,
        "split": split,
        "sensors": sensors,
        "pixels": pixels,
        "starts": starts,
        **how,
        "reading": {**reading, "published": [levels.published, *levels.test]},
    }

    def rows(of: Row) -> Iterator[Row]:
        console.print(f"[dim]{NAME}: {', '.join(map(str, of.values()))}[/dim]")
        made = scene_at(scene, of["seed"], cache, console)
        train, test = data.choose(made, {**split, "kind": of["split"]}, of["seed"])
        parts = [(made.frames(part), made.labels[part]) for part in (train, test)]
        hdc, n_pixels = HDCClassifier().fit(*parts[0]), made.shape[0] * made.shape[1]
        fixed: Row = {
            "hdc": evaluate.accuracy(hdc.predict(parts[1][0]), parts[1][1]),
            "n_train": len(train),
            "n_test": len(test),
            "pixels_in_all": n_pixels,
        }
        size = n_pixels, len(made.classes)
        found = curves(parts, list(parsed.values()), of["pixels"], levels, of["seed"], **how)
        for (name, start), curve in zip(parsed.items(), found, strict=True):
            yield {
                **of,
                "method": "Adam",
                "start": name,
                "draw": 0,
                "intervention": "none",
                "sigma": start.sigma(*size),
                **read(curve, levels),
                **fixed,
            }

    def parts() -> Iterator[tuple[Mapping[str, Any], Callable[[], Iterator[Row]]]]:
        for role, seeds in sensors.items():
            for seed in seeds:
                for one in pixels:
                    of = {"role": role, "seed": seed, "split": split["kind"], "pixels": one}
                    yield {**config, "sensors": {}, **of}, partial(rows, of)

    return measure(
        NAME, config, lambda: in_parts(NAME, parts(), force=force), force=force, console=console
    )


def curves(
    parts: Sequence[tuple[Tensor, np.ndarray]],
    starts: Sequence[Start],
    pixels: str,
    levels: Levels,
    seed: int,
    *,
    rate: float,
    batch: int,
    reports_per_epoch: int,
    epochs: int,
) -> list[Curve]:
    """The learning curve from each start.

    Args:
        parts: frames uint8 [n, H, W] and labels, to train and to test.
        starts: V of them, all of draw 0 at the seed.
        pixels: scaling of ``baselines.pixels``.
        levels: where curves are read.
        seed: of starts and minibatches.
        rate, batch, reports_per_epoch, epochs: as in :func:`run`.
    """
    model = SoftmaxRegression(pixels=pixels)
    (frames, _), _ = parts
    targets = model.start(*parts[0])
    scaling = fit_scaling(pixels, model, frames)
    n, (size, classes) = len(frames), (frames[0].numel(), len(model.classes_))
    drawn = linear.draw(seed, 0, classes, size)
    weights = torch.cat([one.factor(size, classes) * drawn.weights[one.family] for one in starts])
    intercepts = torch.cat([one.intercept(drawn.intercepts, size) for one in starts]).float()
    learnt = [weights.requires_grad_(), intercepts.requires_grad_()]
    adam = torch.optim.Adam(learnt, rate, fused=True)
    onehot = F.one_hot(targets, classes).float()[:, None]

    @torch.no_grad()
    def told(part: tuple[Tensor, np.ndarray]) -> tuple[list[float], list[float]]:
        """Loss and accuracy from each start."""
        chunks = [F.linear(scaling(x).flatten(1), *learnt) for x in part[0].split(_CHUNK)]
        scores = torch.cat(chunks).double().view(len(part[1]), -1, classes).transpose(1, 2)
        loss, right = report(scores, torch.from_numpy(np.searchsorted(model.classes_, part[1])))
        return loss.tolist(), right.tolist()

    found = [Curve(start) for start in told(parts[0])[0]]
    random = torch.Generator().manual_seed(seed)
    every = max(1, -(-n // batch) // reports_per_epoch)
    step = 0
    for _ in range(epochs):
        for part in torch.randperm(n, generator=random).split(batch):
            with torch.no_grad():
                seen = scaling(frames[part]).flatten(1)
                scores = F.linear(seen, *learnt).view(len(part), -1, classes)
                slopes = ((scores.softmax(dim=2) - onehot[part]) / len(part)).flatten(1)
                learnt[0].grad, learnt[1].grad = slopes.T @ seen, slopes.sum(dim=0)
            adam.step()
            step += 1
            if step % every:
                continue
            (loss, train), (_, test) = told(parts[0]), told(parts[1])
            for curve, *values in zip(found, loss, train, test, strict=True):
                curve.steps.append(step)
                for into, value in zip((curve.loss, curve.train, curve.test), values, strict=True):
                    into.append(value)
                curve.check(levels)
    return found
