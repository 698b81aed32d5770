"""Cross-validation of models that share the hypervectors of a recording; the test of a gain."""

from __future__ import annotations

import time
import warnings
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np

from hdc import backends, circular
from hdc.bank import Bank
from hdc.command import splits
from hdc.command.compare.candidates import Candidate
from hdc.command.source import truth_of
from hdc.command.splits import Units
from hdc.inputs import tensor
from hdc.readers import Recording

FLIPS = 9_999
"""Random signs of the units, for the test of a gain."""


@dataclass(frozen=True)
class Data:
    """Frames in memory, and what is learnt of them; each encoder encodes a frame once.

    One that learns is another encoder for other training frames.

    Attributes:
        frames: [N, H, W] or [N, D].
        truth: names of the classes [N], or values [N, T].
        period: of values that go round.
    """

    frames: np.ndarray
    truth: np.ndarray
    period: float | None = None
    _seconds: dict[str, float] = field(default_factory=dict)
    """Seconds per frame of each encoder that learns nothing, by its name."""

    @cached_property
    def _bank(self) -> Bank:
        return Bank(tensor(self.frames), np.zeros(len(self.frames), np.int64), 1)

    def given(
        self, model: Any, rows: np.ndarray, train: np.ndarray
    ) -> tuple[Any, float]:
        """Hypervectors of some frames for a form, or the frames for a model of grey values; and
        seconds to make them."""
        if not hasattr(model, "encoder"):
            return self.frames[rows], 0.0
        encoder = model.fresh("encoder")
        start = time.perf_counter()
        backend = backends.choose_backend("auto", "cpu", self.frames.size)
        with backends.computing(backend):
            words = self._bank.words(rows, encoder, train)
        took = time.perf_counter() - start
        if encoder.learns:
            return words, took
        each = self._seconds.setdefault(repr(encoder), took / len(self.frames))
        return words, each * len(rows)


@dataclass(frozen=True)
class Test:
    """How frames are tested.

    Attributes:
        splits: of the frames; each test frame is tested once.
        units: sessions, groups or frames, of the test frames [Q] in the order of the splits.
    """

    splits: Sequence[splits.Split]
    units: Units

    @property
    def rows(self) -> np.ndarray:
        """The test frames [Q]."""
        return np.concatenate([test for _, test in self.splits])

    @property
    def how(self) -> str:
        """How the frames are tested, in words."""
        kind = self.units.kind
        return f"{len(self.splits)} folds {'at random' if kind == 'frame' else f'by {kind}'}"


def prepared(
    recording: Recording,
    rows: np.ndarray,
    other: Recording | None = None,
    period: float | None = None,
) -> tuple[Data, list[Test]]:
    """Frames in memory: the `rows` of a recording, then all of the other; and how they are tested.

    The tests are the folds of the former and, where there is another recording, the test on it.

    Raises:
        ValueError: a class has a single frame, or a single group.
    """
    made, unit = splits.folds(recording, rows)
    folds = Test(made, unit)
    tests = [replace(folds, units=replace(unit, of=unit.of[folds.rows]))]
    frames, truth = recording.frames(rows), truth_of(recording)[rows]
    if other is not None:
        new = np.arange(len(other))
        split = np.arange(len(rows)), len(rows) + new
        tests.append(Test([split], splits.units(other, new)))
        frames = np.concatenate([frames, other[:]])
        truth = np.concatenate([truth, truth_of(other)])
    return Data(frames, truth, period), tests


@dataclass(frozen=True)
class Row:
    """Answers of a model.

    Attributes:
        losses: [Q], 1 for a wrong label, 0 for a right one; of values the mean over the T of each
            error as a multiple of :func:`constant_errors`.
        errors: of each value [Q, T]; [Q, 0] of classes.
        train_s: seconds to learn, a mean over the splits; those to encode are among them.
        frame_ms: milliseconds a frame to predict, likewise.
    """

    losses: np.ndarray
    errors: np.ndarray
    train_s: float
    frame_ms: float


def judged(candidate: Candidate, data: Data, test: Test) -> Row:
    """The answers of a candidate to the test frames, learnt from the training frames.

    Raises:
        ValueError: the candidate refuses the frames.
    """
    from sklearn.base import clone

    answers, trained, asked = [], 0.0, 0.0
    for train, rows in test.splits:
        model = clone(candidate.model)
        learnt, encoding = data.given(model, train, train)
        start = time.perf_counter()
        model.fit(learnt, data.truth[train])
        trained += encoding + time.perf_counter() - start
        queries, encoding = data.given(model, rows, train)
        start = time.perf_counter()
        answers.append(np.asarray(model.predict(queries)))
        asked += encoding + time.perf_counter() - start
    found, truth = np.concatenate(answers), data.truth[test.rows]
    times = trained / len(test.splits), 1000 * asked / len(truth)
    if truth.ndim == 1:
        losses = (found != truth).astype(float)
        return Row(losses, np.empty((len(truth), 0)), *times)
    errors = circular.errors(found.reshape(truth.shape), truth, data.period)
    trainable = np.unique(np.concatenate([train for train, _ in test.splits]))
    of_constant = constant_errors(data.truth[trainable], data.period)
    return Row((errors / of_constant).mean(axis=1), errors, *times)


def constant_errors(values: np.ndarray, period: float | None) -> np.ndarray:
    """Mean error [T] of the constant baseline; 1 where all values are equal.

    It is the median of the values [N, T], or the mean direction of values that go round.
    """
    middle = np.median(values, axis=0)
    if period is not None:
        plane = circular.to_plane(values, period).mean(axis=0)
        middle = circular.from_plane(plane[None], period)[0]
    error = circular.errors(values, middle, period).mean(axis=0)
    return np.where(error > 0, error, 1.0)


def compared(
    candidates: Iterable[Candidate], data: Data, tests: Sequence[Test]
) -> Iterator[tuple[Candidate, list[Row] | str]]:
    """Each candidate with its answers in each test, or with its reason to refuse the frames."""
    for candidate in candidates:
        try:
            with warnings.catch_warnings():
                # Of each model and each fold they would be the same ones.
                warnings.simplefilter("ignore", UserWarning)
                found: list[Row] | str = [
                    judged(candidate, data, test) for test in tests
                ]
        except ValueError as error:
            found = str(error)
        yield candidate, found


def best(tried: Mapping[Candidate, Row]) -> Candidate:
    """The form with the least loss, the first of equal ones."""
    forms = [candidate for candidate in tried if candidate.is_form]
    return min(forms, key=lambda form: tried[form].losses.mean())


def p_value(
    mine: str, theirs: str, losses: Mapping[str, np.ndarray], units: np.ndarray
) -> float:
    """The probability of so large a gain of one model over another by chance.

    Signs of the differences are flipped unit by unit, for frames of a session or a group go
    together. The largest gain of all models counts, so that the choice of the best is no advantage
    (Westfall, Young, Resampling-based multiple testing (1993)).

    Args:
        mine: name of the model that was chosen among the models in `losses`.
        theirs: name of the model that it is compared with.
        losses: of each model [Q].
        units: of the test frames [Q].
    """
    names = [name for name in losses if name != theirs]
    gains = np.stack([losses[theirs] - losses[name] for name in names], axis=1)
    _, unit = np.unique(units, return_inverse=True)
    sums = np.zeros((unit.max() + 1, len(names)))
    np.add.at(sums, unit, gains)
    rng = np.random.default_rng(0)
    signs = rng.choice([-1.0, 1.0], (FLIPS, len(sums)))
    largest = (signs @ sums).max(axis=1)
    found = sums.sum(axis=0)[names.index(mine)]
    # Sums of the same numbers in another order differ by rounding.
    as_large = largest >= found - 1e-9 * len(gains)
    return float((1 + as_large.sum()) / (1 + FLIPS))
