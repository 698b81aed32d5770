"""Drift and recalibration (Fig. 8): what new samples recover, and what of the old is forgotten.

Models are trained on N_old samples of the first session (``stored``), updated with N_new of the
second, and tested on both sessions. By ``method``:

- ``new``: trained on the new samples alone; of HDC, the paper's p = 1.
- ``replace``, p: the paper's, for HDC; each bit of the stored prototype is replaced by the new
  one's with probability p, so that distances to the mixture are (1 − p)·(distance to the stored) +
  p·(distance to the new prototype), but for a random part of order √D.
- ``pooled``: trained on old and new samples together; of HDC, counting on.
- ``balanced``: the same with as many votes of either session; other models than HDC take each new
  sample N_old/N_new times, rounded.
- ``from_old``: of linear models, started from the old weights (baselines.dual).

The new samples are the first in time, and the test samples come after them (``order`` time), or
both are drawn at random from the second session, as neighbours in time (``order`` random).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
import torch
from torch import Tensor

from baselines.dual import PenalisedClassifier, Products
from experiments.protocol import data
from experiments.protocol.experiment import Row, Run, experiment
from experiments.protocol.model import models_of
from hdc import HDCClassifier, bits
from hdc.encode import encode
from hdc.prototypes import Counters, merged, recalibrate
from scenes.frames import Scene
from scenes.split import by_session, learning_curve_subsets, split

ORDERS = ("time", "random")
_BATCH = 50
_EQUAL = 0.5  # share of the new in all votes


@experiment
def drift(
    run: Run,
    scene: Mapping[str, Any],
    old_split: Mapping[str, Any],
    models: Mapping[str, Any],
    seeds: Sequence[int],
    n_test: int,
    n_new: Sequence[int],
    p: Sequence[float],
    order: Sequence[str] = ORDERS,
    draws: int = 3,
) -> Iterator[Row]:
    """One row: a stored model, or one of its updates, tested on both sessions.

    ``right_new`` of ``n_test_new`` test samples are of the second session, ``right_old`` of
    ``n_test_old`` of the first; ``draw`` is the choice of the ``n_new`` samples.
    Arguments: configs/experiment/drift.yaml.
    """
    if unknown := [value for value in order if value not in ORDERS]:
        raise ValueError(f"task.order: expected among {', '.join(ORDERS)}, found {unknown[0]!r}")
    built = models_of(models)
    for seed, two_sessions in run.scenes(scene, seeds):
        sessions = Sessions(two_sessions)
        for in_order in order:
            choice = choose(two_sessions, old_split, n_test, in_order, seed)
            for name, model in built.items():
                for row in updates(sessions, choice, model, n_new, p, in_order, draws, seed):
                    yield {"origin": two_sessions.origin, "seed": seed, "order": in_order,
                           "model": name, **row}  # fmt: skip
        run.note(f"seed {seed}")


@experiment
def drift_size(
    run: Run,
    scene: Mapping[str, Any],
    old_split: Mapping[str, Any],
    models: Mapping[str, Any],
    seeds: Sequence[int],
    n_test: int,
    offsets: Sequence[float],
    n_test_offset: int,
) -> Iterator[Row]:
    """One row: a model that is not recalibrated, in a room of another temperature.

    ``offset`` of the room is in K; ``method`` stored is trained on ``n_old`` samples of the first
    session, two_sessions on half as many and on ``n_new`` of the second.
    Arguments: configs/experiment/drift_size.yaml.
    """
    if len(scene.get("sessions", ())) != 2:
        raise ValueError("task.scene.sessions: expected two rooms")
    built = models_of(models)
    first, second = scene["sessions"]
    rooms = {**scene, "sessions": [first, *({**second, "offset": value} for value in offsets)]}
    for seed, two_sessions in run.scenes(scene, seeds):
        warmer, tests = run.scene(rooms, seed), []
        for k in range(len(offsets)):
            members = np.flatnonzero(warmer.samples["session"] == k + 1)
            tests.append(members[split(warmer.labels[members], n_test=n_test_offset, seed=seed)[1]])
        sessions = Sessions(two_sessions, [warmer.frames(chosen).cpu() for chosen in tests])
        choice = choose(two_sessions, old_split, n_test, "time", seed)
        half = min(len(choice.old) // 2, len(choice.pool))
        halves = [
            learning_curve_subsets(part, sessions.labels, [half], seed)[half]
            for part in (choice.old, choice.pool)
        ]
        asked = np.arange(len(sessions.labels), len(sessions.words))
        for name, model in built.items():
            for method, parts in (("stored", [choice.old]), ("two_sessions", halves)):
                predicted = sessions.trained(model, np.concatenate(parts), asked)
                for offset, chosen in zip(offsets, tests, strict=True):
                    answers, predicted = np.split(predicted, [len(chosen)])
                    yield {
                        "origin": two_sessions.origin, "seed": seed, "model": name,
                        "method": method, "offset": float(offset), "n_old": len(parts[0]),
                        "n_new": sum(map(len, parts[1:])), "n_test": len(chosen),
                        "right": int((answers == warmer.labels[chosen]).sum()),
                    }  # fmt: skip
        run.note(f"seed {seed}")


class Choice(NamedTuple):
    """Sample indices: N_old of the first session, those of the second that may recalibrate, and
    test samples by session (``new``, ``old``)."""

    old: np.ndarray
    pool: np.ndarray
    tests: Mapping[str, np.ndarray]


def choose(
    scene: Scene, old_split: Mapping[str, Any], n_test: int, order: str, seed: int
) -> Choice:
    """The samples of a scene with sessions 0 and 1."""
    only = np.zeros(len(scene.labels), np.int64)
    _, second = by_session(scene.samples.get("session", only))
    if not 0 < n_test < len(second):
        raise ValueError(
            f"task.n_test: expected 1 to {len(second) - 1} of the second session's samples, "
            f"found {n_test}"
        )
    old, test_old = data.choose(scene, old_split, seed)
    kind = "ordered" if order == "time" else "random"
    in_time = scene.samples["order"][second]
    pool, test = split(scene.labels[second], n_test=n_test, kind=kind, seed=seed, order=in_time)
    return Choice(old, second[pool], {"new": second[test], "old": test_old})


def subsets(
    choice: Choice, labels: np.ndarray, sizes: Sequence[int], order: str, seed: int
) -> dict[int, np.ndarray]:
    """n of the pool for each n, stratified and nested: the first in time of each class, or any."""
    if order == "random":
        return learning_curve_subsets(choice.pool, labels, sizes, seed)
    of_pool = labels[choice.pool]  # in time order
    turn = np.array([(of_pool[:k] == label).sum() for k, label in enumerate(of_pool)])
    ordered = choice.pool[np.argsort(turn, kind="stable")]
    if unknown := [n for n in sizes if not 0 < n <= len(ordered)]:
        raise ValueError(f"task.n_new: expected 1 to {len(ordered)}, found {unknown[0]}")
    return {n: ordered[:n] for n in sizes}


class Sessions:
    """Frames of all sessions as models want them.

    Args:
        scene: with sessions 0 and 1, in which models are trained.
        more: frames that only test, [n, H, W] each.
    """

    def __init__(self, scene: Scene, more: Sequence[Tensor] = ()):
        self.labels, self.n_classes = scene.labels, len(scene.classes)
        self.dimension = scene.shape[0] * scene.shape[1]
        n = len(scene.labels)
        batches = np.array_split(np.arange(n), max(1, n // _BATCH))
        self._frames = torch.cat([*(scene.frames(batch).cpu() for batch in batches), *more])
        self.words = torch.cat([encode(part) for part in self._frames.split(_BATCH)])

    @cached_property
    def products(self) -> Products:
        """Products of all frames with the scene's own; only linear models ask for them."""
        n = len(self.labels)
        labels = np.append(self.labels, np.zeros(len(self._frames) - n, np.int64))
        return Products(self._frames, labels, self.n_classes, n)

    def count(self, chosen: np.ndarray) -> Counters:
        """Counters of these samples."""
        counters = Counters(self.n_classes, self.dimension)
        counters.add(self.words[chosen], torch.from_numpy(self.labels[chosen]))
        return counters

    def nearest(self, prototypes: Tensor, asked: np.ndarray) -> np.ndarray:
        """The class of the nearest prototype [L, W] for these samples."""
        return bits.hamming(self.words[asked], prototypes).argmin(1).numpy()

    def trained(self, model: Any, train: np.ndarray, asked: np.ndarray) -> np.ndarray:
        """Predictions of a model trained on some samples for others."""
        if isinstance(model, HDCClassifier):
            return self.nearest(self.count(train).majority(model.ties, model.seed), asked)
        return self.products.scores(model, train, asked).argmax(1).numpy()


def updates(
    sessions: Sessions,
    choice: Choice,
    model: Any,
    n_new: Sequence[int],
    p: Sequence[float],
    order: str,
    draws: int,
    seed: int,
) -> Iterator[Row]:
    """The stored model, then every way to update it with the same samples, scored."""
    asked = np.concatenate(list(choice.tests.values()))
    first = len(choice.tests["new"])

    def row(predicted: np.ndarray, n: int, draw: int, method: str, p: float | None) -> Row:
        right = predicted == sessions.labels[asked]
        return {
            "method": method, "p": p, "n_old": len(choice.old), "n_new": n, "draw": draw,
            "right_new": int(right[:first].sum()), "n_test_new": first,
            "right_old": int(right[first:].sum()), "n_test_old": len(right) - first,
        }  # fmt: skip

    yield row(sessions.trained(model, choice.old, asked), 0, 0, "stored", None)
    for draw in range(draws if order == "random" else 1):
        drawn = int(np.random.default_rng((seed, draw)).integers(2**31))
        for n, new in subsets(choice, sessions.labels, n_new, order, drawn).items():
            if isinstance(model, HDCClassifier):
                counters = sessions.count(choice.old), sessions.count(new)
                mixtures = of_hdc(model, *counters, sessions.dimension, p, drawn + n)
                for method, parameter, prototypes in mixtures:
                    predicted = sessions.nearest(prototypes, asked)
                    yield row(predicted, n, draw, method, parameter)
                continue
            for method, predicted in of_linear(sessions, choice.old, model, new, asked):
                yield row(predicted, n, draw, method, None)


def of_hdc(
    model: HDCClassifier,
    before: Counters,
    after: Counters,
    dimension: int,
    p: Sequence[float],
    seed: int,
) -> Iterator[tuple[str, float | None, Tensor]]:
    """Updated prototypes by method, from counters of the old and of the new samples."""
    stored, fresh = (c.majority(model.ties, model.seed) for c in (before, after))
    yield "new", None, fresh
    for value in p:
        yield "replace", float(value), recalibrate(stored, fresh, dimension, value, seed)
    equal, _ = merged(before, after, _EQUAL)
    yield "balanced", None, equal.majority(model.ties, model.seed)
    before.merge(after)
    yield "pooled", None, before.majority(model.ties, model.seed)


def of_linear(
    sessions: Sessions, old: np.ndarray, model: Any, new: np.ndarray, asked: np.ndarray
) -> Iterator[tuple[str, np.ndarray]]:
    """Updates of a model that is trained again."""
    repeated = np.tile(new, max(1, round(len(old) / len(new))))
    for method, train in (
        ("new", new),
        ("balanced", np.concatenate([old, repeated])),
        ("pooled", np.concatenate([old, new])),
    ):
        yield method, sessions.trained(model, train, asked)
    if isinstance(model, PenalisedClassifier):
        scores = model.scores_from_old(sessions.products, old, new, asked)
        yield "from_old", scores.argmax(1).numpy()
