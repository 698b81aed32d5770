"""What light, sensor or labels would have to be like for the published accuracies.

One thing at a time goes wrong, at several levels, in training and in testing alike; then every
model learns and is tested on the same frames. No recipe is involved but that of one iterative
model: ridge regression, softmax regression at its optimum and the correlation have no initial
weights, no rate and no stopping rule. What goes wrong is of one of three kinds:

- ``frames``: disturbances of finished frames (``robustness.disturbances``), each frame its own;
- ``sensor``: another value of one key of the scene, or a second session some kelvin away, in which
  all frames test;
- ``labels``: a share of the training labels replaced by another one.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import torch
from omegaconf import OmegaConf
from rich.console import Console
from torch import Tensor

from experiments.protocol import data
from experiments.protocol.clock import Clock
from experiments.protocol.model import Model
from experiments.protocol.scenes import at_seed, scene_at
from experiments.protocol.trial import instantiate
from experiments.records.measurement import Row, in_parts, measure
from experiments.studies.robustness.disturbances import OF_FRAMES, glare

NAME = "table1_conditions_optics"
Frames = tuple[Tensor, np.ndarray]  # uint8 [N, H, W] and labels [N]


def run(
    scene: Mapping[str, Any],
    split: Mapping[str, Any],
    models: Mapping[str, Mapping[str, Any]],
    linear: Sequence[str],
    softmax: Sequence[str],
    seeds: Sequence[int],
    frames: Mapping[str, Sequence[float]],
    glare_radius: float,
    sensor: Mapping[str, Sequence[float]],
    labels: Sequence[float],
    cache: bool = True,
    force: bool = False,
) -> Path:
    """Measure, and write ``measured/table1_conditions_optics-HASH/``; after a break it goes on.

    Args:
        scene, split: configurations; the scene has one session.
        models: by name, what a file of ``configs/model`` holds; only its part ``model`` counts.
        linear: models of which the best is compared with HDC.
        softmax: models that stand for the published softmax regression.
        seeds: each one a sensor, its session, a split and what is drawn.
        frames: levels by name of a disturbance of finished frames.
        glare_radius: of ``glare``.
        sensor: levels by name of a change of the scene (:data:`OF_SCENES`).
        labels: shares of the training labels that are replaced.
        cache: keep the frames of the unchanged scene in the results' cache.
        force: measure again.

    Returns:
        Path: the folder. The columns of its rows: ``origin`` of the frames; ``condition`` and its
        ``level``; ``seed``, ``model``; ``right`` of ``n_test`` samples, ``train_accuracy``.

    Raises:
        ValueError: naming the key of a condition or a model that there is not.
    """
    for key, names, known in (
        ("frames", frames, OF_FRAMES),
        ("sensor", sensor, OF_SCENES),
        ("linear", linear, models),
        ("softmax", softmax, models),
    ):
        if unknown := [name for name in names if name not in known]:
            raise ValueError(
                f"task.{key}: expected names among {', '.join(known)}, found {unknown[0]}"
            )
    console = Console(highlight=False)
    own = {"_target_": f"{__name__}.run"}
    fixed: dict[str, Any] = {
        "scene": scene,
        "split": split,
        "models": {name: {"model": part["model"]} for name, part in models.items()},
        "glare_radius": glare_radius,
    }
    cases = [("none", 0.0)]
    cases += [(name, level) for name, levels in {**frames, **sensor}.items() for level in levels]
    cases += [("labels", level) for level in labels]

    def part(case: tuple[str, float], seed: int) -> tuple[Row, Callable[[], Iterator[Row]]]:
        def compute() -> Iterator[Row]:
            console.print(f"[dim]{NAME}: {case[0]} {case[1]:g}, seed {seed}[/dim]")
            return rows_of(*case, seed, **fixed, cache=cache, console=console)

        return own | fixed | {"case": case, "seed": seed}, compute

    config = own | fixed | {
        "linear": linear, "softmax": softmax, "seeds": seeds, "frames": frames, "sensor": sensor,
        "labels": labels,
    }  # fmt: skip
    parts = (part(case, seed) for seed in seeds for case in cases)
    return measure(
        NAME, config, lambda: in_parts(NAME, parts, force=force), force=force, console=console
    )


def rows_of(
    condition: str,
    level: float,
    seed: int,
    *,
    scene: Mapping[str, Any],
    split: Mapping[str, Any],
    models: Mapping[str, Mapping[str, Any]],
    glare_radius: float,
    cache: bool,
    console: Console,
) -> Iterator[Row]:
    """A row for each model, all trained and tested on the same frames under one condition."""
    changed = condition in OF_SCENES
    if changed:
        scene, split = OF_SCENES[condition](scene, split, level)
    # Other frames are needed once; those of the scene as it is, in every condition.
    made = scene_at(scene, seed, cache and not changed, console)
    train, test = (
        (data.take(made, indices, Clock())[:], made.labels[indices])
        for indices in data.choose(made, split, seed)
    )
    train, test = disturbed(train, test, condition, level, seed, glare_radius)
    for name, part in models.items():
        model: Model = instantiate(OmegaConf.create(at_seed(part["model"], seed)), "model")
        for _ in model.train(*train):
            pass
        yield {
            "origin": made.origin,
            "condition": condition,
            "level": level,
            "seed": seed,
            "model": name,
            "n_test": len(test[1]),
            "right": int((model.predict(test[0]) == test[1]).sum()),
            "train_accuracy": float((model.predict(train[0]) == train[1]).mean()),
        }


def disturbed(
    train: Frames, test: Frames, condition: str, level: float, seed: int, glare_radius: float
) -> tuple[Frames, Frames]:
    """Both parts as a disturbance of frames or labels leaves them; as they are for any other."""
    if condition == "labels":
        return (train[0], mislabelled(train[1], level, np.random.default_rng(seed))), test
    if condition not in OF_FRAMES:
        return train, test
    named = OF_FRAMES | {"glare": partial(glare, radius=glare_radius)}
    change = named[condition]
    one, other = (
        (torch.from_numpy(change(frames.numpy(), level, np.random.default_rng([seed, k]))), labels)
        for k, (frames, labels) in enumerate((train, test))
    )
    return one, other


def mislabelled(labels: np.ndarray, share: float, random: np.random.Generator) -> np.ndarray:
    """Labels [N] of which a share, to the nearest whole number, is another one of those present.

    Raises:
        ValueError: if the share is outside [0, 1].
    """
    if not 0 <= share <= 1:
        raise ValueError(f"task.labels: expected shares in [0, 1], found {share}")
    classes, place = np.unique(labels, return_inverse=True)
    wrong = random.choice(len(labels), round(share * len(labels)), replace=False)
    place[wrong] = (place[wrong] + random.integers(1, len(classes), len(wrong))) % len(classes)
    return classes[place]


# Scenes -------------------------------------------------------------------------------------------

Change = Callable[[Mapping[str, Any], Mapping[str, Any], float], tuple[Any, Any]]


def _camera(key: str) -> Change:
    def change(scene: Any, split: Any, level: float) -> tuple[Any, Any]:
        sensor = scene["sensor"]
        camera = {**sensor.get("camera", {}), key: level}
        return {**scene, "sensor": {**sensor, "camera": camera}}, split

    return change


def _repeatability(scene: Any, split: Any, level: float) -> tuple[Any, Any]:
    contact = dict(scene["contact"])
    for key in ("depth_spread", "position_spread"):
        contact[key] = level * contact[key]
    return {**scene, "contact": contact}, split


def _session(scene: Any, split: Any, level: float) -> tuple[Any, Any]:
    first, *others = scene.get("sessions") or [{"_target_": "scenes.sensor.environment.Room"}]
    if others:
        raise ValueError(
            f"task.sensor.session: expected a scene of one session, found {1 + len(others)}"
        )
    moved = {**first, "offset": first.get("offset", 0.0) + level}
    return {**scene, "sessions": [first, moved]}, {**split, "kind": "session"}


OF_SCENES: dict[str, Change] = {
    "exposure": _camera("grey"),
    "photons": _camera("photons"),
    "repeatability": _repeatability,
    "session": _session,
}
"""By name, (scene, split, level) → both with one thing changed: grey level at the mean intensity,
electrons a pixel there, times the scatter of touches in position and depth, kelvin to a second
session."""
