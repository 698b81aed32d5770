"""What was fitted: ``experiment=calibration`` moves every fitted parameter of the simulated sensor.

Each is set to a smaller and a larger value, the others staying at their own, and the numbers that
it was fitted to are measured as the other studies measure them. The seeds are used nowhere else.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
from omegaconf import OmegaConf

from experiments.protocol import data
from experiments.protocol.clock import Clock
from experiments.protocol.experiment import Row, Run, experiment
from experiments.studies.correlation.measure import correlations
from experiments.studies.correlation.sums import contrast
from experiments.studies.drift.measure import choose, updates
from experiments.studies.recordings.measure import Subsets
from hdc import HDCClassifier
from scenes.frames import Frames, Scene

CURVE = "accuracy"  # of touch after n_train samples
Value = tuple[str, int | None, float]  # quantity of published.csv, or CURVE; n_train; value


@experiment
def calibration(
    run: Run,
    scene: Mapping[str, Mapping[str, Any]],
    split: Mapping[str, Any],
    seeds: Sequence[int],
    fitted: Mapping[str, Mapping[str, Sequence[float]]],
    n_train: Sequence[int | None],
    drift: Mapping[str, Any],
) -> Iterator[Row]:
    """One row: ``value`` of a ``quantity`` of published.csv, in its unit, on one sensor.

    ``parameter`` and its value ``at`` are null for the scene as it is; ``n_train`` counts training
    samples, of which :data:`CURVE` is a function.
    Arguments: configs/experiment/calibration.yaml.

    Raises:
        ValueError: naming the parameter of which the scene's own value is not the middle one.
    """
    for name, parameters in fitted.items():
        settings: list[tuple[str | None, float | None, Any]] = [(None, None, scene[name])]
        for parameter, values in parameters.items():
            changed = _neighbours(run, name, scene[name], parameter, values)
            settings += [(parameter, values[k], changed[k]) for k in (0, 2)]
        for seed in seeds:
            for moved, at, config in settings:
                for quantity, n, value in _measured(
                    name, run.scene(config, seed), split, seed, n_train, drift
                ):
                    yield {"scene": name, "seed": seed, "parameter": moved, "at": at,
                           "quantity": quantity, "n_train": n, "value": value}  # fmt: skip
            run.note(f"{name}, seed {seed}")


def _neighbours(
    run: Run, name: str, scene: Mapping[str, Any], parameter: str, values: Sequence[float]
) -> list[Any]:
    """The scene's configuration at each of three values; no frame is made."""
    changed: list[Any] = []
    for value in values:
        config = OmegaConf.create(dict(scene))
        OmegaConf.update(config, parameter, value)
        changed.append(OmegaConf.to_container(config))
    unchanged = run.scene(scene, 0).fingerprint()
    same = [run.scene(config, 0).fingerprint() == unchanged for config in changed]
    if same != [False, True, False] or sorted(values) != list(values):
        raise ValueError(
            f"task.fitted.{name}.{parameter}: expected a smaller value, the scene's own and a "
            f"larger one, found {list(values)}"
        )
    return changed


def _measured(
    name: str,
    scene: Scene,
    split: Mapping[str, Any],
    seed: int,
    n_train: Sequence[int | None],
    drift: Mapping[str, Any],
) -> Iterator[Value]:
    if name == "drift":
        yield from _of_drift(scene, split, seed, **drift)
    elif name == "touch":
        frames = scene.frames(np.arange(len(scene.labels)))  # in memory: each frame is made once
        whole: Any = Frames(frames, scene.labels, tuple(scene.classes), scene.samples)
        values = [row["value"] for row in correlations(whole, split, seed, ["speckle"], ["all"])]
        matrix = np.reshape(values, (len(scene.classes),) * 2)
        yield "correlation/max_same_class_speckle", None, float(np.diag(matrix).max())
        yield "correlation/contrast_speckle", None, contrast(matrix)
        for n in n_train:
            yield CURVE, *_accuracy(whole, {**split, "n_train": n}, seed)
    else:
        yield f"{name}/test_accuracy", *_accuracy(scene, split, seed)


def _of_drift(
    scene: Scene, split: Mapping[str, Any], seed: int, n_test: int, n_new: int, p: float
) -> Iterator[Value]:
    """Accuracy in the second session, of the stored prototypes and after an update."""
    choice = choose(scene, split, n_test, "random", seed)
    model = HDCClassifier(balance=False)
    rows = updates(Subsets(scene), choice, model, [n_new], [p], "random", 1, seed)
    for row in rows:
        if kind := {"stored": "stored", "replace": "recovered"}.get(row["method"]):
            share = 100 * row["right_new"] / row["n_test_new"]
            yield f"drift/{kind}_accuracy", row["n_old"], share


def _accuracy(scene: Scene, split: Mapping[str, Any], seed: int) -> tuple[int, float]:
    """Training samples, and HDC's test accuracy in percent."""
    train, test = data.choose(scene, split, seed)
    seen, asked = (data.take(scene, part, Clock("cpu")) for part in (train, test))
    predicted = HDCClassifier(balance=False).fit(seen, scene.labels[train]).predict(asked)
    return len(train), 100 * float((predicted == scene.labels[test]).mean())
