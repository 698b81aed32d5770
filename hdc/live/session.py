"""The model that the page teaches, and the frames it was taught with; no threads, no browser.

The model is always trained anew from the kept samples, and recalibrated by the samples of each
recalibration, which takes milliseconds. An operation that is refused raises ValueError, whose text
the page shows, and changes nothing.
"""

from __future__ import annotations

import tempfile
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

import numpy as np

from hdc import HDCClassifier, bits
from hdc.encoders import Median
from hdc.hypervectors import Hypervectors
from hdc.inputs import tensor
from hdc.live.sources import Source
from hdc.readouts import Majority

REPLACED = 0.75
"""Probability that a recalibration replaces a bit."""


@dataclass(frozen=True)
class Answer:
    """The model's prediction for a frame."""

    label: str | None  # None: none of these
    distances: Mapping[str, float] = field(default_factory=dict)
    """Hamming, to each prototype, as a share of the bits."""


@dataclass(frozen=True)
class View:
    """The latest frame and what the model says of it."""

    drawn: np.ndarray | None = None
    """uint8 [H, 2·W]: grey values, and beside them the share of each pixel's bits that are one."""
    answer: Answer | None = None  # None where the model cannot predict yet
    error: str = ""  # why there is no newer frame


class Sample(NamedTuple):
    """A frame with its label. Samples of lesson 0 train the model, later ones recalibrate it."""

    frame: np.ndarray
    label: str
    lesson: int


class Session:
    """One model and frames of one source, which teach it unless it was trained before.

    Args:
        source: of the frames.
        trained: a model to show as it is; without one, the page teaches its own.

    Attributes:
        source: of the frames.
        is_taught: whether the page teaches the model.
        model: None until two classes are taught.
        samples: all that it was taught; replaced, never changed.
        counts: samples of each class, in the order they were taught; replaced, never changed.
    """

    def __init__(self, source: Source, trained: HDCClassifier | None = None) -> None:
        self.source = source
        self.is_taught = trained is None
        self.model = trained
        self.counts: dict[str, int] = {}
        self.samples: list[Sample] = []
        if trained is not None:
            names = map(str, trained.classes_.tolist())
            self.counts = dict(zip(names, trained.counts_.tolist(), strict=True))

    # Prediction ----------------------------------------------------------------------------------

    def look(self) -> View:
        """The next frame, and the answer of the model."""
        frame = self.source.frame()
        words = self._encoded(frame)
        answer = self._answer(words)
        if words.dimension % frame.size:  # not so many bits of each pixel
            words = _published(frame)
        planes = bits.unpack(words.packed[0], words.dimension).numpy()
        shares = planes.reshape(-1, *frame.shape).mean(axis=0)
        grey = frame if frame.dtype == np.uint8 else (frame >> 8).astype(np.uint8)
        drawn = np.hstack([grey, (255 * shares).astype(np.uint8)])
        return View(drawn, answer)

    def _encoded(self, frame: np.ndarray) -> Hypervectors:
        """The hypervector of a frame [H, W]; the published one while there is no model."""
        if self.model is None:
            return _published(frame)
        return self.model.encode(frame[None])

    def ask(self, frame: np.ndarray) -> Answer | None:
        """The model's answer for a frame [H, W]; None while it can give none."""
        return self._answer(self._encoded(frame))

    def _answer(self, words: Hypervectors) -> Answer | None:
        model = self.model
        if model is None:
            return None
        (label,) = map(str, model.predict(words).tolist())
        try:
            (known,) = model.is_known(words)
        except ValueError:  # it was recalibrated for some classes alone
            known = True
        distances: dict[str, float] = {}
        if hasattr(model, "distances"):
            shares = model.distances(words)[0] / model.dimension_
            names = map(str, model.classes_)
            distances = dict(zip(names, shares.tolist(), strict=True))
        return Answer(label if known else None, distances)

    # Teaching ------------------------------------------------------------------------------------

    def learn(self, name: str, n: int, new: bool = False) -> None:
        """Learn up to n samples of what is seen now, as a new class or as a known one."""
        name = name.strip()
        if new and not name:
            raise ValueError("A class needs a name.")
        if new and name in self.counts:
            raise ValueError(f"There is a class “{name}” already: choose another name.")
        if not new:
            self._check_known(name)
        # Samples join the latest recalibration of their class: they are of today, too.
        own = [sample.lesson for sample in self.samples if sample.label == name]
        self._take(name, n, max(own, default=0))

    def recalibrate(self, name: str, n: int) -> None:
        """Recalibrate a class by n samples of what is seen now."""
        lesson = self.next_lesson()
        self._check_known(name)
        self._take(name, n, lesson)

    def next_lesson(self) -> int:
        """The lesson of a recalibration, after all that there were."""
        if self.model is None:
            raise ValueError(
                "There is nothing to recalibrate yet: teach two classes first."
            )
        return max((sample.lesson for sample in self.samples), default=0) + 1

    def forget(self, name: str) -> None:
        """Forget a class."""
        self._check_known(name)
        self.train([sample for sample in self.samples if sample.label != name])

    def _take(self, name: str, n: int, lesson: int) -> None:
        """Learn up to n samples of what is seen now."""
        taken = [Sample(frame, name, lesson) for frame in self.source.samples(n)]
        self.train(self.samples + taken)

    def _check_known(self, name: str) -> None:
        if name not in self.counts:
            raise ValueError(f"There is no class “{name}” any more.")

    def train(self, samples: list[Sample]) -> None:
        """Train on these samples and keep them; where that raises, nothing changes."""
        if not self.is_taught:
            raise ValueError("This model was trained before and is shown as it is.")
        self.model = _classifier(samples)
        self.samples = samples
        self.counts = dict(Counter(sample.label for sample in samples))

    def saved(self) -> bytes:
        """The model as a file of :meth:`hdc.HDCClassifier.save`."""
        if self.model is None:
            raise ValueError("There is nothing to save yet: teach two classes first.")
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "model.safetensors"
            self.model.save(path, self.source.metadata)
            return path.read_bytes()


def _published(frame: np.ndarray) -> Hypervectors:
    """The published hypervector of a frame [H, W], by its median."""
    return Hypervectors(Median().encode(tensor(frame[None])), frame.size)


def _classifier(samples: Sequence[Sample]) -> HDCClassifier | None:
    """A classifier taught and recalibrated lesson by lesson; None with fewer than two classes."""
    if len({sample.label for sample in samples}) < 2:
        return None
    # Lessons are of any length.
    model = HDCClassifier(readout=Majority(class_weight="balanced"))
    for lesson in sorted({sample.lesson for sample in samples}):
        own = [sample for sample in samples if sample.lesson == lesson]
        frames = np.stack([sample.frame for sample in own])
        labels = [sample.label for sample in own]
        if lesson == 0:
            model.fit(frames, labels)
        else:
            model.recalibrate(frames, labels, REPLACED, lesson)
    return model
