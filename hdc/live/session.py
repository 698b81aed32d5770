"""The model that the page teaches, and the frames it was taught with; no threads, no browser.

The model is always trained anew from the kept lessons: the first trains it, each later one
recalibrates it. That takes milliseconds, and makes forgetting a class, switching the read-out and
learning after a recalibration the same simple operation. An operation that is refused raises
ValueError, whose text the page shows, and changes nothing.
"""

from __future__ import annotations

import re
import tempfile
from collections import Counter, deque
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

import hdc
from hdc import HDCClassifier, bits
from hdc.encode import encode
from hdc.inputs import tensor
from hdc.live.sources import Pressable, Source, Touch

MOST_CLASSES, MOST_LETTERS, MOST_SAMPLES = 12, 24, 1000
RECENT = 20
"""Tests behind the accuracy that is shown."""
ALPHA = 0.1
"""Error rate of prediction sets: they miss the true class in one of ten frames."""

# Parts of the library that the page shows where they are there.
HAS_SETS = hasattr(HDCClassifier, "predict_set")
HAS_VALUES = hasattr(hdc, "HDCRegressor")
READOUTS = ("prototype", "ridge", "neighbours") if HAS_SETS else ("prototype",)


@dataclass(frozen=True)
class Answer:
    """The model's prediction for a frame.

    Attributes:
        label: the predicted class; None: none of these.
        likely: classes in the prediction set; None where the library has none.
        distances: Hamming distance to each prototype, as a share of the bits.
        values: (value, low, high) of each value, if values were taught.
    """

    label: str | None
    likely: tuple[str, ...] | None
    distances: dict[str, float]
    values: tuple[tuple[float, float, float], ...] = ()


@dataclass(frozen=True)
class Sample:
    """A frame with its label, and with its position or number where that is known."""

    frame: np.ndarray
    label: str
    value: tuple[float, ...] | None


@dataclass(frozen=True)
class Lesson:
    """Samples, and the arguments with which they recalibrate the model."""

    samples: tuple[Sample, ...] = ()
    p: float = 0.0
    method: str = ""

    @property
    def frames(self) -> np.ndarray:
        return np.stack([sample.frame for sample in self.samples])

    @property
    def labels(self) -> list[str]:
        return [sample.label for sample in self.samples]


@dataclass
class Session:
    """One model, taught by frames of one source.

    Attributes:
        model: None until a class is taught.
        readout: of the model.
        counts: samples of each class, in the order they were taught; replaced, never changed.
        places: touches of each class, for a source that can be pressed.
        unit: of taught values.
        version: grows whenever the model changes.
    """

    source: Source
    model: Any = None
    readout: str = "prototype"
    counts: dict[str, int] = field(default_factory=dict)
    places: dict[str, tuple[Touch, ...]] = field(default_factory=dict)
    unit: str = "mm"
    version: int = 0

    def __post_init__(self) -> None:
        self._lessons: tuple[Lesson, ...] = (Lesson(),)
        self._file: bytes | None = None  # of a loaded model, which training starts from
        self._regressor: Any = None
        self._tests: deque[bool] = deque(maxlen=RECENT)
        self._tested = 0

    # Prediction ----------------------------------------------------------------------------------

    def look(self) -> tuple[np.ndarray, np.ndarray, Answer | None]:
        """The next frame [H, W], its hypervector as bool [H, W], and the model's answer.

        Raises:
            ValueError: the source gives no more frames.
        """
        frame = self.source.frame()
        hypervector = bits.unpack(encode(tensor(frame[None])), frame.size)[0].numpy()
        return frame, hypervector.reshape(frame.shape), self.ask(frame)

    def ask(self, frame: np.ndarray) -> Answer | None:
        """The model's answer for a frame [H, W]; None with fewer than two classes."""
        if len(self.counts) < 2:
            return None
        answer = _answer(self.model, frame)
        if self._regressor is None:
            return answer
        each = self._regressor.predict(frame[None], return_interval=True)
        return replace(
            answer, values=tuple(zip(*(np.ravel(x).tolist() for x in each), strict=True))
        )

    def prototypes(self) -> dict[str, np.ndarray]:
        """Bits of each class's prototype, bool [H, W]."""
        if self.model is None:
            return {}
        planes = bits.unpack(self.model.prototypes_, self.model.dimension_).numpy()
        classes = self.model.classes_.tolist()
        return dict(zip(classes, planes.reshape(-1, *self.source.shape), strict=True))

    @property
    def tests(self) -> tuple[int, int]:
        """How many of the latest tests the model got right, and how many there were."""
        tests = list(self._tests)
        return sum(tests), len(tests)

    def test(self) -> None:
        """Test the model on one new touch of a taught class, if the source can be pressed."""
        taught = [name for name in self.counts if name in self.places]
        if isinstance(self.source, Pressable) and len(taught) > 1:
            name = taught[self._tested % len(taught)]
            self._count(name, self.source.samples(1, self.places[name]))

    def _count(self, name: str, frames: Sequence[np.ndarray]) -> None:
        for answer in map(self.ask, frames):
            if answer is not None:
                self._tested += 1
                self._tests.append(answer.label == name)

    # Teaching ------------------------------------------------------------------------------------

    def new_class(self, name: str, n: int, touches: Sequence[Touch] = ()) -> None:
        """Learn up to n samples of the present touch or scene as a new class."""
        name = name.strip()
        if not _is_name(name):
            raise ValueError(f"A class needs a name of 1 to {MOST_LETTERS} letters.")
        if name in self.counts:
            raise ValueError(f"There is a class “{name}” already: choose another name.")
        if len(self.counts) >= MOST_CLASSES:
            raise ValueError(f"There are {MOST_CLASSES} classes, as many as the page shows.")
        self._learn(name, n, touches)
        if self.places:
            self._tests.clear()

    def add(self, name: str, n: int, touches: Sequence[Touch] = ()) -> None:
        """Learn up to n more samples of the present touch or scene."""
        self._check_known(name)
        self._learn(name, n, touches)

    def _learn(self, name: str, n: int, touches: Sequence[Touch]) -> None:
        samples = self._samples(name, n, touches)
        if not isinstance(self.source, Pressable) and name in self.counts:
            self._count(name, [sample.frame for sample in samples])
        # Samples join the latest recalibration of their class: they are of today, too.
        place = max((i for i, x in enumerate(self._lessons) if name in x.labels), default=0)
        lessons = list(self._lessons)
        lessons[place] = replace(lessons[place], samples=lessons[place].samples + samples)
        self._train(lessons)
        if isinstance(self.source, Pressable):
            self.places = self.places | {name: tuple(touches)}

    def recalibrate(
        self, names: Sequence[str], n: int, p: float, method: str, touches: Sequence[Touch] | None
    ) -> None:
        """Recalibrate classes by n new samples of each.

        Args:
            names: the classes.
            n: samples of each.
            p, method: see :meth:`hdc.HDCClassifier.recalibrate`.
            touches: the present ones; None: each class is touched where it was taught.
        """
        if len(self.counts) < 2:
            raise ValueError("There is nothing to recalibrate yet: teach two classes first.")
        samples: tuple[Sample, ...] = ()
        for name in names:
            self._check_known(name)
            if touches is None and name not in self.places:
                raise ValueError(f"The place of “{name}” is not known: recalibrate it in its row.")
            place = self.places[name] if touches is None else touches
            samples += self._samples(name, n, place)
        self._train([*self._lessons, Lesson(samples, p, method)])
        self._tests.clear()

    def forget(self, name: str | None) -> None:
        """Forget a class, or (None) all of them."""
        if name is None:
            self._file, self.places = None, {}
            self._train([Lesson()])
        else:
            self._check_known(name)
            if self._file:
                raise ValueError("A loaded model has no frames: it forgets everything or nothing.")
            kept = [tuple(s for s in x.samples if s.label != name) for x in self._lessons]
            left = [replace(x, samples=s) for x, s in zip(self._lessons, kept, strict=True)]
            self._train([left[0], *(lesson for lesson in left[1:] if lesson.samples)])
            self.places = {n: place for n, place in self.places.items() if n != name}
        self._tests.clear()

    def use(self, readout: str) -> None:
        """Switch the read-out, trained on the same frames."""
        if self._file and readout != self.readout:
            raise ValueError("A loaded model has no frames to train another read-out with.")
        self._train(self._lessons, readout)
        self._tests.clear()

    def drift(self, kelvin: float) -> None:
        """Set the drift of a sensor that can be pressed."""
        if isinstance(self.source, Pressable):
            self.source.offset = within(kelvin, 0.0, self.source.most)
            self._tests.clear()

    def _samples(self, name: str, n: int, touches: Sequence[Touch]) -> tuple[Sample, ...]:
        if n + sum(len(lesson.samples) for lesson in self._lessons) > MOST_SAMPLES:
            raise ValueError(
                f"The page keeps {MOST_SAMPLES} samples: forget a class, or everything."
            )
        value: tuple[float, ...] | None = None
        if isinstance(self.source, Pressable):
            if len(touches) == 1:
                value = 1e3 * touches[0].x, 1e3 * touches[0].y
        elif number := re.fullmatch(r"([-+]?\d+(?:\.\d+)?)\s*(\D*)", name):
            value, self.unit = (float(number[1]),), number[2]
        return tuple(Sample(frame, name, value) for frame in self.source.samples(n, touches))

    def _check_known(self, name: str) -> None:
        if name not in self.counts:
            raise ValueError(f"There is no class “{name}” any more.")

    def _train(self, lessons: Sequence[Lesson], readout: str | None = None) -> None:
        """Train on these lessons and keep them; where that raises, nothing changes."""
        readout, first = readout or self.readout, lessons[0]
        parameters: dict[str, Any] = {"readout": readout} if len(READOUTS) > 1 else {}
        model = None if self._file is None else _read(self._file)
        counts = {} if model is None else dict(zip(*_classes(model), strict=True))
        if model is None and len(set(first.labels)) > 1:
            model = HDCClassifier(**parameters).fit(first.frames, first.labels)
        elif first.samples:  # a single class has no read-out yet, but a prototype to show
            model = (model or HDCClassifier()).partial_fit(first.frames, first.labels)
        for seed, x in enumerate(lessons[1:]):
            assert model is not None
            model.recalibrate(x.frames, x.labels, x.p, seed=seed, method=x.method)
        samples = [sample for lesson in lessons for sample in lesson.samples]
        self._regressor = self._fitted_to_values(samples)
        self._lessons, self.model, self.readout = tuple(lessons), model, readout
        taught = Counter(sample.label for sample in samples)
        self.counts = {n: counts.get(n, 0) + taught[n] for n in [*counts, *taught]}
        self.version += 1

    def _fitted_to_values(self, samples: Sequence[Sample]) -> Any:
        """A regressor of the samples' values; None where they have fewer than two."""
        known = [sample for sample in samples if sample.value is not None]
        if not isinstance(self.source, Pressable) and len(known) < len(samples):
            return None  # names, not numbers
        if not HAS_VALUES or len({sample.value for sample in known}) < 2:
            return None
        library: Any = hdc
        values = np.array([sample.value for sample in known])
        return library.HDCRegressor().fit(Lesson(tuple(known)).frames, values)

    # Files ---------------------------------------------------------------------------------------

    def saved(self) -> bytes:
        """The model as a file of :meth:`hdc.HDCClassifier.save`, with the places as metadata."""
        if len(self.counts) < 2:
            raise ValueError("There is nothing to save yet: teach two classes first.")
        places = {n: [[t.x, t.y, t.depth] for t in place] for n, place in self.places.items()}
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "model.safetensors"
            self.model.save(path, self.source.metadata | ({"places": places} if places else {}))
            return path.read_bytes()

    def load(self, content: bytes) -> None:
        """Go on with the model of such a file."""
        try:
            model = _read(content)
            shape, (names, _) = model.frame_shape_, _classes(model)
            # A file may load and still fail to predict: find out before all pages depend on it.
            _answer(model, np.arange(model.dimension_).reshape(shape))
        except Exception as error:
            reason = (str(error).splitlines() or [repr(error)])[0][:200]
            raise ValueError(f"This file is no model that can be used: {reason}") from None
        if shape != self.source.shape:
            size, here = (" × ".join(map(str, x)) for x in (shape, self.source.shape))
            raise ValueError(f"This model is of frames of {size} pixels; here they have {here}.")
        if len(names) > MOST_CLASSES or not all(map(_is_name, names)):
            raise ValueError(
                f"The page shows up to {MOST_CLASSES} classes with names of 1 to {MOST_LETTERS} "
                f"letters; this model has {len(names)}: {', '.join(map(repr, names))[:100]}"
            )
        self._file = content
        self._train([Lesson()], model.get_params().get("readout", "prototype"))
        self.places = _places(model.metadata_.get("places"), names)
        self._tests.clear()


def _answer(model: Any, frame: np.ndarray) -> Answer:
    distances = (model.distances(frame[None])[0] / model.dimension_).tolist()
    try:
        label = model.predict(frame[None], reject=True)[0]
    except ValueError:  # too few samples to tell an outlier
        label = model.predict(frame[None])[0]
    likely = tuple(model.predict_set(frame[None], ALPHA)[0]) if HAS_SETS else None
    return Answer(label, likely, dict(zip(model.classes_.tolist(), distances, strict=True)))


def _classes(model: HDCClassifier) -> tuple[list[str], list[int]]:
    """Names of the classes, and their numbers of samples."""
    return model.classes_.tolist(), model.counts_.tolist()


def _read(content: bytes) -> HDCClassifier:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "model"
        path.write_bytes(content)
        try:
            return HDCClassifier.load(path)
        except ValueError as error:
            raise ValueError(str(error).removeprefix(f"{path}: ")) from None


def _places(saved: Any, names: Sequence[str]) -> dict[str, tuple[Touch, ...]]:
    """Places in a model's metadata, as :meth:`Session.saved` writes them; none if they differ."""
    try:
        places = {n: tuple(Touch(*map(float, t)) for t in saved[n]) for n in saved}
    except (TypeError, ValueError, KeyError, IndexError):
        return {}
    finite = np.isfinite([(t.x, t.y, t.depth) for place in places.values() for t in place]).all()
    return places if finite and set(places) <= set(names) else {}


def within(value: Any, low: float, high: float) -> float:
    """A number from a browser, clipped to [low, high]; low for anything that is no number."""
    try:
        number = float(value)
    except (TypeError, ValueError):
        return low
    return min(max(number, low), high) if number == number else low


def _is_name(name: object) -> bool:
    return isinstance(name, str) and 0 < len(name.strip()) <= MOST_LETTERS and name.isprintable()
