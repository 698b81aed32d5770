"""An opened recording: its labels, values and frames, whatever kind of file they come from."""

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
from typing import Any, Self, TypeVar

import numpy as np

from hdc.readers.about import About, Columns, grouped
from hdc.readers.files import BadFrame
from hdc.readers.settings import Asked, Window

T = TypeVar("T")


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
        values: Sequence[str] | None = (),
        parts: np.ndarray | None = None,
        notes: Sequence[str] = (),
        **settings: Any,
    ) -> Self:
        """The recording of N frames and what their file says of them.

        Args:
            columns: of the frames.
            frames: have ``shape``, ``dtype``, ``each`` and ``place``.
            asked: names sessions and groups, and how many classes there have to be.
            digest: see the class.
            values: what is learnt; see :meth:`hdc.readers.about.Columns.about`, which may raise.
            parts: the file or the interval of each frame [N], where frames of one belong together.
            notes: how the file was read.
            settings: other attributes.
        """
        about = columns.known_as(asked).about(values, asked.fewest_classes)
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
