"""The choice of encoder and read-out, by cross-validation on training frames alone.

``hdc compare`` and ``hdc train --choose`` choose so.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, Protocol

import numpy as np

from hdc import backends, circular
from hdc.bank import Bank
from hdc.classifier import HDCClassifier
from hdc.encoders import COMPARED, make_encoder
from hdc.hypervectors import Hypervectors
from hdc.readouts import (
    READOUTS,
    VALUE_READOUTS,
    make_readout,
    make_value_readout,
)
from hdc.regressor import HDCRegressor

FOLDS = 5
_ERRORS = 3  # standard errors behind the best at which a method is given up,
_LEAST = 0.05  # and the least difference of mean losses
FORMS = (
    ("levels", "lda"),  # a discriminant weighs the pixels that tell the classes apart
    ("reference_levels", "lda"),  # minus what all frames share, such as a gel or a skin
    ("deviation", "lda"),  # keeps how much of a frame is lit, which ranks throw away
    ("levels", "kernel"),  # classes that no plane separates
    ("median", "neighbours"),  # the published bits without the published prototypes
)
"""Forms for classes that are tried after the published one, the most promising first."""
VALUE_FORMS = (
    ("levels", "ridge"),
    ("reference_levels", "ridge"),
    ("deviation", "ridge"),
    ("levels", "neighbours"),  # values that are no sum of what single bits say
)
"""The same for values, after ridge regression of the published bits."""
Fold = tuple[np.ndarray, np.ndarray]
"""Indices of frames to learn and to test."""


@dataclass(frozen=True)
class Frames:
    """All frames of a comparison, of one recording or two.

    Attributes:
        bank: the frames.
        names: the L classes, or the T values.
        units: of the values; empty where none are known.
        session, group: of each frame [N], where known.
        values: float64 [N, T]; None where classes are learnt.
        backend: for hypervectors.
        period: of values that go round; None for those that do not.
    """

    bank: Bank
    names: tuple[str, ...]
    units: tuple[str, ...]
    session: np.ndarray | None
    values: np.ndarray | None
    backend: str = "auto"
    group: np.ndarray | None = None
    period: float | None = None

    @property
    def labels(self) -> np.ndarray:
        """Class indices int64 [N]; zeros where values are learnt."""
        return self.bank.labels

    def words(self, encoder: Any, rows: np.ndarray, train: np.ndarray) -> Hypervectors:
        """Hypervectors of some frames by an encoder that has learned of others."""
        n_pixels = len(rows) * self.bank.dimension
        backend = backends.choose_backend(self.backend, "cpu", n_pixels)
        with backends.computing(backend):
            return self.bank.words(rows, make_encoder(encoder), train)

    def regressor(self, encoder: Any, readout: Any) -> HDCRegressor:
        """An untrained regressor of the values."""
        return HDCRegressor(encoder, readout, backend=self.backend, period=self.period)

    @cached_property
    def spread(self) -> np.ndarray:
        """Mean distance of each value from its median, [T]: the unit that errors are added in."""
        assert self.values is not None
        middle = np.median(self.values, axis=0)
        if self.period is not None:
            middle = self.direction(np.arange(len(self.values)))
        distances = circular.errors(self.values, middle, self.period).mean(axis=0)
        return np.where(distances > 0, distances, 1.0)

    def direction(self, rows: np.ndarray) -> np.ndarray:
        """The mean direction [T] of circular values."""
        assert self.values is not None
        assert self.period is not None
        plane = circular.to_plane(self.values[rows], self.period)
        return circular.from_plane(plane.mean(axis=0)[None], self.period, True)[0]

    def losses(self, answers: np.ndarray, rows: np.ndarray) -> np.ndarray:
        """Loss of each answer [Q]: 1 for a wrong label, or the mean error of T values."""
        if self.values is None:
            return (answers != self.labels[rows]).astype(np.float64)
        return (self.errors(answers, rows) / self.spread).mean(axis=1)

    def errors(self, answers: np.ndarray, rows: np.ndarray) -> np.ndarray:
        """Absolute errors [Q, T] of answers for the values of frames `rows`."""
        assert self.values is not None
        return circular.errors(answers, self.values[rows], self.period)


class Method(Protocol):
    """What is compared."""

    @property
    def name(self) -> str:
        """Its name in tables."""

    def answers(
        self, frames: Frames, train: np.ndarray, test: np.ndarray
    ) -> np.ndarray:
        """Labels [Q] or values [Q, T] of the test frames, learnt from the training frames."""


@dataclass(frozen=True)
class Combination:
    """An encoder and a read-out of the library, or of one's own, by name."""

    encoder: str
    readout: str

    @property
    def name(self) -> str:
        return f"{self.encoder}, {self.readout}"

    def answers(
        self, frames: Frames, train: np.ndarray, test: np.ndarray
    ) -> np.ndarray:
        learnt = frames.words(self.encoder, train, train)
        asked = frames.words(self.encoder, test, train)
        if frames.values is None:
            model = HDCClassifier(self.encoder, self.readout, backend=frames.backend)
            return model.fit(learnt, frames.labels[train]).predict(asked)
        numbers = frames.regressor(self.encoder, self.readout)
        return numbers.fit(learnt, frames.values[train]).predict(asked)


def published(learns_values: bool) -> Combination:
    """The model without a choice: the published classifier, or ridge for values."""
    return Combination("median", "ridge" if learns_values else "majority")


def combinations(
    encoders: Sequence[str],
    readouts: Sequence[str],
    learns_values: bool,
    every: bool = False,
) -> list[Combination]:
    """Methods to try, the published form first: :data:`FORMS` or :data:`VALUE_FORMS`.

    Each of the `encoders` with each of the `readouts` instead, where some are named; all of the
    library stand for those that are not. With `every` the rest of the library follows.

    Raises:
        ValueError, TypeError: for a name that is none of them.
    """
    ours = VALUE_READOUTS if learns_values else READOUTS
    make = make_value_readout if learns_values else make_readout
    for encoder in encoders:
        make_encoder(encoder).check()
    for readout in readouts:
        make(readout).check()
    found = [published(learns_values)]
    if not encoders and not readouts:
        forms = VALUE_FORMS if learns_values else FORMS
        found += [Combination(*form) for form in forms]
    if encoders or readouts or every:
        pairs = itertools.product(encoders or COMPARED, readouts or ours)
        found += [Combination(*pair) for pair in pairs]
    return list(dict.fromkeys(found))


def folds(
    frames: Frames, rows: np.ndarray, most: int = FOLDS
) -> tuple[list[Fold], str]:
    """At most so many folds of the training frames `rows`, and how they were made.

    Whole groups where they are known; else whole sessions where there are two or more and no fold
    has a class alone; else at random, every class in each fold. No fold where a class has a single
    frame, or of fewer than four frames, and none of groups each of which is the only one of a
    class.
    """
    if frames.group is not None:
        return _folds_of_units(frames, rows, frames.group, most), "by group"
    if frames.session is not None:
        by_session = _folds_of_units(frames, rows, frames.session, most)
        if by_session:
            return by_session, "by session"
    rng = np.random.default_rng(0)
    labels = frames.labels[rows]
    count = min(most, int(np.unique(labels, return_counts=True)[1].min()))
    if count < 2 or len(rows) < 4:
        return [], "at random"
    # Dealt out class by class without starting anew, so that folds are of one size.
    shuffled = rng.permutation(len(rows))
    dealt = shuffled[np.argsort(labels[shuffled], kind="stable")]
    place = np.empty(len(rows), np.int64)
    place[dealt] = np.arange(len(rows)) % count
    return [_fold(rows, place == k) for k in range(count)], "at random"


def _folds_of_units(
    frames: Frames, rows: np.ndarray, units: np.ndarray, most: int
) -> list[Fold]:
    """Units [N], sessions or groups, in order; where that leaves out a class, those of each class
    one by one."""
    unit = units[rows]
    known = np.unique(unit)
    if len(known) < 2:
        return []
    count = min(most, len(known))
    in_order = np.array_split(known, count)
    dealt = _dealt(unit, frames.labels[rows], count)
    classes = set(frames.labels[rows])
    for groups in (in_order, dealt):
        found = [_fold(rows, np.isin(unit, group)) for group in groups]
        if all(_learns(frames, train, classes) for train, _ in found):
            return found
    return []


def _dealt(unit: np.ndarray, labels: np.ndarray, count: int) -> list[list[Any]]:
    """Units dealt out class by class, so that one of few classes is beside those of others."""
    by_class = [np.unique(unit[labels == label]) for label in np.unique(labels)]
    order = list(dict.fromkeys(np.concatenate(by_class).tolist()))
    return [order[k::count] for k in range(count)]


def _learns(frames: Frames, train: np.ndarray, classes: set[int]) -> bool:
    """Whether training frames have two samples and every class."""
    return len(train) >= 2 and set(frames.labels[train]) == classes


def _fold(rows: np.ndarray, tested: np.ndarray) -> Fold:
    return rows[~tested], rows[tested]


@dataclass
class Scores:
    """Mean loss of each method over all folds, and why some have none.

    Attributes:
        losses: method → mean loss of the frames; in the order of trial.
        reasons: method's name → why it could not be tried.
        given_up: names of those that were far behind in the first fold, and tried no further.
        not_tried: names of those for which no time was left.
    """

    losses: dict[Method, float] = field(default_factory=dict)
    reasons: dict[str, str] = field(default_factory=dict)
    given_up: list[str] = field(default_factory=list)
    not_tried: list[str] = field(default_factory=list)

    def finished(self, kind: type) -> list[Method]:
        """The methods of a kind that were tried to the end, in the order of trial."""
        return [
            method
            for method in self.losses
            if isinstance(method, kind) and method.name not in self.given_up
        ]

    def best(self, kind: type) -> Method | None:
        """The method of a kind with the least loss, the first of equal ones."""
        tried = self.finished(kind)
        return min(tried, key=lambda method: self.losses[method], default=None)


def race(
    methods: Sequence[Method],
    frames: Frames,
    made: Sequence[Fold],
    scores: Scores,
    is_over: Callable[[], bool] = lambda: False,
) -> Iterator[Method]:
    """Cross-validate one method after the other into `scores`; each is yielded when it is done.

    A method other than the first, the published form, is given up after the first fold if it is
    worse than the best of its kind so far by 3 standard errors of the difference, and by 0.05
    (Maron, Moore, NIPS 1993). One that refuses the frames is left out. When `is_over`, the rest is
    not tried.
    """
    first_folds: dict[type, dict[Method, np.ndarray]] = {}
    for method in methods if made else ():
        if scores.losses and is_over():
            scores.not_tried.append(method.name)
            continue
        own_kind = first_folds.setdefault(type(method), {})
        found = []
        for fold in made:
            losses = losses_of(method, frames, fold, scores)
            if losses is None:
                break
            found.append(losses)
            own_kind.setdefault(method, losses)
            if method != methods[0] and method in far_behind(own_kind):
                scores.given_up.append(method.name)
                break
        if found and method.name not in scores.reasons:
            scores.losses[method] = float(np.concatenate(found).mean())
        yield method


def losses_of(
    method: Method, frames: Frames, fold: Fold, scores: Scores
) -> np.ndarray | None:
    """Loss of each answer of a fold [Q]; None where the method refuses the frames.

    Its reason is noted among the scores.
    """
    train, test = fold
    try:
        answers = method.answers(frames, train, test)
    except ValueError as error:
        scores.reasons[method.name] = str(error)
        return None
    return frames.losses(answers, test)


def far_behind(losses: Mapping[Method, np.ndarray]) -> list[Method]:
    """Methods whose losses [Q] of the same frames are 3 standard errors above the least."""
    if not losses:
        return []
    best = min(losses.values(), key=lambda own: own.mean())
    found = []
    for method, own in losses.items():
        more = own - best
        error = more.std() / np.sqrt(len(more))
        if more.mean() > max(_ERRORS * error, _LEAST):
            found.append(method)
    return found
