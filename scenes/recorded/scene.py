"""The scene that every kind of recording opens as, and the settings that they share."""

from __future__ import annotations

import hashlib
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TypeVar

import numpy as np
import torch
from torch import Tensor

from scenes.recorded.files import natural_key, shown

T = TypeVar("T")

MOST_FRAMES = 2**20
"""Of a recording: a file of some kilobytes can announce a billion of one pixel each."""
_MOST_THREADS = 256


@dataclass(frozen=True)
class Window:
    """Which pixels of an image are kept: a crop (x, y, width, height), then every n-th of it."""

    crop: Sequence[int] | None = None
    subsample: int = 1

    def __post_init__(self) -> None:
        if self.crop is not None:
            try:
                crop = tuple(self.crop)
            except TypeError:
                crop = ()
            whole = len(crop) == 4 and all(_is_int(v) for v in crop)
            if not whole or min(crop) < 0 or min(crop[2:]) < 1:
                raise ValueError(
                    "scene.crop: expected null or [x, y, width, height], integers ≥ 0 and sizes "
                    f"≥ 1, found {self.crop!r}"
                )
            object.__setattr__(self, "crop", crop)
        if not _is_int(self.subsample) or self.subsample < 1:
            raise ValueError(f"scene.subsample: expected an integer ≥ 1, found {self.subsample!r}")

    def shape(self, height: int, width: int) -> tuple[int, int]:
        """(H, W) of what is kept of an image of that size.

        Raises:
            ValueError: the crop does not lie inside it.
        """
        x, y, w, h = self.crop or (0, 0, width, height)
        if x + w > width or y + h > height:
            raise ValueError(
                f"scene.crop: expected a window inside frames {width} px wide and {height} px "
                f"high, found {list(self.crop or ())}"
            )
        return (-(-h // self.subsample), -(-w // self.subsample))

    def of(self, image: np.ndarray) -> np.ndarray:
        """A view [H, W] or [H, W, channels] of the pixels that are kept."""
        self.shape(*image.shape[:2])
        x, y, w, h = self.crop or (0, 0, image.shape[1], image.shape[0])
        return image[y : y + h : self.subsample, x : x + w : self.subsample]


@dataclass(frozen=True)
class Options:
    """Settings of :func:`scenes.recorded.open_recording`, checked."""

    window: Window = field(default_factory=Window)
    on_bad_frame: str = "stop"
    threads: int | None = None
    memory_bytes: int = 2**28
    max_pixels: int = 2**24

    def __post_init__(self) -> None:
        if self.on_bad_frame not in ("stop", "skip"):
            raise ValueError(
                f"scene.on_bad_frame: expected stop or skip, found {self.on_bad_frame!r}"
            )
        if self.threads is not None and not (
            _is_int(self.threads) and 1 <= self.threads <= _MOST_THREADS
        ):
            raise ValueError(
                f"scene.threads: expected null or an integer ≥ 1, at most {_MOST_THREADS}, "
                f"found {self.threads!r}"
            )
        for name, value, least in (
            ("memory_bytes", self.memory_bytes, 0),
            ("max_pixels", self.max_pixels, 1),
        ):
            if not _is_int(value) or value < least:
                raise ValueError(f"scene.{name}: expected an integer ≥ {least}, found {value!r}")

    @property
    def skip(self) -> bool:
        return self.on_bad_frame == "skip"


@dataclass(frozen=True)
class RecordedScene:
    """Frames that somebody recorded; see :class:`scenes.frames.Scene`.

    Attributes:
        read: frames [n, H, W] (numpy, uint8 or uint16) of the given indices [n].
        skipped: a line for each bad frame that was left out, naming it and the reason.
        digest: of the recorded bytes that became frames, in their order, and of which files or
            frames were left out.
    """

    classes: tuple[str, ...]
    labels: np.ndarray
    shape: tuple[int, int]
    samples: Mapping[str, np.ndarray]
    read: Callable[[np.ndarray], np.ndarray]
    digest: str
    window: Window
    skipped: tuple[str, ...] = ()
    origin: str = "recorded"

    def __len__(self) -> int:
        return len(self.labels)

    def frames(self, indices: Sequence[int] | np.ndarray | Tensor) -> Tensor:
        """Frames uint8 or uint16 [len(indices), H, W].

        Raises:
            IndexError: an index is outside [0, N).
            BadFrame: the recording changed since it was opened.
        """
        index = np.asarray(indices, dtype=np.int64).reshape(-1)
        if len(index) and not 0 <= index.min() <= index.max() < len(self):
            raise IndexError(f"indices: expected values in [0, {len(self)}), found {index}")
        return torch.from_numpy(self.read(index))

    def fingerprint(self) -> str:
        """SHA-256 over the recorded bytes, the pixels kept of them, labels, classes and order."""
        window = (self.window.crop, self.window.subsample)
        digest = hashlib.sha256(repr((self.digest, window, self.classes)).encode())
        digest.update(np.ascontiguousarray(self.labels, dtype="<i8").data)
        digest.update(repr(self.samples["order"].tolist()).encode())
        return digest.hexdigest()


def check_number(where: object, n: int) -> None:
    """Raises a ValueError if a recording has more than :data:`MOST_FRAMES` frames."""
    if n > MOST_FRAMES:
        raise ValueError(f"{shown(where)}: expected at most {MOST_FRAMES} frames, found {n}")


def check_times(where: object, samples: Mapping[str, np.ndarray]) -> None:
    """Raises a ValueError unless ``order`` and ``session``, by which samples are split, are
    numbers."""
    for key in ("order", "session"):
        values = samples.get(key, np.zeros(0))
        if values.dtype.kind not in "iuf" or not np.isfinite(values).all():
            raise ValueError(f"{shown(where)}: expected numbers in the column {key}, found others")


def class_indices(
    names: Sequence[str], where: object, order: Sequence[str] | None = None
) -> tuple[tuple[str, ...], np.ndarray]:
    """Class names in natural order (or the given one), and the index of each sample's [N].

    Raises:
        ValueError: fewer than two classes.
    """
    classes = tuple(order) if order is not None else tuple(sorted(set(names), key=natural_key))
    if len(classes) < 2:
        found = f"only {shown(classes[0])!r}" if classes else "none"
        raise ValueError(f"{shown(where)}: expected two classes or more, found {found}")
    index = {name: c for c, name in enumerate(classes)}
    return classes, np.array([index[name] for name in names], dtype=np.int64)


def in_memory(frames: np.ndarray) -> Callable[[np.ndarray], np.ndarray]:
    """``read`` of frames [N, H, W] that lie in memory or are mapped into it."""
    return lambda index: np.ascontiguousarray(frames[index])


def with_progress(items: Iterable[T], total: int, what: str) -> Iterator[T]:
    """The same items, with a bar on the terminal while there is one."""
    if not sys.stderr.isatty():
        yield from items
        return
    from rich.console import Console
    from rich.progress import track

    yield from track(items, what, total=total, transient=True, console=Console(stderr=True))


def _is_int(value: object) -> bool:
    return isinstance(value, int | np.integer) and not isinstance(value, bool)
