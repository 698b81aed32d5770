"""Drift and recalibration (Fig. 8): what N_new samples of a changed environment are good for, and
what the old ones still add.

Models are trained on N_old samples of the first session (``stored``) and then get N_new of the
second. Each is tested on both sessions: the second shows what was recovered, the first what was
forgotten. By ``method``:

- ``new``: trained on the new samples alone; of HDC, the paper's p = 1.
- ``replace``, p: the paper's, for HDC; each bit of the stored prototype is replaced by the new
  one's with probability p. Hamming distances are sums over bits, so the distance to the mixture is
  (1 − p)·(distance to the stored) + p·(distance to the new prototype) but for a random part of
  order √D: whether a bit was decided by 80 samples to 0 or by 41 to 39 does not count.
- ``pooled``: trained on old and new samples together; of HDC, counting on.
- ``balanced``: the same with as many votes of either session; other models than HDC take each new
  sample N_old/N_new times, rounded.
- ``from_old``: of linear models, started from the old weights, see :mod:`.prior`.

The new samples are the first in time, and the test samples come after them (``order`` time), or
both are drawn at random from the second session, as neighbours in time (``order`` random).

How far the environment has changed is swept besides: the stored models, and models trained on half
as many samples of each of the two sessions (``two_sessions``), are asked in rooms of other
temperatures.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import torch
from rich.console import Console
from torch import Tensor

from baselines.ridge import RidgeReadout
from baselines.softmax_dual import DualSoftmaxRegression
from experiments.protocol import data
from experiments.protocol.scenes import scene_at, scenes
from experiments.protocol.subsets import Model, Products, models_of
from experiments.records.measurement import Row, measure
from experiments.studies.drift.prior import scores_from_old
from hdc import HDCClassifier, bits
from hdc.encode import encode
from hdc.prototypes import Counters, recalibrate
from hdc.recalibration import merged
from scenes.frames import Scene
from scenes.split import by_session, learning_curve_subsets, split

ORDERS = ("time", "random")
_BATCH = 50
_EQUAL = 0.5  # share of the new in all votes


def run(
    scene: Mapping[str, Any],
    old_split: Mapping[str, Any],
    models: Mapping[str, Any],
    seeds: Sequence[int],
    n_test: int,
    n_new: Sequence[int],
    p: Sequence[float],
    order: Sequence[str],
    draws: int,
    offsets: Sequence[float] = (),
    n_test_offset: int = 100,
    device: str = "cpu",
    cache: bool = False,
    force: bool = False,
) -> Path:
    """Measure, and write ``measured/drift/``.

    Args:
        scene: configuration of a scene of two sessions.
        old_split: configuration of the split of the first session; its training samples are N_old.
        models: by name, what a file of ``configs/model`` holds; only its part ``model`` counts.
        seeds: of scene, splits and masks.
        n_test: test samples of the second session; all its others may recalibrate.
        n_new: numbers of samples to recalibrate with.
        p: parameters of ``replace``.
        order: which of :data:`ORDERS`.
        draws: choices of the recalibrating samples for every seed, in random order.
        offsets: room temperatures of a second session, K above the first, for the stored models;
            only a simulated scene can have them.
        n_test_offset: test samples at each.
        device: where frames are made.
        cache: keep made frames in the results' cache.
        force: measure again.

    Returns:
        Path: the folder. The columns of its rows: ``origin`` of the frames; ``seed``; ``model``;
        ``method`` as above and its ``parameter``; ``n_old``, ``n_new``; and ``order`` and ``draw``
        or ``offset``; of the second session ``right_new`` of ``n_test_new``, of the first
        ``right_old`` of ``n_test_old``.

    Raises:
        ValueError: naming the key that is wrong.
    """
    if unknown := [one for one in order if one not in ORDERS]:
        raise ValueError(f"task.order: expected among {', '.join(ORDERS)}, found {unknown[0]!r}")
    if offsets and len(scene.get("sessions", ())) != 2:
        raise ValueError("task.offsets: expected none for a scene that has not two rooms")
    made_models = models_of(models)
    console = Console(highlight=False)
    config = {
        "_target_": f"{__name__}.run",
        "scene": scene,
        "old_split": old_split,
        "models": {name: {"model": part["model"]} for name, part in models.items()},
        "seeds": seeds,
        "n_test": n_test,
        "n_new": n_new,
        "p": p,
        "order": order,
        "draws": draws,
        "offsets": offsets,
        "n_test_offset": n_test_offset,
    }

    def of_sensor(seed: int, made: Scene) -> Iterator[Row]:
        warmer = rooms(scene, offsets, seed, n_test_offset, console)
        sessions = Sessions(made, [frames for _, frames, _ in warmer])
        of = {"origin": made.origin, "seed": seed}
        for one in order:
            choice = choose(made, old_split, n_test, one, seed)
            for name, model in made_models.items():
                for row in updates(sessions, choice, model, n_new, p, one, draws, seed):
                    yield {**of, "order": one, "model": name, **row}
        if warmer:
            choice = choose(made, old_split, n_test, order[0], seed)
            for name, model in made_models.items():
                for row in at_offsets(sessions, choice, model, warmer, seed):
                    yield {**of, "model": name, **row}
        console.print(f"[dim]drift: seed {seed}[/dim]")

    def compute() -> Iterator[Row]:
        for seed, made in scenes(scene, seeds, cache, console):
            yield from of_sensor(seed, made)  # whose frames are then forgotten

    return measure("drift", config, compute, device=device, force=force, console=console)


class Choice(NamedTuple):
    """Who trains, recalibrates and tests: sample indices.

    Attributes:
        old: N_old of the first session.
        pool: those of the second session that may recalibrate.
        tests: test samples by session, ``new`` and ``old``.
    """

    old: np.ndarray
    pool: np.ndarray
    tests: Mapping[str, np.ndarray]


def choose(
    scene: Scene, old_split: Mapping[str, Any], n_test: int, order: str, seed: int
) -> Choice:
    """The samples of a scene with sessions 0 and 1.

    Raises:
        ValueError: naming the key that does not fit.
    """
    only = np.zeros(len(scene.labels), np.int64)
    _, second = by_session(scene.samples.get("session", only))
    if not 0 < n_test < len(second):
        raise ValueError(
            f"task.n_test: expected 1 to {len(second) - 1} of the second session's samples, "
            f"found {n_test}"
        )
    old, test_old = data.choose(scene, old_split, seed)
    pool, test_new = split(
        scene.labels[second],
        n_test=n_test,
        kind="ordered" if order == "time" else "random",
        seed=seed,
        order=scene.samples["order"][second],
    )
    return Choice(old, second[pool], {"new": second[test_new], "old": test_old})


def subsets(
    choice: Choice, scene_labels: np.ndarray, sizes: Sequence[int], order: str, seed: int
) -> dict[int, np.ndarray]:
    """n of the pool for each n, stratified and nested: the first in time of each class, or any."""
    if order == "random":
        return learning_curve_subsets(choice.pool, scene_labels, sizes, seed)
    labels = scene_labels[choice.pool]  # the pool is in time order
    turn = np.array([(labels[:k] == label).sum() for k, label in enumerate(labels)])
    ordered = choice.pool[np.argsort(turn, kind="stable")]
    if unknown := [n for n in sizes if not 0 < n <= len(ordered)]:
        raise ValueError(f"task.n_new: expected 1 to {len(ordered)}, found {unknown[0]}")
    return {n: ordered[:n] for n in sizes}


class Sessions:
    """Frames of all sessions, as models want them.

    Args:
        scene: with sessions 0 and 1, in which models are trained.
        more: frames that only test, [n, H, W] each.

    Attributes:
        labels: int64 [N], of the scene's own samples.
        words: hypervectors int64 [N + more, W].
        products: of all frames with the scene's own.
    """

    def __init__(self, scene: Scene, more: Sequence[Tensor] = ()):
        self.labels, self.n_classes = scene.labels, len(scene.classes)
        self.dimension = scene.shape[0] * scene.shape[1]
        n = len(scene.labels)
        self._frames = scene.frames([0]).new_empty(n + sum(map(len, more)), *scene.shape)
        for start in range(0, n, _BATCH):
            batch = np.arange(start, min(start + _BATCH, n))
            self._frames[batch] = scene.frames(batch).cpu()
        for start, part in zip(n + np.cumsum([0, *map(len, more)]), more, strict=False):
            self._frames[start : start + len(part)] = part
        self.words = torch.cat([encode(part) for part in self._frames.split(_BATCH)])
        self._products: Products | None = None

    @property
    def products(self) -> Products:
        """Made when the first linear model asks."""
        if self._products is None:
            n = len(self.labels)
            labels = np.concatenate([self.labels, np.zeros(len(self._frames) - n, np.int64)])
            self._products = Products(self._frames, labels, self.n_classes, n)
        return self._products

    def count(self, chosen: np.ndarray) -> Counters:
        """Counters of these samples."""
        counters = Counters(self.n_classes, self.dimension)
        counters.add(self.words[chosen], torch.from_numpy(self.labels[chosen]))
        return counters

    def nearest(self, prototypes: Tensor, asked: np.ndarray) -> np.ndarray:
        """The class of the nearest prototype [L, W] for these samples."""
        return bits.hamming(self.words[asked], prototypes).argmin(1).numpy()

    def trained(self, model: Model, train: np.ndarray, asked: np.ndarray) -> np.ndarray:
        """What a model trained on these samples says of those."""
        if isinstance(model, HDCClassifier):
            return self.nearest(self.count(train).majority(model.ties, model.seed), asked)
        return self.products.scores(model, train, asked).argmax(1).numpy()


def updates(
    sessions: Sessions,
    choice: Choice,
    model: Model,
    n_new: Sequence[int],
    p: Sequence[float],
    order: str,
    draws: int,
    seed: int,
) -> Iterator[Row]:
    """The stored model, then every way to update it with the same samples, scored."""
    asked = np.concatenate(list(choice.tests.values()))

    def row(predicted: np.ndarray, n: int, **rest: Any) -> Row:
        right = predicted == sessions.labels[asked]
        n_first = len(choice.tests["new"])
        return {
            **rest, "n_old": len(choice.old), "n_new": n,
            "right_new": int(right[:n_first].sum()), "n_test_new": n_first,
            "right_old": int(right[n_first:].sum()), "n_test_old": len(right) - n_first,
        }  # fmt: skip

    of_one = of_hdc if isinstance(model, HDCClassifier) else of_linear
    stored = sessions.trained(model, choice.old, asked)
    yield row(stored, 0, method="stored")
    for draw in range(draws if order == "random" else 1):
        drawn = int(np.random.default_rng((seed, draw)).integers(2**31))
        for n, new in subsets(choice, sessions.labels, n_new, order, drawn).items():
            for method, parameter, predicted in of_one(
                sessions, choice, model, new, p, drawn + n, asked
            ):
                yield row(predicted, n, draw=draw, method=method, parameter=parameter)


Update = tuple[str, float | None, np.ndarray]  # method, its parameter, predictions


def of_hdc(
    sessions: Sessions,
    choice: Choice,
    model: Any,
    new: np.ndarray,
    p: Sequence[float],
    seed: int,
    asked: np.ndarray,
) -> Iterator[Update]:
    """Updates of prototypes; seed: of the bits that are replaced."""
    before, after = sessions.count(choice.old), sessions.count(new)
    stored, fresh = (counters.majority(model.ties, model.seed) for counters in (before, after))
    found: list[tuple[str, float | None, Tensor]] = [("new", None, fresh)]
    for value in p:
        mixed = recalibrate(stored, fresh, sessions.dimension, value, seed)
        found.append(("replace", value, mixed))
    equal, _ = merged(before, after, _EQUAL)
    found.append(("balanced", None, equal.majority(model.ties, model.seed)))
    before.merge(after)
    found.append(("pooled", None, before.majority(model.ties, model.seed)))
    for method, parameter, prototypes in found:
        yield method, parameter, sessions.nearest(prototypes, asked)


def of_linear(
    sessions: Sessions,
    choice: Choice,
    model: Any,
    new: np.ndarray,
    p: Sequence[float],
    seed: int,
    asked: np.ndarray,
) -> Iterator[Update]:
    """The same for a model that is trained again."""
    repeated = np.tile(new, max(1, round(len(choice.old) / len(new))))
    for method, train in (
        ("new", new),
        ("balanced", np.concatenate([choice.old, repeated])),
        ("pooled", np.concatenate([choice.old, new])),
    ):
        yield method, None, sessions.trained(model, train, asked)
    if isinstance(model, RidgeReadout | DualSoftmaxRegression):
        scores = scores_from_old(sessions.products, model, choice.old, new, asked)
        yield "from_old", None, scores.argmax(1).numpy()


# How far ------------------------------------------------------------------------------------------


def rooms(
    scene: Mapping[str, Any],
    offsets: Sequence[float],
    seed: int,
    n_test: int,
    console: Console,
) -> list[tuple[float, Tensor, np.ndarray]]:
    """(offset, test frames, their labels) of second sessions in rooms of these temperatures."""
    if not offsets:
        return []
    first, second = scene["sessions"]
    later = [{**second, "offset": offset} for offset in offsets]
    made = scene_at({**scene, "sessions": [first, *later]}, seed, False, console)
    found = []
    for k, offset in enumerate(offsets):
        members = np.flatnonzero(made.samples["session"] == k + 1)
        _, test = split(made.labels[members], n_test=n_test, seed=seed)
        chosen = members[test]
        found.append((float(offset), made.frames(chosen).cpu(), made.labels[chosen]))
    return found


def at_offsets(
    sessions: Sessions,
    choice: Choice,
    model: Model,
    rooms: Sequence[tuple[float, Tensor, np.ndarray]],
    seed: int,
) -> Iterator[Row]:
    """The stored model, and one of as many samples at most, half of each session."""
    half = min(len(choice.old) // 2, len(choice.pool))
    halves = [
        learning_curve_subsets(part, sessions.labels, [half], seed)[half]
        for part in (choice.old, choice.pool)
    ]
    asked = np.arange(len(sessions.labels), len(sessions.words))
    for method, parts in (("stored", [choice.old]), ("two_sessions", halves)):
        predicted = sessions.trained(model, np.concatenate(parts), asked)
        for offset, _, labels in rooms:
            found, predicted = np.split(predicted, [len(labels)])
            yield {
                "method": method, "offset": offset, "n_old": len(parts[0]),
                "n_new": sum(map(len, parts[1:])), "right_new": int((found == labels).sum()),
                "n_test_new": len(labels),
            }  # fmt: skip
