"""The classifier of the paper on recordings that others measured.

Every model is trained on n frames of each class and asked about held-out frames, for several n,
draws and ways to split. A split by time, session or group keeps near copies of a test frame out of
the training; a random one does not. Models that cost much are asked in fewer draws.

Each recording is one sensor: draws vary the frames, not the sensor.
"""

from __future__ import annotations

import copy
import importlib.util
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import Any, ClassVar, NamedTuple

import msgspec
import numpy as np
from torch import Tensor

from baselines import library
from baselines.bank import Bank
from baselines.chosen import Chosen
from experiments.protocol.data import at_seed
from experiments.protocol.evaluate import (
    bank_of,
    evaluate,
    evaluate_until,
    train_until,
)
from experiments.protocol.model import Model, models_of
from experiments.protocol.settings import Split
from experiments.protocol.splits import nested, resample_split
from experiments.protocol.stop import StopRule
from experiments.protocol.task import Context, Row, Task
from experiments.records.rows import pack_labels
from hdc.backends import compile_kernels


class Limits(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Where a model is asked; None stands for everything.

    Attributes:
        scenes: names of recordings.
        splits: names of splits.
        draws: the first so many draws, of all seeds together.
        n_per_class: training frames of each class.
        stop: ends the training of a model that learns by steps.
    """

    scenes: list[str] | None = None
    splits: list[str] | None = None
    draws: int | None = None
    n_per_class: list[int] | None = None
    stop: StopRule | None = None

    def at(self, split: str, draw: int, sizes: Sequence[int]) -> list[int]:
        """Those of the sizes at which the model is asked in a draw of a split."""
        if self.draws is not None and draw >= self.draws:
            return []
        if self.splits is not None and split not in self.splits:
            return []
        return [n for n in sizes if self.n_per_class is None or n in self.n_per_class]


class Asked(NamedTuple):
    """A model, and where it is asked."""

    model: Model
    limits: Limits


class Recordings(Task, frozen=True):
    """One row: one model in one draw of one split; what it ``predicted`` of ``n_test`` frames after
    each ``n`` frames of every class.

    ``n`` and ``predicted`` are lists, the latter of texts of
    :func:`experiments.records.rows.pack_labels`; the first row of a draw has the true classes in
    ``labels`` and their number in ``n_classes``, and the numbers of their groups in ``groups``
    where the split keeps groups together. A model that chooses its form has the names of
    those that it ``chose``, one for each n; one that learns by steps has the reasons why it
    ``stopped``, as :mod:`experiments.protocol.stop` names them.
    Arguments: configs/experiment/recordings.yaml.

    Raises:
        ValueError: naming the key that is wrong.
    """

    revision: ClassVar = 2
    uses: ClassVar = ("hdc.HDCClassifier",)

    scene: Mapping[str, Any]
    splits: Mapping[str, Split]
    models: Mapping[str, Any]
    n_per_class: Sequence[int]
    draws: int = 20
    seeds: Sequence[int] = (0,)
    most_test: int = 400
    limits: Mapping[str, Limits] | None = None

    def rows(self, context: Context) -> Iterator[Row]:
        asked = _asked(self.models, self.limits or {}, context.scene_name)
        for count, (seed, recording) in enumerate(
            context.scenes(self.scene, self.seeds)
        ):
            first = count * self.draws
            bank = bank_of(recording, group=_group(self.splits))
            for split, wanted in self.splits.items():
                pool_of = partial(
                    resample_split, recording, wanted, most_test=self.most_test
                )
                for k in range(self.draws):
                    place = (split, first + k)
                    draw = partial(_draw, bank, pool_of, asked, self.n_per_class, place)
                    drawn = {"seed": seed, "split": split, "draw": k}
                    for row in context.part(drawn, partial(draw, (seed, k))):
                        yield {"origin": recording.origin, **drawn, **row}


def _asked(
    models: Mapping[str, Any], limits: Mapping[str, Limits], scene: str
) -> dict[str, Asked]:
    """The models that are asked on a recording, by name, with their limits.

    Raises:
        ValueError: naming a limit that is not of a model.
    """
    for name in limits:
        if name not in models:
            known = ", ".join(models)
            raise ValueError(
                f"task.limits: expected models among {known}, found {name!r}"
            )
    of = {name: limits.get(name, Limits()) for name in models}
    here = {
        name: part
        for name, part in models.items()
        if of[name].scenes is None or scene in (of[name].scenes or ())
    }
    made = models_of(at_seed(here, 0))
    return {name: Asked(model, of[name]) for name, model in made.items()}


def _group(splits: Mapping[str, Split]) -> str | None:
    """Property shared by frames that a split keeps together, if one of them does."""
    for wanted in splits.values():
        if wanted.kind in ("grouped", "leave_group_out"):
            return wanted.group
    return None


def _draw(
    bank: Bank,
    pool_of: Any,
    models: Mapping[str, Asked],
    n_per_class: Sequence[int],
    place: tuple[str, int],
    seed: tuple[int, int],
) -> Iterator[Row]:
    """The rows of one draw, a row per model; `place` is its split and its number."""
    pool, test = pool_of(seed=seed)
    order, sizes = nested(pool, bank.labels, n_per_class, seed)
    of_draw: Row = {
        "labels": pack_labels(bank.labels[test]),
        "n_classes": bank.n_classes,
    }
    if bank.groups is not None:
        _, group = np.unique(bank.groups, return_inverse=True)
        of_draw["groups"] = pack_labels(group[test])
    for name, asked in models.items():
        chosen = asked.limits.at(*place, sizes)
        if not chosen:
            continue
        answers = [
            _answer(asked, bank, np.concatenate([rows[:n] for rows in order]), test)
            for n in chosen
        ]
        row: Row = {
            "model": name,
            "n_test": len(test),
            "n": chosen,
            "predicted": [pack_labels(answer.labels) for answer in answers],
        }
        if isinstance(asked.model, Chosen):
            row["chose"] = [answer.form for answer in answers]
        if asked.limits.stop is not None:
            row["stopped"] = [answer.stopped for answer in answers]
        yield {**row, **of_draw}
        of_draw = {}  # the first row has it for all


class Answer(NamedTuple):
    """Labels of test frames; which form a model chose, if it does; why its training stopped, if it
    learns by steps."""

    labels: np.ndarray
    form: str = ""
    stopped: str = ""


def _answer(asked: Asked, bank: Bank, train: np.ndarray, test: np.ndarray) -> Answer:
    model, stop = asked.model, asked.limits.stop
    if isinstance(model, Chosen):
        form, model = model.choose(bank, train)
        return Answer(evaluate(model, bank, train, test), form)
    if stop is None:
        return Answer(evaluate(model, bank, train, test))
    labels, stopped = evaluate_until(stop, model, bank, train, test)
    return Answer(labels, stopped=stopped)


# Costs --------------------------------------------------------------------------------------------


@dataclass
class Timed:
    """A model by one backend, and the seconds that it took: to train, and a frame of a batch."""

    model: Model
    fit_s: list[float] = field(default_factory=list)
    predict_frame_s: list[float] = field(default_factory=list)
    trained: Model | None = None

    @property
    def seconds(self) -> float:
        """Of all trainings so far."""
        return sum(self.fit_s)

    def repeat(self, frames: Tensor, labels: np.ndarray, asked: Tensor) -> None:
        """Train a fresh model and ask it."""
        fresh = copy.deepcopy(self.model)
        start = time.perf_counter()
        train_until(fresh, StopRule(), frames, labels)
        trained = time.perf_counter()
        fresh.predict(asked)
        self.predict_frame_s.append((time.perf_counter() - trained) / len(asked))
        self.fit_s.append(trained - start)
        self.trained = fresh


class RecordingCosts(Task, frozen=True):
    """One row: what a model costs that was trained on ``n`` frames of every class.

    ``bytes`` that a prediction needs, of ``n_pixels`` and ``n_classes``; seconds to train
    (``fit_s``) and to predict a frame of a batch (``predict_frame_s``), the least of some
    interleaved repetitions. A model that has a backend is timed by NumPy, and where numba is there
    by the compiled kernels: ``fit_compiled_s`` and ``predict_frame_compiled_s``. Frames are in
    memory, and nothing was computed of them before.
    Arguments: configs/experiment/recording_costs.yaml.
    """

    revision: ClassVar = 2
    uses: ClassVar = ("hdc.HDCClassifier",)
    timed: ClassVar = True

    scene: Mapping[str, Any]
    split: Split
    models: Mapping[str, Any]
    n_per_class: Sequence[int] = (5, 50)
    queries: int = 100
    repeats: int = 3
    most_s: float | int = 20.0
    seed: int = 0
    limits: Mapping[str, Limits] | None = None

    def rows(self, context: Context) -> Iterator[Row]:
        asked = _asked(self.models, self.limits or {}, context.scene_name)
        ((_, recording),) = context.scenes(self.scene, [self.seed])
        bank = bank_of(recording)
        pool, test = resample_split(recording, self.split, (self.seed, 0), self.queries)
        order, sizes = nested(pool, bank.labels, self.n_per_class, (self.seed, 0))
        for n in sizes or [min(map(len, order))]:
            train = np.concatenate([rows[:n] for rows in order])
            frames, labels = bank.frames[train], bank.labels[train]
            every = [
                (name, column, timed)
                for name, each in asked.items()
                if each.limits.at("", 0, [n])
                for column, timed in _by_backend(each.model).items()
            ]
            for _ in range(self.repeats):
                for _, _, timed in every:
                    if timed.seconds < self.most_s:
                        timed.repeat(frames, labels, bank.frames[test])
            rows: dict[str, Row] = {}
            for name, column, timed in every:
                row = rows.setdefault(name, {"model": name, "n": n})
                row[f"fit{column}_s"] = min(timed.fit_s)
                row[f"predict_frame{column}_s"] = min(timed.predict_frame_s)
                row["bytes"] = _size(timed.trained)
            of_frames = {"n_classes": bank.n_classes, "n_pixels": bank.dimension}
            for row in rows.values():
                yield {"origin": recording.origin, **row, **of_frames}
            context.note(f"{n} frames of each class")


def _by_backend(model: Any) -> dict[str, Timed]:
    """The model by NumPy, and by the compiled kernels if it has a backend, by part of a column."""
    if not hasattr(model, "backend"):
        return {"": Timed(model)}
    backends = {"": "numpy"}
    if importlib.util.find_spec("numba") is not None:
        compile_kernels()  # before any of them is timed
        backends["_compiled"] = "compiled"
    found = {}
    for column, backend in backends.items():
        copied = copy.deepcopy(model)
        copied.backend = backend
        found[column] = Timed(copied)
    return found


def _size(model: Any) -> int:
    """Bytes of what a prediction needs."""
    return sum(
        tensor.nbytes for tensor in (library.state_tensors(model) or {}).values()
    )
