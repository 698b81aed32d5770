"""Cross-validation of a model, and the test of what one of them wins."""

from __future__ import annotations

import time
import warnings
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from hdc import circular
from hdc.command import splits
from hdc.command.compare.candidates import Candidate
from hdc.command.splits import Units
from hdc.readers import Recording

FLIPS = 9_999
"""Random signs of the units, for the test of a gain."""


@dataclass(frozen=True)
class Data:
    """Frames in memory, what is learnt of them, and how they are tested.

    Attributes:
        frames: [N, H, W] or [N, D].
        truth: names of the classes [N], or values [N, T].
        splits: of the frames; each test frame is tested once.
        units: sessions, groups or frames, of the test frames [Q] in the order of the splits.
        period: of values that go round.
    """

    frames: np.ndarray
    truth: np.ndarray
    splits: Sequence[splits.Split]
    units: Units
    period: float | None = None

    @classmethod
    def within(
        cls,
        recording: Recording,
        rows: np.ndarray | None = None,
        period: float | None = None,
    ) -> Data:
        """The folds of a recording, or of some of its frames."""
        rows = np.arange(len(recording)) if rows is None else rows
        made, unit = splits.folds(recording, rows)
        order = np.concatenate([test for _, test in made])
        tested = replace(unit, of=unit.of[order])
        frames, truth = recording.frames(rows), truth_of(recording)[rows]
        return cls(frames, truth, made, tested, period)

    def on(self, other: Recording) -> Data:
        """The same frames to learn, and those of another recording to test."""
        n, q = len(self.frames), len(other)
        split = np.arange(n), np.arange(n, n + q)
        frames = np.concatenate([self.frames, other[:]])
        truth = np.concatenate([self.truth, truth_of(other)])
        unit = splits.units(other, np.arange(q))
        return Data(frames, truth, [split], unit, self.period)

    @property
    def how(self) -> str:
        """How the frames are tested, in words."""
        kind = self.units.kind
        return f"{len(self.splits)} folds {'at random' if kind == 'frame' else f'by {kind}'}"

    @property
    def tested(self) -> np.ndarray:
        """What is true of the test frames, [Q] or [Q, T]."""
        return self.truth[np.concatenate([test for _, test in self.splits])]


def truth_of(recording: Recording) -> np.ndarray:
    """Names of the classes [N], or values [N, T]."""
    if recording.values is not None:
        return recording.values
    return np.array(recording.names)


@dataclass(frozen=True)
class Row:
    """Answers of a model.

    Attributes:
        losses: 1 for a wrong label, or the mean error of T values in units of a guess's, [Q].
        errors: of each value [Q, T]; [Q, 0] of classes.
        train_s: seconds to learn, a mean over the splits.
        frame_ms: milliseconds a frame to predict.
    """

    losses: np.ndarray
    errors: np.ndarray
    train_s: float
    frame_ms: float


def judged(candidate: Candidate, data: Data) -> Row:
    """The answers of a candidate to the test frames, learnt from the training frames.

    Raises:
        ValueError: the candidate refuses the frames.
    """
    answers, trained, asked = [], 0.0, 0.0
    for train, test in data.splits:
        start = time.perf_counter()
        model = candidate.make().fit(data.frames[train], data.truth[train])
        trained += time.perf_counter() - start
        start = time.perf_counter()
        answers.append(np.asarray(model.predict(data.frames[test])))
        asked += time.perf_counter() - start
    found, truth = np.concatenate(answers), data.tested
    times = trained / len(data.splits), 1000 * asked / len(truth)
    if truth.ndim == 1:
        losses = (found != truth).astype(float)
        return Row(losses, np.empty((len(truth), 0)), *times)
    errors = circular.errors(found.reshape(truth.shape), truth, data.period)
    return Row((errors / guesses(data)).mean(axis=1), errors, *times)


def guesses(data: Data) -> np.ndarray:
    """Mean error [T] of a guess of the median, or of the mean direction of values that go round;
    1 of values that are all equal."""
    middle = np.median(data.truth, axis=0)
    if data.period is not None:
        plane = circular.to_plane(data.truth, data.period).mean(axis=0)
        middle = circular.from_plane(plane[None], data.period, True)[0]
    error = circular.errors(data.truth, middle, data.period).mean(axis=0)
    return np.where(error > 0, error, 1.0)


def compared(
    candidates: Iterable[Candidate], tests: Sequence[Data], refused: dict[str, str]
) -> Iterator[tuple[Candidate, list[Row]]]:
    """Each candidate with its answers in each test.

    One that refuses the frames is left out, and noted among the `refused` with its reason.
    """
    for candidate in candidates:
        try:
            with warnings.catch_warnings():
                # Of each model and each fold they would be the same ones.
                warnings.simplefilter("ignore", UserWarning)
                rows = [judged(candidate, data) for data in tests]
        except ValueError as error:
            refused[candidate.name] = str(error)
            continue
        yield candidate, rows


def best(tried: Mapping[Candidate, Row]) -> Candidate:
    """The form with the least loss, the first of equal ones."""
    forms = [candidate for candidate in tried if candidate.parts]
    return min(forms, key=lambda form: tried[form].losses.mean())


def p_value(
    mine: str, theirs: str, losses: Mapping[str, np.ndarray], units: np.ndarray
) -> float:
    """The probability of so large a gain of one model over another by chance.

    Signs of the differences are flipped unit by unit, for frames of a session or a group go
    together. The largest gain of all models counts, so that the choice of the best is no advantage
    (Westfall, Young, Resampling-based multiple testing (1993)).

    Args:
        mine: name of the model that was chosen among those of `losses`.
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
