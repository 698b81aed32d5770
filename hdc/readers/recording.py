"""An opened recording: its labels, values and frames, whatever kind of file they come from."""

from __future__ import annotations

import hashlib
import sys
from collections.abc import Callable, Generator, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from hdc.readers.files import SettingError, natural_key, require

T = TypeVar("T")


@dataclass(frozen=True)
class Window:
    """Pixels of an image that are kept: a crop (x, y, width, height), then every n-th of it."""

    crop: Sequence[int] | None = None
    subsample: int = 1

    def __post_init__(self) -> None:
        if self.crop is not None:
            crop = tuple(self.crop)
            fits = len(crop) == 4 and all(isinstance(n, int | np.integer) for n in crop)
            expected = "null or [x, y, width, height], integers ≥ 0 and sizes ≥ 1"
            require(
                fits and min(crop) >= 0 < min(crop[2:]), "crop", self.crop, expected
            )
            object.__setattr__(self, "crop", crop)
        whole = isinstance(self.subsample, int | np.integer) and self.subsample >= 1
        require(whole, "subsample", self.subsample, "an integer ≥ 1")

    def shape(self, height: int, width: int) -> tuple[int, int]:
        """(H, W) that is kept of an image of that size.

        Raises:
            SettingError: the crop does not lie inside it.
        """
        x, y, w, h = self.crop or (0, 0, width, height)
        if x + w > width or y + h > height:
            wanted = f"a window inside frames {width} px wide and {height} px high"
            raise SettingError(
                f"crop: expected {wanted}, found {list(self.crop or ())}"
            )
        return -(-h // self.subsample), -(-w // self.subsample)

    def of(self, image: np.ndarray) -> np.ndarray:
        """A view [H, W] or [H, W, channels] of the pixels that are kept."""
        self.shape(*image.shape[:2])
        x, y, w, h = self.crop or (0, 0, image.shape[1], image.shape[0])
        return image[y : y + h : self.subsample, x : x + w : self.subsample]


@dataclass(frozen=True)
class Recording:
    """N frames, decoded when asked for.

    Attributes:
        classes: names of the L classes; label c means ``classes[c]``.
        labels: int64 [N]; None where there are only values.
        shape: (H, W) of one frame in pixels.
        samples: what is known of the frames before they are decoded, [N] each: ``order``
            (place in time), ``session`` and ``group`` where known, other columns of a table.
        values: float64 [N, k], the numbers to learn; None where there are none.
        value_names: their k names.
        other_files: names of files that are no frames of the recording.
        each: frames [H, W] of indices [n], one after the other, decoded ahead of the caller.
        place: file of a frame, or its place in one, for messages.
        digest: gives that of the recorded bytes, in their order.
        window: pixels that are kept.
    """

    classes: tuple[str, ...]
    labels: np.ndarray | None
    shape: tuple[int, int]
    samples: Mapping[str, np.ndarray]
    each: Callable[[np.ndarray], Iterator[np.ndarray]]
    place: Callable[[int], str]
    digest: Callable[[], str]
    window: Window
    values: np.ndarray | None = None
    value_names: tuple[str, ...] = ()
    other_files: tuple[str, ...] = ()

    def __len__(self) -> int:
        return len(self.samples["order"])

    def __getitem__(self, index: int | slice) -> np.ndarray:
        """A frame [H, W], or the frames [n, H, W] of a slice."""
        if isinstance(index, slice):
            return self.frames(range(len(self))[index])
        return self.frames([index])[0]

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
        """Frames uint8 or uint16 [len(indices), H, W].

        Raises:
            IndexError: an index is outside [0, N).
            BadFrame: a frame cannot be used.
        """
        frames = list(self.stream(indices))
        return np.stack(frames) if frames else np.empty((0, *self.shape), np.uint8)

    def stream(
        self, indices: Sequence[int] | np.ndarray | None = None
    ) -> Iterator[np.ndarray]:
        """:meth:`frames` [H, W] of the given indices (default: all), one after the other."""
        chosen = range(len(self)) if indices is None else indices
        index = np.asarray(chosen, dtype=np.int64).reshape(-1)
        if len(index) and not 0 <= index.min() <= index.max() < len(self):
            raise IndexError(
                f"indices: expected values in [0, {len(self)}), found {index}"
            )
        return self.each(index)

    def left_out(self, most: int = 3) -> str:
        """One line on the files that are no frames, with the first names; or nothing."""
        if not (files := self.other_files):
            return ""
        names = ", ".join(files[:most]) + ", …" * (len(files) > most)
        return f"left out {len(files)} other file{'s' * (len(files) > 1)}: {names}"

    def fingerprint(self) -> str:
        """SHA-256 over the recorded bytes, the pixels kept of them, labels, values and order."""
        window = (self.window.crop, self.window.subsample)
        digest = hashlib.sha256(repr((self.digest(), window, self.classes)).encode())
        if self.labels is not None:
            digest.update(np.ascontiguousarray(self.labels, dtype="<i8").data)
        digest.update(repr(self.order.tolist()).encode())
        if self.values is not None:
            digest.update(repr((self.value_names, self.values.tolist())).encode())
        return digest.hexdigest()


def class_indices(
    names: Sequence[str],
    where: object,
    fewest: int = 2,
    order: Sequence[str] | None = None,
) -> tuple[tuple[str, ...], np.ndarray]:
    """Class names in natural order (or the given one), and the index of each sample's [N].

    Raises:
        ValueError: fewer classes than are needed, or a name that is none of those given.
    """
    classes = tuple(sorted(set(names), key=natural_key) if order is None else order)
    if len(classes) < fewest:
        found = f"only {classes[0]!r}" if classes else "none"
        raise ValueError(f"{where}: expected two classes or more, found {found}")
    if unknown := set(names) - set(classes):
        raise ValueError(
            f"{where}: expected one of the {len(classes)} classes, found {unknown}"
        )
    return classes, np.array([classes.index(name) for name in names], dtype=np.int64)


def check_times(where: object, samples: Mapping[str, np.ndarray], n: int) -> None:
    """Raise a ValueError unless ``order`` and ``session`` are N numbers: splits go by them."""
    for key in ("order", "session"):
        values = samples.get(key, np.zeros(n))
        if values.shape != (n,) or values.dtype.kind not in "iuf":
            found = f"{values.dtype} {values.shape}"
            raise ValueError(
                f"{where}: expected {n} numbers in the column {key}, found {found}"
            )


def with_progress(items: Iterable[T], total: int, what: str) -> Generator[T]:
    """The same items, with a bar on the terminal while there is one."""
    if not sys.stderr.isatty():
        yield from items
        return
    from rich.console import Console
    from rich.progress import track

    yield from track(
        items, what, total=total, transient=True, console=Console(stderr=True)
    )
