"""What was fitted: ``experiment=calibration`` moves every fitted parameter of the simulated sensor.

Each is set to a smaller and a larger value, the others staying at their own, and what it was fitted
to is measured as the other studies measure it: Eq. 4 and accuracy against N on touch, accuracy on
finger and spatial, and the accuracies before and after recalibration on drift. The seeds are others
than those of every other result.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from omegaconf import OmegaConf
from rich.console import Console

from experiments.protocol import data
from experiments.protocol.clock import Clock
from experiments.protocol.scenes import scene_at
from experiments.records.measurement import Row, measure
from experiments.studies.correlation import measure as correlation
from experiments.studies.drift.measure import Sessions, choose, updates
from hdc import HDCClassifier
from scenes.frames import Frames, Scene

Parameters = Mapping[str, Sequence[float]]


def run(
    scene: Mapping[str, Mapping[str, Any]],
    split: Mapping[str, Any],
    seeds: Sequence[int],
    fitted: Mapping[str, Parameters],
    n_train: Sequence[int | None],
    drift: Mapping[str, Any],
    device: str = "cpu",
    force: bool = False,
) -> Path:
    """Measure, and write ``measured/calibration/``.

    Args:
        scene: configurations of the scenes by name.
        split: configuration of the split of all of them.
        seeds: of scene and split.
        fitted: by scene and key in its configuration, three values: a smaller one, the scene's own
            and a larger one.
        n_train: numbers of training samples on touch; None for all.
        drift: ``n_test`` and ``n_new``, samples of the second session that test and recalibrate,
            and ``p`` of the recalibration.
        device: where frames are made.
        force: measure again.

    Returns:
        Path: the folder. The columns of its rows: ``scene``, ``seed``; ``parameter`` and its value
        ``at``, both empty for the scene as it is; ``kind``, which is ``speckle`` with the columns
        of :func:`experiments.studies.correlation.measure.run`, or ``accuracy``, ``stored`` or
        ``recovered`` with ``right`` of ``n_test`` samples after training with ``n_train``.

    Raises:
        ValueError: naming the parameter of which the scene's own value is not the middle one.
    """
    console = Console(highlight=False)
    config = {
        "_target_": f"{__name__}.run",
        "scene": scene,
        "split": split,
        "seeds": seeds,
        "fitted": fitted,
        "n_train": n_train,
        "drift": drift,
    }
    settings = {
        name: [("", "", scene[name]), *_neighbours(name, scene[name], parameters, console)]
        for name, parameters in fitted.items()
    }

    def rows(name: str, made: Scene, seed: int) -> Iterator[Row]:
        if name == "touch":
            yield from on_touch(made, split, seed, n_train)
        elif name == "drift":
            yield from on_drift(made, split, seed, **drift)
        else:
            yield accuracy(made, split, seed)

    def compute() -> Iterator[Row]:
        for name, of_scene in settings.items():
            for seed in seeds:
                for parameter, at, changed in of_scene:
                    made = scene_at(changed, seed, False, console)
                    where = {"scene": name, "seed": seed, "parameter": parameter, "at": at}
                    yield from ({**where, **row} for row in rows(name, made, seed))
                console.print(f"calibration: {name}, seed {seed}")

    return measure("calibration", config, compute, device=device, force=force, console=console)


def _neighbours(
    name: str, scene: Mapping[str, Any], parameters: Parameters, console: Console
) -> Iterator[tuple[str, float, Mapping[str, Any]]]:
    """(parameter, value, configuration) of the values beside the scene's own; no frame is made."""
    own = scene_at(scene, 0, False, console).fingerprint()
    for parameter, values in parameters.items():
        made = [with_value(scene, parameter, value) for value in values]
        same = [scene_at(one, 0, False, console).fingerprint() == own for one in made]
        if same != [False, True, False] or sorted(values) != list(values):
            raise ValueError(
                f"task.fitted.{name}.{parameter}: expected a smaller value, the scene's own and a "
                f"larger one, found {list(values)}"
            )
        yield from ((parameter, values[k], made[k]) for k in (0, 2))


def with_value(scene: Mapping[str, Any], key: str, value: float) -> dict[str, Any]:
    """A scene's configuration with another value at a dotted key."""
    changed = OmegaConf.create(dict(scene))
    OmegaConf.update(changed, key, value)
    return OmegaConf.to_container(changed)  # type: ignore[return-value]


def on_touch(
    made: Scene, split: Mapping[str, Any], seed: int, n_train: Sequence[int | None]
) -> Iterator[Row]:
    """C_ll′ of Eq. 4, and accuracy against the number of training samples."""
    # In memory, so that each frame is made once.
    frames = made.frames(np.arange(len(made.labels)))
    whole: Any = Frames(frames, made.labels, tuple(made.classes), made.samples)
    chosen = (["speckle"], ["all"])
    members = correlation.members_of(whole, split, seed)
    yield from correlation.rows(made.classes, *correlation.add_up(whole, members, *chosen), *chosen)
    for n in n_train:
        yield accuracy(whole, {**split, "n_train": n}, seed)


def on_drift(
    made: Scene, split: Mapping[str, Any], seed: int, n_test: int, n_new: int, p: float
) -> Iterator[Row]:
    """Accuracy in the second session, of the stored prototypes and after an update."""
    choice = choose(made, split, n_test, "random", seed)
    rows = updates(
        Sessions(made), choice, HDCClassifier(), [n_new], [p], order="random", draws=1, seed=seed
    )
    for row in rows:
        kind = {"stored": "stored", "replace": "recovered"}.get(row["method"])
        if kind:
            yield {
                "kind": kind,
                "n_train": row["n_old"],
                "right": row["right_new"],
                "n_test": row["n_test_new"],
            }


def accuracy(made: Scene, split: Mapping[str, Any], seed: int) -> Row:
    """How many test samples HDC has right."""
    train, test = data.choose(made, split, seed)
    seen, asked = (data.take(made, part, Clock("cpu")) for part in (train, test))
    predicted = HDCClassifier().fit(seen, made.labels[train]).predict(asked)
    right = int((predicted == made.labels[test]).sum())
    return {"kind": "accuracy", "n_train": len(train), "right": right, "n_test": len(test)}
