"""The classifier of the paper on recordings that others measured.

Every model is trained on n frames of each class and asked about held-out frames, for several n,
draws and ways to split. A split by time, session or group keeps near copies of a test frame out of
the training; a random one does not. Models that cost much are asked in fewer draws.

Each recording is one sensor: draws vary the frames, not the sensor.
"""

from __future__ import annotations

import copy
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import Any, ClassVar

import msgspec
import numpy as np
from torch import Tensor

from baselines import library
from baselines.bank import Bank
from baselines.chosen import Chosen
from experiments.protocol.data import at_seed
from experiments.protocol.evaluate import bank_of, evaluate, train_until
from experiments.protocol.model import Model, models_of
from experiments.protocol.settings import Split
from experiments.protocol.splits import nested, resample_split
from experiments.protocol.stop import StopRule
from experiments.protocol.task import Context, Row, Task
from experiments.records.rows import pack_labels
from hdc.backends import ENOUGH, choose_backend
from scenes.frames import Scene


class Limits(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A model that costs much is asked in fewer draws.

    Attributes:
        draws: the first so many, of all seeds together.
    """

    draws: int


class Recordings(Task, frozen=True):
    """One row: one model in one draw of one split; what it ``predicted`` of ``n_test`` frames after
    each ``n`` frames of every class.

    ``n`` and ``predicted`` are lists, the latter of texts of
    :func:`experiments.records.rows.pack_labels`; the first row of a draw has the true classes in
    ``labels`` and their number in ``n_classes``, and the numbers of their groups in ``groups``
    where the split keeps groups together. A model that chooses its form has the names of the forms
    that it ``chose``, one for each n.
    Arguments: configs/experiment/recordings.yaml.
    """

    revision: ClassVar = 3  # computes by the kernels, whose sums round in another order
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
        models, limits = models_of(at_seed(self.models, 0)), self.limits or {}
        _use_kernels(models)
        for count, (seed, recording) in enumerate(
            context.scenes(self.scene, self.seeds)
        ):
            bank = bank_of(recording, group=_group(self.splits))
            for split, wanted in self.splits.items():
                for k in range(self.draws):
                    asked = {
                        name: model
                        for name, model in models.items()
                        if name not in limits
                        or count * self.draws + k < limits[name].draws
                    }
                    drawn = {"seed": seed, "split": split, "draw": k}
                    parts = recording, bank, wanted, (seed, k)
                    compute = partial(self._draw, asked, *parts)
                    for row in context.part(drawn, compute):
                        yield {"origin": recording.origin, **drawn, **row}
                    done = f"draw {k + 1} of {self.draws}"
                    context.note(f"seed {seed}, split {split}, {done}")

    def _draw(
        self,
        models: Mapping[str, Model],
        recording: Scene,
        bank: Bank,
        wanted: Split,
        seed: tuple[int, int],
    ) -> Iterator[Row]:
        """The rows of one draw, a row per model."""
        pool, test = resample_split(recording, wanted, seed, self.most_test)
        order, sizes = nested(pool, bank.labels, self.n_per_class, seed)
        if not sizes:
            return
        of_draw: Row = {
            "labels": pack_labels(bank.labels[test]),
            "n_classes": bank.n_classes,
        }
        if bank.groups is not None:
            _, group = np.unique(bank.groups, return_inverse=True)
            of_draw["groups"] = pack_labels(group[test])
        for name, model in models.items():
            predicted, chose = [], []
            for n in sizes:
                train = np.concatenate([rows[:n] for rows in order])
                asked = model
                if isinstance(model, Chosen):
                    form, asked = model.choose(bank, train)
                    chose.append(form)
                predicted.append(pack_labels(evaluate(asked, bank, train, test)))
            row: Row = {"model": name, "n_test": len(test), "n": sizes}
            row["predicted"] = predicted
            if chose:
                row["chose"] = chose
            yield {**row, **of_draw}
            of_draw = {}  # the first row has it for all


def _use_kernels(models: Mapping[str, Any]) -> None:
    """Have models compute by the compiled kernels, where they can: faster, and the same bits."""
    for model in models.values():
        if hasattr(model, "backend"):
            model.backend = choose_backend("auto", model.device, ENOUGH)


def _group(splits: Mapping[str, Split]) -> str | None:
    """Property shared by frames that a split keeps together, if one of them does."""
    for wanted in splits.values():
        if wanted.kind in ("grouped", "leave_group_out"):
            return wanted.group
    return None


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
        """How long all trainings so far took."""
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

    revision: ClassVar = 3
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

    def rows(self, context: Context) -> Iterator[Row]:
        models = models_of(at_seed(self.models, 0))
        ((_, recording),) = context.scenes(self.scene, [self.seed])
        bank = bank_of(recording)
        pool, test = resample_split(recording, self.split, (self.seed, 0), self.queries)
        order, sizes = nested(pool, bank.labels, self.n_per_class, (self.seed, 0))
        for n in sizes or [min(map(len, order))]:
            train = np.concatenate([rows[:n] for rows in order])
            frames, labels = bank.frames[train], bank.labels[train]
            every = [
                (name, column, timed)
                for name, model in models.items()
                for column, timed in _by_backend(model).items()
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
    if choose_backend("auto", "cpu", ENOUGH) == "compiled":
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
