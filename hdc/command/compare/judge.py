"""Cross-validation of models that share the hypervectors of a recording; the test of a gain."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from hdc import backends
from hdc.bank import Bank
from hdc.command import splits
from hdc.command.source import truth_of
from hdc.command.splits import Units
from hdc.inputs import tensor
from hdc.readers import Recording

FLIPS = 9_999
"""Random signs of the units, for the test of a gain."""


@dataclass(frozen=True)
class Data:
    """Frames in memory, and what is learnt of them.

    Attributes:
        frames: [N, H, W] or [N, D].
        truth: names of the classes [N], or values [N, T].
        scale: errors of values [T] that count as much as a wrong label.
    """

    frames: np.ndarray
    truth: np.ndarray
    scale: np.ndarray | float = 1.0

    @cached_property
    def _bank(self) -> Bank:
        return Bank(tensor(self.frames), np.zeros(len(self.frames), np.int64), 1)

    def given(self, model: Any) -> Any:
        """All frames as a model takes them: hypervectors, each made once; or the frames, for a
        model of grey values and for an encoder that learns, which is another one in each fold."""
        encoder = model.fresh("encoder") if hasattr(model, "encoder") else None
        if encoder is None or encoder.learns:
            return self.frames
        backend = backends.choose_backend("auto", "cpu", self.frames.size)
        with backends.computing(backend):
            return self._bank.words(encoder=encoder)


@dataclass(frozen=True)
class Test:
    """How frames are tested.

    Attributes:
        splits: of the frames; each of the Q test frames is tested once.
        units: sessions, groups or frames, of the test frames [Q] in their order.
    """

    splits: Sequence[splits.Split]
    units: Units

    @property
    def how(self) -> str:
        """How the frames are tested, in words."""
        kind = self.units.kind
        return f"{len(self.splits)} folds {'at random' if kind == 'frame' else f'by {kind}'}"


def prepared(
    recording: Recording, other: Recording | None = None
) -> tuple[Data, list[Test]]:
    """The frames of a recording, then all of the other, in memory; and how they are tested.

    The tests are the folds of the former and, where there is another recording, the test on it.

    Raises:
        ValueError: a class has a single frame, or a single group.
    """
    tests = [Test(*splits.folds(recording))]
    frames, truth = recording[:], truth_of(recording)
    scale = 1.0 if truth.ndim == 1 else constant_errors(truth)
    if other is not None:
        rows = np.arange(len(frames) + len(other))
        first, new = np.split(rows, [len(frames)])
        tests.append(Test([(first, new)], splits.units(other)))
        frames = np.concatenate([frames, other[:]])
        truth = np.concatenate([truth, truth_of(other)])
    return Data(frames, truth, scale), tests


def errors(model: Any, data: Data, test: Test) -> np.ndarray:
    """Errors of a model for the test frames, learnt from the training frames.

    They are the absolute error of each value [Q, T]; of classes [Q, 1], 1 for a wrong label.

    Raises:
        ValueError: the model refuses the frames.
    """
    from sklearn.base import clone

    given, answers, tested = data.given(model), data.truth.copy(), []
    for train, rows in test.splits:
        trained = clone(model).fit(given[train], data.truth[train])
        found = np.asarray(trained.predict(given[rows]))
        answers[rows] = found.reshape(answers[rows].shape)
        tested.append(rows)
    order = np.sort(np.concatenate(tested))
    found, truth = answers[order], data.truth[order]
    if truth.ndim == 1:
        return (found != truth).astype(float)[:, None]
    return np.abs(found - truth)


def times(model: Any, data: Data, test: Test) -> tuple[float, float]:
    """Seconds to learn the training frames of the first fold, and milliseconds per frame to answer
    its test frames; both include encoding."""
    from sklearn.base import clone

    train, rows = test.splits[0]
    start = time.perf_counter()
    trained = clone(model).fit(data.frames[train], data.truth[train])
    learnt = time.perf_counter()
    trained.predict(data.frames[rows])
    return learnt - start, 1000 * (time.perf_counter() - learnt) / len(rows)


def constant_errors(values: np.ndarray) -> np.ndarray:
    """Mean error [T] of always answering the median of values [N, T]; 1 where all are equal."""
    error = np.abs(values - np.median(values, axis=0)).mean(axis=0)
    return np.where(error > 0, error, 1.0)


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
