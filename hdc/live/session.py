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
from hdc.live.sources import Pressable, Source, Touch
from hdc.readouts import Majority

READOUTS = ("majority", "ridge", "neighbours")
"""Read-outs that can be recalibrated, which the page offers."""
RECENT = 20
"""Tests behind the accuracy that is shown."""
ALPHA = 0.1
"""Error rate of prediction sets: they miss the true class in one of ten frames."""
Interval = tuple[float, float, float]
"""A value, and the lower and upper end of its interval."""


@dataclass(frozen=True)
class Answer:
    """The model's prediction for a frame."""

    label: str | None = None  # None: none of these, or values only
    likely: tuple[str, ...] = ()  # prediction set
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
        places: touches of each class, for a source that can be pressed.
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
        self.places: dict[str, tuple[Touch, ...]] = {}
        self.tests: deque[bool] = deque(maxlen=RECENT)
        self._samples: list[Sample] = []
        self._tested = 0
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
            found = self.regressor.predict(frame[None], return_interval=True)
            value, low, high = (np.ravel(part).tolist() for part in found)
            return Answer(values=tuple(zip(value, low, high, strict=True)))
        if self.model is None:
            return None
        frames = self.model.encode(frame[None])
        names = [str(c) for c in self.model.classes_]
        shares = np.zeros(0)
        if hasattr(self.model, "distances"):
            shares = self.model.distances(frames)[0] / self.model.dimension_
        (label,) = self.model.predict(frames).tolist()
        if not self.model.is_known(frames)[0]:
            label = None
        (likely,) = self.model.predict_set(frames, ALPHA)
        return Answer(
            label=None if label is None else str(label),
            likely=tuple(str(c) for c in likely),
            distances=dict(zip(names, shares.tolist(), strict=False)),
        )

    def test(self) -> None:
        """Test the model on one new touch of a taught class, if the source can be pressed."""
        taught = [name for name in self.counts if name in self.places]
        if isinstance(self.source, Pressable) and len(taught) > 1:
            name = taught[self._tested % len(taught)]
            samples = self._take(name, 1, self.places[name], Lesson())
            self._count(samples)

    def _count(self, samples: list[Sample]) -> None:
        for sample in samples:
            answer = self.ask(sample.frame)
            if answer:
                self._tested += 1
                self.tests.append(answer.label == sample.label)

    # Teaching ------------------------------------------------------------------------------------

    def learn(self, name: str, n: int, new: bool = False) -> None:
        """Learn up to n samples of the present touch or scene, as a new class or as a known one."""
        if new:
            name = self._new_name(name)
        else:
            self._check_known(name)
        # Samples join the latest recalibration of their class: they are of today, too.
        own = [sample for sample in self._samples if sample.label == name]
        lessons = [sample.lesson for sample in own]
        lesson = max(lessons, default=Lesson())
        samples = self._take(name, n, self._touches, lesson)
        pressed = isinstance(self.source, Pressable)
        if not new and not pressed:
            self._count(samples)
        self._train(self._samples + samples)
        if pressed:
            self.places = self.places | {name: self._touches}
        if new and pressed:
            self.tests.clear()

    def _new_name(self, name: str) -> str:
        name = name.strip()
        if not name:
            raise ValueError("A class needs a name.")
        if name in self.counts:
            raise ValueError(f"There is a class “{name}” already: choose another name.")
        return name

    def recalibrate(self, name: str | None, n: int, p: float) -> None:
        """Recalibrate a class by n samples of the present touch or scene.

        Without a name: all classes, each touched where it was taught.
        """
        if self.model is None:
            raise ValueError(
                "There is nothing to recalibrate yet: teach two classes first."
            )
        numbers = [sample.lesson.number for sample in self._samples]
        lesson = Lesson(max(numbers, default=0) + 1, p)
        samples: list[Sample] = []
        if name is None:
            for label in self.counts:
                samples += self._take(label, n, self.places[label], lesson)
        else:
            self._check_known(name)
            samples = self._take(name, n, self._touches, lesson)
        self._train(self._samples + samples)
        self.tests.clear()

    def forget(self, name: str | None) -> None:
        """Forget a class, or (None) all of them."""
        kept: list[Sample] = []
        if name is not None:
            self._check_known(name)
            kept = [sample for sample in self._samples if sample.label != name]
        self._train(kept)
        self.places = {
            label: touches
            for label, touches in self.places.items()
            if label in self.counts
        }
        self.tests.clear()

    def use(self, readout: str) -> None:
        """Switch the read-out, trained on the same frames."""
        if readout != self.readout:
            self._train(self._samples, readout)
            self.tests.clear()

    def drift(self, kelvin: float) -> None:
        """Set the drift of a sensor that can be pressed."""
        if isinstance(self.source, Pressable):
            self.source.offset = kelvin
            self.tests.clear()

    @property
    def _touches(self) -> tuple[Touch, ...]:
        return self.source.touches if isinstance(self.source, Pressable) else ()

    def _take(
        self, name: str, n: int, touches: tuple[Touch, ...], lesson: Lesson
    ) -> list[Sample]:
        frames = self.source.samples(n, touches)
        return [Sample(frame, name, lesson) for frame in frames]

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
    model = None
    part: Any = readout
    if readout == "majority":  # lessons are of any length
        part = Majority(balance=True)
    for lesson in sorted({sample.lesson for sample in samples}):
        chosen = [sample for sample in samples if sample.lesson == lesson]
        frames = np.stack([sample.frame for sample in chosen])
        labels = [sample.label for sample in chosen]
        if model is None:
            model = HDCClassifier(readout=part).fit(frames, labels)
        else:
            given: dict[str, Any] = {"p": lesson.p, "seed": lesson.number}
            used = given.keys() & model.readout_.adapts_by
            model.recalibrate(frames, labels, **{name: given[name] for name in used})
    return model
