"""The choice of encoder and read-out, by cross-validation on the training frames alone."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np

from hdc import HDCClassifier, HDCRegressor
from hdc.command.compare.frames import Frames
from hdc.encoders import ENCODERS, make_encoder
from hdc.readouts import (
    READOUTS,
    VALUE_READOUTS,
    make_readout,
    make_value_readout,
)

FOLDS = 5
_ERRORS = 3  # standard errors behind the best at which a method is given up,
_LEAST = 0.05  # and the least difference of mean losses
Fold = tuple[np.ndarray, np.ndarray]
"""Indices of frames to learn and to test."""


class Method(Protocol):
    """What is compared."""

    @property
    def name(self) -> str:
        """What tables call it."""

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
        encoder = frames.encoder(self.encoder)
        if frames.values is None:
            model = HDCClassifier(encoder, self.readout, backend=frames.backend)
            return model.predict_from(frames.bank, train, test)
        numbers = HDCRegressor(encoder, self.readout, backend=frames.backend)
        numbers.fit(frames.bank.at(train), frames.values[train])
        return numbers.predict(frames.bank.at(test))


def published(learns_values: bool) -> Combination:
    """What a model is without a choice: the published classifier, or ridge for values."""
    return Combination("median", "ridge" if learns_values else "majority")


def combinations(
    encoders: Sequence[str], readouts: Sequence[str], learns_values: bool
) -> list[Combination]:
    """Each encoder with each read-out, by default all of the library; the published one first.

    Raises:
        ValueError, TypeError: for a name that is none of them.
    """
    ours = VALUE_READOUTS if learns_values else READOUTS
    make = make_value_readout if learns_values else make_readout
    encoders = list(dict.fromkeys(encoders or ENCODERS))
    readouts = list(dict.fromkeys(readouts or ours))
    for encoder in encoders:
        make_encoder(encoder).check()
    for readout in readouts:
        make(readout).check()
    first = published(learns_values)
    pairs = [Combination(e, r) for e in encoders for r in readouts]
    return [first, *(pair for pair in pairs if pair != first)]


def folds(frames: Frames, rows: np.ndarray) -> tuple[list[Fold], str]:
    """Folds of the training frames `rows`, and how they were made.

    Whole sessions in order where there are two or more and no fold has a class alone; else at
    random, every class in each fold. No fold where a class has a single frame.
    """
    by_session = _folds_of_sessions(frames, rows)
    if by_session:
        return by_session, "by session"
    rng = np.random.default_rng(0)
    labels = frames.labels[rows]
    count = min(FOLDS, int(np.unique(labels, return_counts=True)[1].min()))
    if count < 2 or len(rows) < 4:
        return [], "at random"
    # Dealt out class by class without starting anew, so that folds are of one size.
    shuffled = rng.permutation(len(rows))
    dealt = shuffled[np.argsort(labels[shuffled], kind="stable")]
    place = np.empty(len(rows), np.int64)
    place[dealt] = np.arange(len(rows)) % count
    return [_fold(rows, place == k) for k in range(count)], "at random"


def _folds_of_sessions(frames: Frames, rows: np.ndarray) -> list[Fold]:
    if frames.session is None:
        return []
    session = frames.session[rows]
    known = np.unique(session)
    if len(known) < 2:
        return []
    groups = np.array_split(known, min(FOLDS, len(known)))
    found = [_fold(rows, np.isin(session, group)) for group in groups]
    classes = set(frames.labels[rows])
    for train, _ in found:
        if set(frames.labels[train]) != classes or len(train) < 2:
            return []
    return found


def _fold(rows: np.ndarray, tested: np.ndarray) -> Fold:
    return rows[~tested], rows[tested]


@dataclass
class Scores:
    """Mean loss of each method over all folds, and why some have none.

    Attributes:
        losses: method → mean loss of the frames; in the order of trial.
        reasons: method's name → why it could not be tried.
        given_up: names of those that were far behind in the first fold, and tried no further.
    """

    losses: dict[Method, float] = field(default_factory=dict)
    reasons: dict[str, str] = field(default_factory=dict)
    given_up: list[str] = field(default_factory=list)

    def best(self, kind: type) -> Method | None:
        """The method of a kind with the least loss, the first of equal ones."""
        tried = [
            method
            for method in self.losses
            if isinstance(method, kind) and method.name not in self.given_up
        ]
        return min(tried, key=lambda method: self.losses[method], default=None)


def cross_validate(
    methods: Sequence[Method], frames: Frames, made: Sequence[Fold]
) -> Scores:
    """Mean loss of each method; a frame counts once. One that refuses the frames is left out.

    After the first fold, those that are worse than the best of their kind by 3 standard errors of
    the difference, and by 0.05, are given up, as in a race (Maron, Moore, NIPS 1993); the first
    method, the published form, is tried to the end.
    """
    losses: dict[Method, list[np.ndarray]] = {method: [] for method in methods}
    scores = Scores()
    with progress("Choosing", len(made) * len(methods)) as step:
        for train, test in made:
            for method in methods:
                step()
                if method.name in scores.reasons or method.name in scores.given_up:
                    continue
                try:
                    found = method.answers(frames, train, test)
                except ValueError as error:
                    scores.reasons[method.name] = str(error)
                    continue
                losses[method].append(frames.losses(found, test))
            if train is made[0][0]:
                scores.given_up = _given_up(losses, methods[0])
    for method, parts in losses.items():
        if parts and method.name not in scores.reasons:
            scores.losses[method] = float(np.concatenate(parts).mean())
    return scores


def choose(frames: Frames) -> tuple[Combination, str]:
    """The best combination of the library by cross-validation of all frames, and a line on it."""
    rows = np.arange(len(frames.bank))
    learns_values = frames.values is not None
    tried = combinations((), (), learns_values)
    made, how = folds(frames, rows)
    scores = cross_validate(tried, frames, made)
    first = published(learns_values)
    chosen = scores.best(Combination)
    if not isinstance(chosen, Combination):
        return first, f"chosen: {first.name}, for a class has one frame only"
    best, before = scores.losses[chosen], scores.losses[first]
    if learns_values:
        compared = f"{best:.3g} of a guess's error, {first.name} {before:.3g}"
    else:
        compared = f"accuracy {1 - best:.1%}, the published form {1 - before:.1%}"
    line = f"{chosen.name} among {len(scores.losses)} by {len(made)} folds {how}"
    return chosen, f"chosen: {line} ({compared})"


def _given_up(losses: Mapping[Method, Sequence[np.ndarray]], kept: Method) -> list[str]:
    """Names of the methods that are far behind the best of their kind, but one."""
    kinds: dict[type, dict[Method, np.ndarray]] = {}
    for method, parts in losses.items():
        if parts:
            kinds.setdefault(type(method), {})[method] = parts[0]
    behind = [method for own in kinds.values() for method in far_behind(own)]
    return [method.name for method in behind if method != kept]


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


@contextmanager
def progress(what: str, total: int) -> Iterator[Callable[[], None]]:
    """A function to call at every step of so many; a bar on the terminal while there is one."""
    if not sys.stderr.isatty():
        yield lambda: None
        return
    from rich.console import Console
    from rich.progress import Progress

    with Progress(console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task(what, total=total)
        yield lambda: bar.advance(task)
