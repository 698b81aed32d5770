"""What every kind of recording opens as, and what is checked of all of them."""

from __future__ import annotations

import hashlib
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from hdc.readers.files import natural_key, shown
from hdc.readers.settings import Options, Window

T = TypeVar("T")

MOST_FRAMES = 2**20
"""Of a recording: a file of some kilobytes can announce a billion of one pixel each."""


@dataclass(frozen=True)
class Recording:
    """Frames that somebody recorded, each checked when it was opened, in any order.

    Attributes:
        classes: names of the L classes.
        labels: index into them of each frame, int64 [N].
        shape: (H, W) of a frame.
        samples: what else is known of the frames, [N] each; ``order`` is their place in time.
        read: frames [n, H, W] (uint8 or uint16) of the given indices [n].
        each: the same one after the other, made ahead of the caller; None: there is nothing to
            gain, they lie in memory or on disk.
        skipped: a line for each bad frame that was left out, naming it and the reason.
        digest: gives that of the recorded bytes that became frames, in their order, and of which
            files or frames were left out.
        window: the pixels that were kept.
    """

    classes: tuple[str, ...]
    labels: np.ndarray
    shape: tuple[int, int]
    samples: Mapping[str, np.ndarray]
    read: Callable[[np.ndarray], np.ndarray]
    digest: Callable[[], str]
    window: Window
    skipped: tuple[str, ...] = ()
    each: Callable[[np.ndarray], Iterator[np.ndarray]] | None = None

    def __len__(self) -> int:
        return len(self.labels)

    def frames(self, indices: Sequence[int] | np.ndarray) -> np.ndarray:
        """Frames uint8 or uint16 [len(indices), H, W].

        Raises:
            IndexError: an index is outside [0, N).
            BadFrame: the recording changed since it was opened.
        """
        return self.read(self._checked(indices))

    def stream(self, indices: Sequence[int] | np.ndarray | None = None) -> Iterator[np.ndarray]:
        """Frames [H, W] of the given indices (default: all), one after the other.

        Images that do not fit in memory are decoded by threads ahead of whoever takes the frames,
        as one call of :meth:`frames` for each could not.

        Raises:
            IndexError, BadFrame: see :meth:`frames`.
        """
        index = self._checked(range(len(self)) if indices is None else indices)
        each = self.each or (lambda index: (self.read(one)[0] for one in index[:, None]))
        return each(index)

    def _checked(self, indices: Sequence[int] | np.ndarray) -> np.ndarray:
        index = np.asarray(indices, dtype=np.int64).reshape(-1)
        if len(index) and not 0 <= index.min() <= index.max() < len(self):
            raise IndexError(f"indices: expected values in [0, {len(self)}), found {index}")
        return index

    def fingerprint(self) -> str:
        """SHA-256 over the recorded bytes, the pixels kept of them, labels, classes and order."""
        window = (self.window.crop, self.window.subsample)
        digest = hashlib.sha256(repr((self.digest(), window, self.classes)).encode())
        digest.update(np.ascontiguousarray(self.labels, dtype="<i8").data)
        digest.update(repr(self.samples["order"].tolist()).encode())
        return digest.hexdigest()


@dataclass(frozen=True)
class Stream:
    """Labelled frames that are read once, as they are asked for.

    Attributes:
        labels: name of the class of each frame [N].
        place: the file of a frame, or its place in one, for messages.
        each: frames [H, W] of the given indices [n], one after the other, decoded ahead of the
            caller; raises a :class:`BadFrame` at the first that cannot be used.
    """

    labels: list[str]
    place: Callable[[int], str]
    each: Callable[[np.ndarray], Iterator[np.ndarray]]


def check_number(where: object, n: int) -> None:
    """Raises a ValueError if a recording has more than :data:`MOST_FRAMES` frames."""
    if n > MOST_FRAMES:
        raise ValueError(f"{shown(where)}: expected at most {MOST_FRAMES} frames, found {n}")


def check_times(where: object, samples: Mapping[str, np.ndarray], n: int) -> None:
    """Raises a ValueError unless ``order`` and ``session``, by which samples are split, are N
    numbers."""
    for key in ("order", "session"):
        values = samples.get(key, np.zeros(n))
        if values.shape != (n,) or values.dtype.kind not in "iuf" or not np.isfinite(values).all():
            raise ValueError(
                f"{shown(where)}: expected {n} numbers in the column {key}, found others "
                f"({values.dtype} {values.shape})"
            )


def class_indices(
    names: Sequence[str], where: object, options: Options, order: Sequence[str] | None = None
) -> tuple[tuple[str, ...], np.ndarray]:
    """Class names in natural order (or the given one), and the index of each sample's [N].

    Raises:
        ValueError: fewer classes than are needed.
    """
    classes = tuple(order) if order is not None else tuple(sorted(set(names), key=natural_key))
    if len(classes) < options.fewest_classes:
        found = f"only {shown(classes[0])!r}" if classes else "none"
        raise ValueError(f"{shown(where)}: expected two classes or more, found {found}")
    index = {name: c for c, name in enumerate(classes)}
    return classes, np.array([index[name] for name in names], dtype=np.int64)


def in_memory(frames: np.ndarray) -> Callable[[np.ndarray], np.ndarray]:
    """``read`` of frames [N, H, W] that lie in memory or are mapped into it."""
    return lambda index: np.ascontiguousarray(frames[index])


def stacked(
    each: Callable[[np.ndarray], Iterator[np.ndarray]], shape: tuple[int, int], dtype: np.dtype
) -> Callable[[np.ndarray], np.ndarray]:
    """``read`` of frames that come one after the other."""

    def read(index: np.ndarray) -> np.ndarray:
        out = np.empty((len(index), *shape), dtype)
        for frame, pixels in zip(out, each(index), strict=True):
            frame[...] = pixels
        return out

    return read


def with_progress(items: Iterable[T], total: int, what: str) -> Iterator[T]:
    """The same items, with a bar on the terminal while there is one."""
    if not sys.stderr.isatty():
        yield from items
        return
    from rich.console import Console
    from rich.progress import track

    yield from track(items, what, total=total, transient=True, console=Console(stderr=True))
