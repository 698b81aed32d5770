"""A recording: the settings that open it, its labels, values and frames, of any kind of file."""

from __future__ import annotations

import hashlib
import importlib.util
import math
import sys
from collections import deque
from collections.abc import Callable, Generator, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cache
from itertools import islice
from pathlib import Path
from typing import Any, NamedTuple, Self, TypeVar

import numpy as np

from hdc.readers.about import About, Columns, grouped
from hdc.readers.files import BadFrame, SettingError, wrong

T = TypeVar("T")


@dataclass(frozen=True)
class Window:
    """Pixels of an image that are kept: a crop (x, y, width, height), then every n-th of it.

    A frame that is a vector [D] has no crop; every n-th of its numbers is kept. With an `image`
    (H, W), images of another size are refused.
    """

    crop: Sequence[int] | None = None
    subsample: int = 1
    image: tuple[int, ...] | None = None

    def __post_init__(self) -> None:
        if self.crop is not None:
            crop = tuple(self.crop)
            whole = all(isinstance(n, int | np.integer) for n in crop)
            if len(crop) != 4 or not whole or min(crop) < 0 or min(crop[2:]) < 1:
                expected = "null or [x, y, width, height], integers ≥ 0 and sizes ≥ 1"
                raise wrong("crop", self.crop, expected)
            object.__setattr__(self, "crop", crop)
        if not isinstance(self.subsample, int | np.integer) or self.subsample < 1:
            raise wrong("subsample", self.subsample, "an integer ≥ 1")

    def shape(self, *sides: int) -> tuple[int, ...]:
        """(H, W) that is kept of an image [height, width], or (D,) of a vector.

        Raises:
            SettingError: the crop does not lie inside it, or is of images of another size.
        """
        return self.of(np.broadcast_to(np.uint8(0), sides)).shape

    def of(self, image: np.ndarray) -> np.ndarray:
        """A view [H, W], [H, W, channels] or [D] of the pixels that are kept; raises as above."""
        step = self.subsample
        if image.ndim == 1:
            if self.crop is not None:
                raise wrong("crop", self.crop, "null for frames that are vectors")
            return image[::step]
        height, width = image.shape[:2]
        if self.image is not None and self.image != (height, width):
            wanted = f"images {self.image[1]} px wide and {self.image[0]} px high as in training"
            raise SettingError(f"crop: expected {wanted}, found {width} × {height}")
        x, y, w, h = self.crop or (0, 0, width, height)
        if x + w > width or y + h > height:
            wanted = f"a window inside frames {width} px wide and {height} px high"
            raise wrong("crop", [x, y, w, h], wanted)
        return image[y : y + h : step, x : x + w : step]


class Asked(NamedTuple):
    """Settings of a recording, as every reader takes them; see :func:`hdc.readers.open_recording`.

    Attributes:
        window: pixels that are kept.
        table: a CSV.
        values: names of the columns or arrays that are values.
        labels, sessions, groups: names of the columns or arrays that are these.
        dataset: name of the array of frames; "" where the file has one that can be.
    """

    window: Window
    labels: str | None = None
    table: Path | None = None
    values: Sequence[str] = ()
    sessions: str | None = None
    groups: str | None = None
    fewest_classes: int = 2
    axes: Sequence[str] | None = None
    dataset: str = ""
    template: str | None = None
    image_column: str = "image"

    def of_part(self, dataset: str = "") -> Asked:
        """The same of one of several files or arrays, which may have neither labels nor values."""
        own = self._replace(template=None, sessions=None, groups=None, values=())
        return own._replace(fewest_classes=0, dataset=dataset)


@dataclass(frozen=True, kw_only=True)
class Recording(About):
    """N frames, decoded when asked for; indexed as an array [N, H, W] or [N, D].

    Attributes:
        frame_shape: (H, W) of one frame in pixels, or (D,) of one vector.
        dtype: of the frames' pixels.
        other_files: names of files that are no frames of the recording.
        features: names of the D numbers of a vector, where a table gives them.
        notes: how it was read where a file could be read otherwise, a phrase each.
        each: frames [H, W] of indices [n], one after the other, decoded ahead of the caller.
        place: file of a frame, or its place in one, for messages.
        digest: gives that of the recorded bytes, in their order.
        window: pixels that are kept.
        image_shape: (H, W) of an image before that; empty of a video.
        statements: all that the file says of the frames.
        is_decoded: whether frames are decoded each time, so that it is worth to keep them.
    """

    frame_shape: tuple[int, ...]
    dtype: np.dtype[Any]
    each: Callable[[np.ndarray], Iterator[np.ndarray]]
    place: Callable[[int], str]
    digest: Callable[[], str]
    window: Window
    other_files: tuple[str, ...] = ()
    features: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    image_shape: tuple[int, ...] = ()
    statements: Columns
    is_decoded: bool = False

    @classmethod
    def of(
        cls,
        columns: Columns,
        frames: Any,
        asked: Asked,
        digest: Callable[[], str],
        *,
        parts: np.ndarray | None = None,
        notes: Sequence[str] = (),
        **settings: Any,
    ) -> Self:
        """The recording of N frames and what their file says of them.

        Args:
            columns: of the frames.
            frames: have ``shape``, ``dtype``, ``each`` and ``place``.
            asked: names labels, values, sessions and groups, and how many classes there have to be.
            digest: see the class.
            parts: the file or the interval of each frame [N], where frames of one belong together.
            notes: how the file was read.
            settings: other attributes.
        """
        known = columns.known_as(
            label=asked.labels, session=asked.sessions, group=asked.groups
        )
        about = known.about(asked.values, asked.fewest_classes)
        if parts is not None:
            about, split = grouped(about, parts)
            notes = (*notes, *split)
        return cls(
            **vars(about),
            frame_shape=frames.shape,
            dtype=frames.dtype,
            each=frames.each,
            place=frames.place,
            digest=cache(digest),
            window=asked.window,
            notes=tuple(notes),
            statements=columns,
            **settings,
        )

    def __len__(self) -> int:
        return len(self.samples["order"])

    @property
    def shape(self) -> tuple[int, ...]:
        """(N, H, W) or (N, D)."""
        return (len(self), *self.frame_shape)

    def kept(self, memory_bytes: int) -> Self:
        """The same with all frames decoded, so that damage is found, and kept if they fit."""
        shown = with_progress(self.stream(), len(self), "Reading frames")
        if math.prod(self.shape) * self.dtype.itemsize > memory_bytes:
            deque(shown, maxlen=0)
            return self
        frames = [*shown]
        return replace(self, each=lambda index: (frames[i] for i in index))

    def __getitem__(self, index: Any) -> np.ndarray:
        """A frame of an integer; frames [n, H, W] of a slice, of integers or of a mask [N].

        Raises:
            IndexError: an index is outside [-N, N), a mask is not of N, or it is of another kind.
            BadFrame: a frame cannot be used.
        """
        rows = np.arange(len(self))[index]
        found = self.frames(np.ravel(rows))
        return found if np.ndim(rows) else found[0]

    @property
    def names(self) -> list[str]:
        """Name of the class of each frame."""
        if self.labels is None:
            raise ValueError(
                "labels: expected a recording with labels, found values only"
            )
        return [self.classes[c] for c in self.labels]

    @property
    def order(self) -> np.ndarray:
        """Place in time [N]."""
        return self.samples["order"]

    @property
    def session(self) -> np.ndarray | None:
        """Session of each frame [N], if known."""
        return self.samples.get("session")

    @property
    def group(self) -> np.ndarray | None:
        """Group of frames that belong together (an object, a run) [N], if known."""
        return self.samples.get("group")

    def frames(self, indices: Sequence[int] | np.ndarray) -> np.ndarray:
        """Frames [len(indices), H, W] or [len(indices), D].

        Raises:
            IndexError: an index is outside [0, N), or no integer.
            BadFrame: a frame cannot be used.
        """
        frames = [*self.stream(indices)]
        empty = np.empty((0, *self.frame_shape), self.dtype)
        return np.stack(frames) if frames else empty

    def stream(
        self, indices: Sequence[int] | np.ndarray | None = None
    ) -> Iterator[np.ndarray]:
        """:meth:`frames` [H, W] of the given indices (default: all), one after the other."""
        n = len(self)
        index = np.arange(n) if indices is None else np.ravel(indices)
        whole = index.dtype.kind in "iu"
        if len(index) and not (whole and 0 <= index.min() <= index.max() < n):
            raise IndexError(f"indices: expected values in [0, {n}), found {index}")
        return self.each(index.astype(np.int64))

    def batches(self, indices: np.ndarray) -> Batches:
        """Frames of the given indices for a model, which takes them batch by batch, once."""
        return Batches(self, indices)

    def left_out(self) -> str:
        """One line on the files that are no frames, with the first three names; or nothing."""
        if not self.other_files:
            return ""
        more = ["…"] if len(self.other_files) > 3 else []
        shown = ", ".join([*self.other_files[:3], *more])
        return f"left out {len(self.other_files)} other files: {shown}"

    def fingerprint(self) -> str:
        """SHA-256 over the recorded bytes, the pixels kept of them, labels, values and order."""
        window = (self.window.crop, self.window.subsample)
        kept = (self.digest(), window, self.classes)
        digest = hashlib.sha256(repr(kept).encode())
        if self.labels is not None:
            digest.update(self.labels.astype("<i8").tobytes())
        digest.update(repr(self.order.tolist()).encode())
        if self.values is not None:
            values = (self.value_names, self.values.tolist())
            digest.update(repr(values).encode())
        return digest.hexdigest()


class Batches:
    """Frames [N, H, W] of a recording, decoded as a model asks for one batch after the other.

    A batch lies where the one before it lay: fresh memory for each took a quarter of the time.
    They are read once, from the first to the last.
    """

    def __init__(self, recording: Recording, index: np.ndarray) -> None:
        self._frames = with_progress(recording.stream(index), len(index), "Training")
        self.shape = (len(index), *recording.frame_shape)
        self._batch = np.empty(0, recording.dtype)
        self._given = 0

    def __len__(self) -> int:
        return self.shape[0]

    def __getitem__(self, batch: slice) -> np.ndarray:
        start, stop, step = batch.indices(len(self))
        if (start, step) != (self._given, 1):
            raise ValueError(
                f"batch: expected one from frame {self._given}, each frame once, found {batch}"
            )
        self._given = stop
        if not len(self._batch):
            self._batch = np.empty((stop - start, *self.shape[1:]), self._batch.dtype)
        for k, frame in enumerate(islice(self._frames, stop - start)):
            self._batch[k] = frame
        return self._batch[: stop - start]


def in_any_order(
    index: np.ndarray, ordered: Callable[[np.ndarray], Iterator[np.ndarray]]
) -> Iterator[np.ndarray]:
    """Frames of indices in any order; `ordered` gives the frames of increasing indices."""
    increasing = np.unique(index)
    frames = ordered(increasing)
    if np.array_equal(increasing, index):
        return frames
    found = dict(zip(increasing.tolist(), frames, strict=True))
    return (found[i] for i in index.tolist())


def check_finite(place: str, frame: np.ndarray) -> np.ndarray:
    """The frame.

    Raises:
        BadFrame: a pixel of it is not finite.
    """
    if frame.dtype.kind == "f" and not np.isfinite(frame).all():
        raise BadFrame(f"{place}: expected finite numbers, found nan or infinity")
    return frame


def with_progress(items: Iterable[T], total: int, what: str) -> Generator[T]:
    """The same items, with a bar on the terminal while there is one."""
    if not sys.stderr.isatty() or importlib.util.find_spec("rich") is None:
        yield from items
        return
    from rich.console import Console
    from rich.progress import track

    console = Console(stderr=True)
    yield from track(items, what, total=total, transient=True, console=console)
