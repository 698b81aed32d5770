"""Drift and recalibration (Fig. 8): what new samples recover, and what of the old is forgotten.

Models are trained on N_old samples of the first session (``stored``), updated with N_new of the
second, and tested on both sessions. Values of ``method`` with labels:

- ``new``: trained on the new samples alone; of HDC, the paper's p = 1.
- ``replace``, p: the paper's, for HDC; each bit of the stored prototype is replaced by the new
  one's with probability p, so that distances to the mixture are (1 − p)·(distance to the stored) +
  p·(distance to the new prototype), but for a random part of order √D.
- ``pooled``: trained on old and new samples together; of HDC, counting on.
- ``balanced``: the same with as many votes of either session; other models than HDC take each new
  sample N_old/N_new times, rounded.
- ``from_old``: of linear models, started from the old weights (baselines.linear).

Without labels (:mod:`.zeroing`): ``zeroed`` and ``untouched``.

HDC's updates are the model's own; one that its read-out does not have has no row.

The new samples are the first in time, and the test samples come after them.
"""

from __future__ import annotations

import copy
import itertools
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, ClassVar, NamedTuple

import numpy as np

from baselines import library
from baselines.bank import Bank
from baselines.linear import PenalisedClassifier
from experiments.protocol import splits
from experiments.protocol.evaluate import bank_of, evaluate
from experiments.protocol.model import models_of
from experiments.protocol.settings import Split
from experiments.protocol.task import Context, Row, Task
from experiments.records.rows import pack_labels
from experiments.studies.drift.zeroing import rezeroed, unlabelled
from hdc import HDCClassifier
from hdc.readouts import LDA, Kernel, make_readout
from scenes.frames import Scene
from scenes.split import by_session, split

_EQUAL = 0.5  # share of the new in all votes
Update = tuple[str, float | None, np.ndarray]  # method, p, predicted labels


class Drift(Task, frozen=True):
    """One row: a stored model, or one of its updates, tested on both sessions.

    It ``predicted`` classes of ``n_test_new`` test samples of the second session, then of
    ``n_test_old`` of the first (texts of :func:`experiments.records.rows.pack_labels`); the first
    row of a seed has the true ones in ``labels``. Models in `zeroing` are updated without labels;
    ``share`` is that of one class among the unlabelled frames, None: all classes alike.
    Arguments: configs/experiment/drift.yaml.
    """

    revision: ClassVar = 4
    uses: ClassVar = ("hdc.HDCClassifier",)

    scene: Mapping[str, Any]
    old_split: Split
    models: Mapping[str, Any]
    seeds: Sequence[int]
    n_test: int
    n_new: Sequence[int]
    p: Sequence[float | int]
    zeroing: Mapping[str, Any] | None = None
    zeroing_seeds: Sequence[int] = ()
    n_alone: Sequence[int] = ()
    n_zero: Sequence[int] = ()
    shares: Sequence[float | int] = ()
    n_shares: Sequence[int] = ()
    n_untouched: Sequence[int] = ()
    no_touch: str = ""

    def rows(self, context: Context) -> Iterator[Row]:
        for seed, two_sessions in context.scenes(self.scene, self.seeds):
            bank = bank_of(two_sessions)
            choice = choose(two_sessions, self.old_split, self.n_test, seed)
            same = {
                "origin": two_sessions.origin,
                "seed": seed,
                "n_old": len(choice.old),
                "n_test_new": len(choice.new_test),
                "n_test_old": len(choice.old_test),
                "p": None,
                "share": None,
            }
            truth = {"labels": pack_labels(bank.labels[choice.asked])}
            classes = list(two_sessions.classes)
            is_there = self.no_touch in classes
            no_touch = classes.index(self.no_touch) if is_there else None
            made = self._answers(bank, choice, seed, no_touch)
            for about, predicted in made:
                yield {**same, **about, "predicted": pack_labels(predicted), **truth}
                truth = {}  # the first row has it for all
            context.note(f"seed {seed}")

    def _answers(
        self, bank: Bank, choice: Choice, seed: int, no_touch: int | None
    ) -> Iterator[tuple[Row, np.ndarray]]:
        """Rows of each model and its updates, with their predictions for the samples asked."""
        for name, model in models_of(self.models).items():
            for row, predicted in updates(
                bank, choice, model, self.n_new, self.p, seed
            ):
                yield {"model": name, **row}, predicted
        if seed not in self.zeroing_seeds:
            return
        for name, model in models_of(self.zeroing or {}).items():
            for row, predicted in self._zeroings(bank, choice, model, seed, no_touch):
                yield {"model": name, **row}, predicted

    def _zeroings(
        self, bank: Bank, choice: Choice, model: Any, seed: int, no_touch: int | None
    ) -> Iterator[tuple[Row, np.ndarray]]:
        """The stored model, re-referenced without labels, and trained on new samples alone."""
        of_choice = (model, bank, choice.old, choice.asked)
        sizes: list[tuple[int, float | None]] = [(n, None) for n in self.n_zero]
        sizes += itertools.product(self.n_shares, map(float, self.shares))
        found = unlabelled(choice.pool, bank.labels, sizes, seed, bank.n_classes)
        choices: list[Any] = [(0, None, None), *found]  # as it is stored, and updated
        afters = [frames for _, _, frames in choices]
        made = rezeroed(*of_choice, choice.old, afters)
        for (n, share, _), predicted in zip(choices, made, strict=True):
            method = "zeroed" if n else "stored"
            yield {"method": method, "n_new": n, "share": share}, predicted
        for n, new in subsets(choice, bank.labels, self.n_alone).items():
            yield (
                {"method": "new", "n_new": n},
                evaluate(model, bank, new, choice.asked),
            )
        if no_touch is None:
            return
        before, without = (
            each[bank.labels[each] == no_touch] for each in (choice.old, choice.pool)
        )
        numbers = [n for n in self.n_untouched if n <= len(without)]
        made = rezeroed(*of_choice, before, [without[:n] for n in numbers])
        for n, predicted in zip(numbers, made, strict=True):
            yield {"method": "untouched", "n_new": n}, predicted


class Choice(NamedTuple):
    """Sample indices: N_old of the first session, the pool of the second that may recalibrate, and
    the test samples of the second and of the first session."""

    old: np.ndarray
    pool: np.ndarray
    new_test: np.ndarray
    old_test: np.ndarray

    @property
    def asked(self) -> np.ndarray:
        """All test samples, the second session first."""
        return np.concatenate([self.new_test, self.old_test])


def choose(
    scene: Scene,
    old_split: Split,
    n_test: int,
    seed: int,
) -> Choice:
    """The samples of a scene with sessions 0 and 1."""
    only = np.zeros(len(scene.labels), np.int64)
    _, second = by_session(scene.samples.get("session", only))
    old, test_old = splits.choose(scene, old_split, seed)
    in_time = scene.samples["order"][second]
    labels = scene.labels[second]
    share = n_test / len(labels)
    pool, test = split(labels, test_fraction=share, kind="ordered", order=in_time)
    return Choice(old, second[pool], second[test], test_old)


def subsets(
    choice: Choice, labels: np.ndarray, sizes: Sequence[int]
) -> dict[int, np.ndarray]:
    """n of the pool for each n, stratified and nested: the first in time of each class."""
    if not sizes:
        return {}
    of_pool = labels[choice.pool]  # in time order
    turn = np.array([(of_pool[:k] == label).sum() for k, label in enumerate(of_pool)])
    ordered = choice.pool[np.argsort(turn, kind="stable")]
    if max(sizes) > len(ordered):
        raise ValueError(
            f"task.n_new: expected 1 to {len(ordered)}, found {max(sizes)}"
        )
    return {n: ordered[:n] for n in sizes}


def updates(
    bank: Bank,
    choice: Choice,
    model: Any,
    n_new: Sequence[int],
    p: Sequence[float],
    seed: int,
) -> Iterator[tuple[Row, np.ndarray]]:
    """The stored model, then every way to update it with the same labelled samples; and what each
    predicts."""
    old, asked = choice.old, choice.asked
    yield {"method": "stored", "n_new": 0}, evaluate(model, bank, old, asked)
    drawn = int(np.random.default_rng((seed, 0)).integers(2**31))
    for n, new in subsets(choice, bank.labels, n_new).items():
        for method, parameter, predicted in ways(
            model, bank, old, new, asked, p, drawn + n
        ):
            yield {"method": method, "p": parameter, "n_new": n}, predicted


def ways(
    model: Any,
    bank: Bank,
    old: np.ndarray,
    new: np.ndarray,
    asked: np.ndarray,
    p: Sequence[float],
    seed: int,
) -> Iterator[Update]:
    """Answers of updates of a model to the samples asked, each from the same old and new ones."""
    pooled = np.concatenate([old, new])
    yield "new", None, evaluate(model, bank, new, asked)
    if isinstance(model, HDCClassifier) and _adapts(model):
        yield from recalibrated(model, bank, old, new, asked, p, seed)
    else:
        repeated = np.tile(new, max(1, round(len(old) / len(new))))
        balanced = np.concatenate([old, repeated])
        yield "balanced", None, evaluate(model, bank, balanced, asked)
    yield "pooled", None, evaluate(model, bank, pooled, asked)
    if isinstance(model, PenalisedClassifier):
        yield "from_old", None, model.predict_from_old(bank, old, new, asked)


def _adapts(model: HDCClassifier) -> bool:
    """Whether it is recalibrated; discriminants are fitted to both sessions, as baselines."""
    readout = make_readout(model.readout)
    return hasattr(readout, "adapt") and not isinstance(readout, LDA | Kernel)


def recalibrated(
    model: HDCClassifier,
    bank: Bank,
    old: np.ndarray,
    new: np.ndarray,
    asked: np.ndarray,
    p: Sequence[float],
    seed: int,
) -> Iterator[Update]:
    """Recalibrations of HDC; those that its prototypes or read-out do not have are left out."""
    stored = library.trained_on(model, bank, old)
    readout = stored.readout_
    replaced = [("replace", float(share), "replace") for share in p]
    for name, share, method in [*replaced, ("balanced", None, "merge")]:
        if method not in getattr(readout, "methods", (method,)):
            continue
        updated = copy.deepcopy(stored)
        given = {
            "p": _EQUAL if share is None else share,
            "random_state": seed,
            "method": method,
        }
        used: Any = {name: given[name] for name in readout.adapts_by}
        updated.recalibrate(
            library.words_of(model, bank, new, old), bank.labels[new], **used
        )
        yield name, share, updated.predict(library.words_of(model, bank, asked, old))
