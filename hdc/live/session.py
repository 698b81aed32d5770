"""What is taught on the page, and what the model says: no threads and no browser here.

Whatever takes more than a frame's time is a generator that yields after every step, so that frames
go on meanwhile. Whatever a user can do wrong is a ValueError whose text is shown on the page.
"""

from __future__ import annotations

import tempfile
import time
from collections import deque
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from hdc import HDCClassifier, bits
from hdc.encode import encode
from hdc.inputs import tensor
from hdc.live.ridge import Ridge
from hdc.live.sources import Pressable, Source, Touch
from hdc.rejection import RATE

MOST_CLASSES, MOST_LETTERS = 12, 24
KEPT_BYTES = 2**26
"""For frames kept to train ridge with, and to forget a class, at two bytes a pixel: 536 frames of
250 × 250 pixels. Training ridge takes twice as much for a moment."""
RECENT = 20
"""Tests behind the accuracy shown."""
FEWEST = 6
"""Tests from which on it is drawn."""
MOST_POINTS = 400
STEPS = ("frame", "encode", "predict", "learn", "picture", "send")


@dataclass
class Answer:
    """What the model says of a frame.

    Attributes:
        label: nearest class; None: like none of them.
        names: of the L classes.
        distances, limits: to each prototype, and from where on a frame is refused, as shares of
            the pixels; limits None where they are not known yet.
        ridge: what ridge regression says; None if it does not.
    """

    label: str | None
    names: list[str]
    distances: np.ndarray
    limits: np.ndarray | None
    ridge: str | None = None


@dataclass
class Point:
    """Accuracies (share) after so many samples; `change` counts what made them start afresh."""

    samples: int
    change: int
    accuracy: float
    ridge: float | None


@dataclass
class Session:
    """One model, taught by frames of one source.

    Attributes:
        counts: samples of each class, in the model's order; replaced, never changed.
        places: where a class is touched, for sources that can be pressed.
        shown: samples learnt or recalibrated with.
        version: grows whenever prototypes change.
        milliseconds: of each step, a running mean.
    """

    source: Source
    model: HDCClassifier = field(default_factory=HDCClassifier)
    ridge: Ridge = field(default_factory=Ridge)
    counts: dict[str, int] = field(default_factory=dict)
    places: dict[str, tuple[Touch, ...]] = field(default_factory=dict)
    shown: int = 0
    version: int = 0
    milliseconds: dict[str, float] = field(default_factory=dict)
    points: deque[Point] = field(default_factory=lambda: deque(maxlen=MOST_POINTS))

    def __post_init__(self) -> None:
        self._frames: list[np.ndarray] = []
        self._labels: list[str] = []
        self._pure = True  # the model is that of the frames kept, and of no others
        self._limits: tuple[int, np.ndarray | None] = (-1, None)
        self._tests: deque[tuple[bool, bool | None]] = deque(maxlen=RECENT)
        self._change = self._tested = 0

    # What is seen --------------------------------------------------------------------------------

    @property
    def tests(self) -> tuple[int, int]:
        """How many of the latest tests were answered rightly, and how many there were."""
        tests = list(self._tests)
        return sum(right for right, _ in tests), len(tests)

    @property
    def tested_by(self) -> str:
        if isinstance(self.source, Pressable):
            return "fresh simulated touches of each class, never learnt from"
        return "samples, each predicted before it is learnt"

    def look(self) -> tuple[np.ndarray, np.ndarray, Answer | None]:
        """The next frame, its hypervector as bool [H, W], and the answer, if there is a model.

        Raises:
            ValueError: the source gives no more frames.
        """
        begin = time.perf_counter()
        frame = self.source.frame()
        begin = self.took("frame", begin)
        words = encode(tensor(frame[None]))
        begin = self.took("encode", begin)
        answer = self._nearest(frame)
        if answer is not None:
            self.took("predict", begin)
            answer.ridge = self.ridge.predict(frame)
        return frame, bits.unpack(words, frame.size)[0].numpy().reshape(frame.shape), answer

    def ask(self, frame: np.ndarray) -> Answer | None:
        """What the model says of a frame; None with fewer than two classes."""
        if (answer := self._nearest(frame)) is not None:
            answer.ridge = self.ridge.predict(frame)
        return answer

    def _nearest(self, frame: np.ndarray) -> Answer | None:
        if len(self.counts) < 2:
            return None
        distances = self.model.distances(frame[None])[0]
        row, limits = int(distances.argmin()), self._current_limits()
        known = limits is None or distances[row] <= limits[row]
        names = self.model.classes_.tolist()
        pixels = self.model.dimension_
        return Answer(
            names[row] if known else None,
            names,
            distances / pixels,
            None if limits is None else limits / pixels,
        )

    def prototypes(self) -> dict[str, np.ndarray]:
        """Bits of each class's prototype, bool [H, W]."""
        if not self.counts:
            return {}
        unpacked = bits.unpack(self.model.prototypes_, self.model.dimension_).numpy()
        shape = self.source.shape
        names = self.model.classes_.tolist()
        return {name: plane.reshape(shape) for name, plane in zip(names, unpacked, strict=True)}

    def took(self, step: str, begin: float) -> float:
        """Note that a step took from `begin` until now, which is returned."""
        now = time.perf_counter()
        before = self.milliseconds.get(step, 1e3 * (now - begin))
        self.milliseconds[step] = before + 0.1 * (1e3 * (now - begin) - before)
        return now

    # What is taught ------------------------------------------------------------------------------

    def new_class(self, name: str, n: int, touches: Sequence[Touch] = ()) -> Iterator[None]:
        """Learn n samples of what is seen now, as a new class."""
        name = checked_name(name)
        if name in self.counts:
            raise ValueError(f"There is a class “{name}” already: choose another name.")
        if len(self.counts) >= MOST_CLASSES:
            raise ValueError(f"There are {MOST_CLASSES} classes, as many as the page shows.")
        yield from self._learn(name, n, touches)

    def add(self, name: str, n: int, touches: Sequence[Touch] = ()) -> Iterator[None]:
        """Learn n more samples of what is seen now, as a class that there is."""
        self._check_known(name)
        yield from self._learn(name, n, touches)

    def _learn(self, name: str, n: int, touches: Sequence[Touch]) -> Iterator[None]:
        if getattr(self.model, "_recalibrated", False):
            raise ValueError(
                "This model was recalibrated: recalibrate it again, or forget everything and "
                "teach anew."
            )
        pressed = isinstance(self.source, Pressable)
        if pressed:
            self.places[name] = tuple(touches)
            if name not in self.counts:
                self._start_tests()
        for _ in range(n):
            self._check_room()
            frame = self._sample(touches)
            if not pressed and name in self.counts:
                self._test(frame, name)
            begin = time.perf_counter()
            self.model.partial_fit(frame[None], [name])
            self.took("learn", begin)
            self._keep(frame, name)
            yield
        if not pressed:
            self._note()

    def recalibrate(
        self, names: Sequence[str], n: int, p: float, method: str, touches: Sequence[Touch] | None
    ) -> Iterator[None]:
        """Recalibrate some classes by n new samples of each.

        Args:
            names: the classes.
            n: samples of each.
            p, method: see :meth:`hdc.HDCClassifier.recalibrate`.
            touches: what is pressed now; None: each class is touched where it was taught.
        """
        if len(self.counts) < 2:
            raise ValueError("There is nothing to recalibrate yet: teach two classes first.")
        frames: list[np.ndarray] = []
        labels: list[str] = []
        for name in names:
            self._check_known(name)
            place = self.places.get(name) if touches is None else tuple(touches)
            if place is None:
                raise ValueError(
                    f"Where “{name}” was touched is not known: press there, and recalibrate it "
                    "with the button in its row."
                )
            for _ in range(n):
                self._check_room(len(frames))
                frames.append(self._sample(place))
                labels.append(name)
                yield
        begin = time.perf_counter()
        self.model.recalibrate(np.stack(frames), labels, p, seed=self.version, method=method)
        self.took("recalibrate", begin)
        self._pure = False
        for frame, label in zip(frames, labels, strict=True):
            self._keep(frame, label)
        self._start_tests()

    def forget(self, name: str | None) -> None:
        """Forget a class, or (None) all of them."""
        if name is not None:
            self._check_known(name)
            if not self._pure:
                raise ValueError(
                    "A model that was recalibrated or loaded forgets everything or nothing: what "
                    "it learnt of a class is no longer kept apart."
                )
        left = [(f, c) for f, c in zip(self._frames, self._labels, strict=True) if c != name]
        left = [] if name is None else left
        self.model, self._pure = HDCClassifier(), True
        self._frames, self._labels = [f for f, _ in left], [c for _, c in left]
        if left:
            self.model.partial_fit(np.stack(self._frames), self._labels)
        self.places = {c: place for c, place in self.places.items() if c in self._labels}
        if name is None:
            self.shown = 0
            self.points.clear()
        self._changed()
        self._retrain_ridge()
        self._start_tests()

    def drift(self, kelvin: float) -> None:
        """Change the temperature of a sensor that can be changed."""
        assert isinstance(self.source, Pressable)
        self.source.offset = within(kelvin, 0.0, self.source.most)
        self._start_tests()

    # Files ---------------------------------------------------------------------------------------

    def saved(self) -> bytes:
        """The model as the file that :meth:`hdc.HDCClassifier.save` writes."""
        if len(self.counts) < 2:
            raise ValueError("There is nothing to save yet: teach two classes first.")
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "model.safetensors"
            self.model.save(path, self.source.metadata)
            return path.read_bytes()

    def load(self, content: bytes) -> None:
        """Go on with the model of such a file."""
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "model.safetensors"
            path.write_bytes(content)
            try:
                model = HDCClassifier.load(path)
            except ValueError as error:
                said = str(error).removeprefix(f"{path}: ")[:200]
                raise ValueError(f"This file is no saved model: {said}") from None
        expected, found = (
            " × ".join(map(str, shape)) for shape in (self.source.shape, model.frame_shape_)
        )
        if found != expected:
            raise ValueError(
                f"This model is of frames of {found} pixels; here they have {expected}."
            )
        if model.prototype != "binary":
            raise ValueError("This model has integer prototypes; the page shows binary ones.")
        names = model.classes_.tolist()
        if len(names) > MOST_CLASSES:
            raise ValueError(f"This model has {len(names)} classes; {MOST_CLASSES} can be shown.")
        for name in names:
            if checked_name(name) != name:
                raise ValueError("This model has a class whose name cannot be shown.")
        self.forget(None)
        self.model, self._pure = model, False
        self._changed()

    # Tests ---------------------------------------------------------------------------------------

    def test(self) -> bool:
        """Ask about one fresh touch of a class; False if the source cannot be touched so."""
        taught = [name for name in self.counts if name in self.places]
        if not isinstance(self.source, Pressable) or len(taught) < 2:
            return False
        name = taught[self._tested % len(taught)]
        self._test(self.source.fresh(self.places[name]), name)
        self._note()
        return True

    def _test(self, frame: np.ndarray, name: str) -> None:
        answer = self.ask(frame)
        if answer is not None:
            self._tested += 1
            by_ridge = None if answer.ridge is None else answer.ridge == name
            self._tests.append((answer.label == name, by_ridge))

    def _note(self) -> None:
        right, n = self.tests
        if n < FEWEST:
            return
        of_ridge = [ridge for _, ridge in self._tests if ridge is not None]
        ridge = sum(of_ridge) / len(of_ridge) if of_ridge else None
        point = Point(self.shown, self._change, right / n, ridge)
        last = self.points[-1] if self.points else None
        if last is not None and (last.samples, last.change) == (point.samples, point.change):
            self.points[-1] = point
        else:
            self.points.append(point)

    def _start_tests(self) -> None:
        self._tests.clear()
        self._change += 1

    # ---------------------------------------------------------------------------------------------

    def _sample(self, touches: Sequence[Touch]) -> np.ndarray:
        source = self.source
        return source.fresh(touches) if isinstance(source, Pressable) else source.sample()

    def _keep(self, frame: np.ndarray, name: str) -> None:
        self._frames.append(frame)
        self._labels.append(name)
        self.shown += 1
        self._changed()
        self._retrain_ridge()

    def _changed(self) -> None:
        model = self.model
        if hasattr(model, "counts_"):
            names = model.classes_.tolist()
            self.counts = dict(zip(names, model.counts_.tolist(), strict=True))
        else:
            self.counts = {}
        self.version += 1

    def _retrain_ridge(self) -> None:
        self.ridge.train(list(self._frames), list(self._labels))

    def _check_known(self, name: str) -> None:
        if name not in self.counts:
            raise ValueError(f"There is no class “{name}” any more.")

    def _check_room(self, more: int = 0) -> None:
        most = KEPT_BYTES // (int(np.prod(self.source.shape)) * 2)
        if len(self._frames) + more >= most:
            raise ValueError(
                f"The page keeps up to {most} samples of this size: forget a class, or everything."
            )

    def _current_limits(self) -> np.ndarray | None:
        version, limits = self._limits
        if version != self.version:
            try:
                limits = self.model.limits(RATE)
            except ValueError:  # one sample of each class: nothing is known of distances yet
                limits = None
            self._limits = self.version, limits
        return limits


def within(value: Any, low: float, high: float) -> float:
    """A number that a browser sent, brought between two others; no number: the lower one."""
    try:
        number = float(value)
    except (TypeError, ValueError):
        return low
    return min(max(number, low), high) if number == number else low


def checked_name(name: object) -> str:
    """A name that can be shown.

    Raises:
        ValueError: it cannot.
    """
    text = name.strip() if isinstance(name, str) else ""
    if not text or len(text) > MOST_LETTERS or not text.isprintable():
        raise ValueError(f"A class needs a name of 1 to {MOST_LETTERS} letters.")
    return text
