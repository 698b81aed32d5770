"""The model that the page teaches, and the frames it was taught with; no threads, no browser.

The model is always trained anew from the kept samples, and recalibrated by those of each
recalibration, which takes milliseconds. An operation that is refused raises ValueError, whose text
the page shows, and changes nothing.
"""

from __future__ import annotations

import tempfile
import time
from collections import Counter, deque
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from hdc import HDCClassifier, HDCRegressor, bits
from hdc.encoders import Median
from hdc.inputs import tensor
from hdc.live.sources import Source
from hdc.readouts import Majority

READOUTS = ("majority", "ridge", "neighbours")
"""Read-outs that can be recalibrated, which the page offers."""
RECENT = 20
"""Tests behind the accuracy that is shown."""
ALPHA = 0.05
"""Error rate of prediction sets: they miss the true class in one of twenty frames.

A frame whose set is empty is none of the classes."""
Interval = tuple[float, ...]
"""A value, and the lower and upper end of its interval; one with a period has no interval."""


@dataclass(frozen=True)
class Answer:
    """The model's prediction for a frame."""

    label: str | None = None  # None: none of these, or values only
    likely: tuple[str, ...] | None = ()
    """Prediction set; None of a model that was recalibrated for some classes alone."""
    distances: Mapping[str, float] = field(default_factory=dict)
    """Hamming, to each prototype, as a share of the bits."""
    values: tuple[Interval, ...] = ()
    """Of a model of numbers."""

    @property
    def margin(self) -> float | None:
        """How much farther the second nearest class is; None with fewer than two."""
        nearest = sorted(self.distances.values())[:2]
        if len(nearest) < 2:
            return None
        return nearest[1] - nearest[0]


class Lesson(NamedTuple):
    """Samples of lesson 0 train the model; those of a later one recalibrate it by p."""

    number: int = 0
    p: float = 0.0


class Sample(NamedTuple):
    """A frame with its label."""

    frame: np.ndarray
    label: str
    lesson: Lesson


class Session:
    """One model and frames of one source, which teach it unless it was trained before.

    Args:
        source: of the frames.
        trained: a model to show as it is; without one, the page teaches its own.

    Attributes:
        source: of the frames.
        is_taught: whether the page teaches the model.
        model: None until two classes are taught.
        regressor: a model of numbers that was trained before; else None.
        readout: of the model.
        counts: samples of each class, in the order they were taught; replaced, never changed.
        tests: whether the latest tests were right.
    """

    def __init__(
        self, source: Source, trained: HDCClassifier | HDCRegressor | None = None
    ) -> None:
        self.source = source
        self.is_taught = trained is None
        self.readout = READOUTS[0]
        self.model: HDCClassifier | None = None
        self.regressor: HDCRegressor | None = None
        self.counts: dict[str, int] = {}
        self.tests: deque[bool] = deque(maxlen=RECENT)
        self._samples: list[Sample] = []
        if isinstance(trained, HDCRegressor):
            self.regressor = trained
        elif trained is not None:
            self.model = trained
            names = map(str, trained.classes_.tolist())
            counts = trained.counts_.tolist()
            self.counts = dict(zip(names, counts, strict=True))

    # Prediction ----------------------------------------------------------------------------------

    def look(self) -> tuple[np.ndarray, np.ndarray, Answer | None, float]:
        """The next frame [H, W], its hypervector as bool [H, W], and the model's answer.

        Last are the seconds that the answer took, from frame to label and values.
        """
        frame = self.source.frame()
        words = Median().encode(tensor(frame[None]))
        hypervector = bits.unpack(words[0], frame.size).numpy()
        begin = time.perf_counter()
        answer = self.ask(frame)
        seconds = time.perf_counter() - begin
        return frame, hypervector.reshape(frame.shape), answer, seconds

    def ask(self, frame: np.ndarray) -> Answer | None:
        """The model's answer for a frame [H, W]; None while it can give none."""
        if self.regressor is not None:
            parts: tuple[np.ndarray, ...]
            if self.regressor.period is None:
                parts = self.regressor.predict(frame[None], return_interval=True)
            else:
                parts = (self.regressor.predict(frame[None]),)
            columns = [np.ravel(part).tolist() for part in parts]
            return Answer(values=tuple(zip(*columns, strict=True)))
        if self.model is None:
            return None
        frames = self.model.encode(frame[None])
        names = [str(c) for c in self.model.classes_]
        shares = np.zeros(0)
        if hasattr(self.model, "distances"):
            shares = self.model.distances(frames)[0] / self.model.dimension_
        (label,) = self.model.predict(frames).tolist()
        likely: tuple[str, ...] | None
        try:
            likely = tuple(map(str, self.model.predict_set(frames, ALPHA)[0]))
        except ValueError:  # it was recalibrated, and has no scores of training frames
            likely = None
        return Answer(
            label=None if likely == () else str(label),
            likely=likely,
            distances=dict(zip(names, shares.tolist(), strict=False)),
        )

    def count(self, samples: Sequence[Sample]) -> None:
        """Count which of these samples the model recognises."""
        for sample in samples:
            answer = self.ask(sample.frame)
            if answer:
                self.tests.append(answer.label == sample.label)

    # Teaching ------------------------------------------------------------------------------------

    def learn(self, name: str, n: int, new: bool = False) -> None:
        """Learn up to n samples of what is seen now, as a new class or as a known one."""
        if new:
            name = self._new_name(name)
        else:
            self._check_known(name)
        # Samples join the latest recalibration of their class: they are of today, too.
        own = [sample for sample in self._samples if sample.label == name]
        lesson = max((sample.lesson for sample in own), default=Lesson())
        samples = self.take(name, n, lesson)
        if not new:
            self.count(samples)
        self._train(self._samples + samples)

    def _new_name(self, name: str) -> str:
        name = name.strip()
        if not name:
            raise ValueError("A class needs a name.")
        if name in self.counts:
            raise ValueError(f"There is a class “{name}” already: choose another name.")
        return name

    def recalibrate(self, name: str, n: int, p: float) -> None:
        """Recalibrate a class by n samples of what is seen now."""
        lesson = self.next_lesson(p)
        self._check_known(name)
        self.adapt(self.take(name, n, lesson))

    def next_lesson(self, p: float) -> Lesson:
        """The lesson of a recalibration, after all that there were."""
        if self.model is None:
            raise ValueError(
                "There is nothing to recalibrate yet: teach two classes first."
            )
        numbers = [sample.lesson.number for sample in self._samples]
        return Lesson(max(numbers, default=0) + 1, p)

    def adapt(self, samples: list[Sample]) -> None:
        """Recalibrate by these samples."""
        self._train(self._samples + samples)
        self.tests.clear()

    def forget(self, name: str | None) -> None:
        """Forget a class, or (None) all of them."""
        kept: list[Sample] = []
        if name is not None:
            self._check_known(name)
            kept = [sample for sample in self._samples if sample.label != name]
        self._train(kept)
        self.tests.clear()

    def use(self, readout: str) -> None:
        """Switch the read-out, trained on the same frames."""
        if readout != self.readout:
            self._train(self._samples, readout)
            self.tests.clear()

    def take(self, name: str, n: int, lesson: Lesson) -> list[Sample]:
        """Up to n samples of what is seen now."""
        return [Sample(frame, name, lesson) for frame in self.source.samples(n)]

    def _check_known(self, name: str) -> None:
        if name not in self.counts:
            raise ValueError(f"There is no class “{name}” any more.")

    def _train(self, samples: list[Sample], readout: str | None = None) -> None:
        """Train on these samples and keep them; where that raises, nothing changes."""
        if not self.is_taught:
            raise ValueError("This model was trained before and is shown as it is.")
        readout = readout or self.readout
        model = _classifier(samples, readout)
        self._samples = samples
        self.model = model
        self.readout = readout
        self.counts = dict(Counter(sample.label for sample in samples))

    def saved(self) -> bytes:
        """The model as a file of :meth:`hdc.HDCClassifier.save`."""
        if self.model is None:
            raise ValueError("There is nothing to save yet: teach two classes first.")
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "model.safetensors"
            self.model.save(path, self.source.metadata)
            return path.read_bytes()


def _classifier(samples: Sequence[Sample], readout: str) -> HDCClassifier | None:
    """A classifier taught and recalibrated lesson by lesson; None with fewer than two classes."""
    if len({sample.label for sample in samples}) < 2:
        return None
    part: Any = readout
    if readout == "majority":  # lessons are of any length
        part = Majority(class_weight="balanced")
    first, *others = sorted({sample.lesson for sample in samples})
    model = HDCClassifier(readout=part).fit(*_of_lesson(samples, first))
    for lesson in others:
        given: dict[str, Any] = {"p": lesson.p, "random_state": lesson.number}
        used = {name: given[name] for name in given.keys() & model.readout_.adapts_by}
        model.recalibrate(*_of_lesson(samples, lesson), **used)
    return model


def _of_lesson(
    samples: Sequence[Sample], lesson: Lesson
) -> tuple[np.ndarray, list[str]]:
    """Frames and labels of a lesson."""
    chosen = [sample for sample in samples if sample.lesson == lesson]
    frames = np.stack([sample.frame for sample in chosen])
    return frames, [sample.label for sample in chosen]
