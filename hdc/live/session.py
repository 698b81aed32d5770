"""The model that the page teaches, and the frames it was taught with; no threads, no browser.

The model is always trained anew from the kept samples, and recalibrated by those of each
recalibration, which takes milliseconds. An operation that is refused raises ValueError, whose text
the page shows, and changes nothing.
"""

from __future__ import annotations

import re
import tempfile
from collections import Counter, deque
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np

from hdc import HDCClassifier, HDCRegressor, bits
from hdc.classifier import READOUTS
from hdc.encode import encode
from hdc.inputs import tensor
from hdc.live.sources import Pressable, Source, Touch

RECENT = 20
"""Tests behind the accuracy that is shown."""
ALPHA = 0.1
"""Error rate of prediction sets: they miss the true class in one of ten frames."""
_NUMBER = re.compile(r"([-+]?\d+(?:\.\d+)?)\s*[^\d\s]*")  # "1.5" or "1.5 mm"


@dataclass(frozen=True)
class Answer:
    """The model's prediction for a frame."""

    label: str | None  # None: none of these
    likely: tuple[str, ...]  # prediction set
    distances: dict[str, float]  # Hamming, to each prototype, as a share of the bits
    values: tuple[
        tuple[float, float, float], ...
    ] = ()  # value, low, high, where taught


class Lesson(NamedTuple):
    """Samples of lesson 0 train the model; those of a later one recalibrate it by p."""

    number: int = 0
    p: float = 0.0


class Sample(NamedTuple):
    """A frame with its label, and with its position or number where that is known."""

    frame: np.ndarray
    label: str
    value: tuple[float, ...] | None
    lesson: Lesson


class Session:
    """One model, taught by frames of one source.

    Attributes:
        source: of the frames.
        model: None until two classes are taught.
        readout: of the model.
        counts: samples of each class, in the order they were taught; replaced, never changed.
        places: touches of each class, for a source that can be pressed.
        tests: whether the latest tests were right.
    """

    def __init__(self, source: Source) -> None:
        self.source, self.readout = source, READOUTS[0]
        self.model: HDCClassifier | None = None
        self.counts: dict[str, int] = {}
        self.places: dict[str, tuple[Touch, ...]] = {}
        self.tests: deque[bool] = deque(maxlen=RECENT)
        self._samples: list[Sample] = []
        self._regressor: HDCRegressor | None = None
        self._tested = 0

    # Prediction ----------------------------------------------------------------------------------

    def look(self) -> tuple[np.ndarray, np.ndarray, Answer | None]:
        """The next frame [H, W], its hypervector as bool [H, W], and the model's answer."""
        frame = self.source.frame()
        hypervector = bits.unpack(encode(tensor(frame[None])), frame.size)[0].numpy()
        return frame, hypervector.reshape(frame.shape), self.ask(frame)

    def ask(self, frame: np.ndarray) -> Answer | None:
        """The model's answer for a frame [H, W]; None with fewer than two classes."""
        if self.model is None:
            return None
        frames, values = frame[None], []
        distances = (self.model.distances(frames)[0] / self.model.dimension_).tolist()
        if self._regressor is not None:
            each = self._regressor.predict(frames, return_interval=True)
            values = list(zip(*(np.ravel(x).tolist() for x in each), strict=True))
        return Answer(
            label=self.model.predict(frames, reject=True)[0],
            likely=tuple(map(str, self.model.predict_set(frames, ALPHA)[0])),
            distances=dict(zip(self.model.classes_.tolist(), distances, strict=True)),
            values=tuple(values),
        )

    def test(self) -> None:
        """Test the model on one new touch of a taught class, if the source can be pressed."""
        taught = [name for name in self.counts if name in self.places]
        if isinstance(self.source, Pressable) and len(taught) > 1:
            name = taught[self._tested % len(taught)]
            self._count(self._take(name, 1, self.places[name], Lesson()))

    def _count(self, samples: list[Sample]) -> None:
        for sample in samples:
            if answer := self.ask(sample.frame):
                self._tested += 1
                self.tests.append(answer.label == sample.label)

    # Teaching ------------------------------------------------------------------------------------

    def learn(self, name: str, n: int, new: bool = False) -> None:
        """Learn up to n samples of the present touch or scene, as a new class or as a known one."""
        if not new:
            self._check_known(name)
        elif not (name := name.strip()):
            raise ValueError("A class needs a name.")
        elif name in self.counts:
            raise ValueError(f"There is a class “{name}” already: choose another name.")
        # Samples join the latest recalibration of their class: they are of today, too.
        lesson = max(
            (s.lesson for s in self._samples if s.label == name), default=Lesson()
        )
        samples = self._take(name, n, self._touches, lesson)
        pressed = isinstance(self.source, Pressable)
        if not new and not pressed:
            self._count(samples)
        self._train(self._samples + samples)
        if pressed:
            self.places = self.places | {name: self._touches}
        if new and pressed:
            self.tests.clear()

    def recalibrate(self, name: str | None, n: int, p: float) -> None:
        """Recalibrate a class by n samples of the present touch or scene.

        Without a name: all classes, each touched where it was taught.
        """
        if self.model is None:
            raise ValueError(
                "There is nothing to recalibrate yet: teach two classes first."
            )
        samples: list[Sample] = []
        lesson = Lesson(max((s.lesson.number for s in self._samples), default=0) + 1, p)
        for label in self.counts if name is None else [name]:
            self._check_known(label)
            place = self.places[label] if name is None else self._touches
            samples += self._take(label, n, place, lesson)
        self._train(self._samples + samples)
        self.tests.clear()

    def forget(self, name: str | None) -> None:
        """Forget a class, or (None) all of them."""
        if name is not None:
            self._check_known(name)
        self._train([s for s in self._samples if name is not None and s.label != name])
        self.places = {n: place for n, place in self.places.items() if n in self.counts}
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
        value: tuple[float, ...] | None = None
        if len(touches) == 1:
            value = 1e3 * touches[0].x, 1e3 * touches[0].y
        elif not isinstance(self.source, Pressable) and (
            number := _NUMBER.fullmatch(name)
        ):
            value = (float(number[1]),)
        return [
            Sample(frame, name, value, lesson)
            for frame in self.source.samples(n, touches)
        ]

    def _check_known(self, name: str) -> None:
        if name not in self.counts:
            raise ValueError(f"There is no class “{name}” any more.")

    def _train(self, samples: list[Sample], readout: str | None = None) -> None:
        """Train on these samples and keep them; where that raises, nothing changes."""
        readout = readout or self.readout
        counts, model = Counter(sample.label for sample in samples), None
        for lesson in sorted({s.lesson for s in samples}) if len(counts) > 1 else ():
            chosen = [sample for sample in samples if sample.lesson == lesson]
            frames, labels = (
                np.stack([s.frame for s in chosen]),
                [s.label for s in chosen],
            )
            if model is None:
                model = HDCClassifier(readout=readout).fit(frames, labels)
            else:
                model.recalibrate(frames, labels, lesson.p, lesson.number)
        self._regressor = _regressor(samples, readout)
        self._samples, self.model, self.readout = samples, model, readout
        self.counts = dict(counts)

    def saved(self) -> bytes:
        """The model as a file of :meth:`hdc.HDCClassifier.save`."""
        if self.model is None:
            raise ValueError("There is nothing to save yet: teach two classes first.")
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "model.safetensors"
            self.model.save(path, self.source.metadata)
            return path.read_bytes()


def _regressor(samples: list[Sample], readout: str) -> HDCRegressor | None:
    """A regressor of the values of samples that have one; None with fewer than two values."""
    known = [sample for sample in samples if sample.value]
    if len({sample.value for sample in known}) < 2:
        return None
    frames, values = (
        np.stack([s.frame for s in known]),
        np.array([s.value for s in known]),
    )
    # Few places are far apart: the nearest frame tells them, where a line between them does not.
    regressor = HDCRegressor(readout="ridge" if readout == "ridge" else "neighbours")
    return regressor.fit(frames, values)
