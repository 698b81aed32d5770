"""An opened recording: its labels, values and frames, whatever kind of file they come from."""

from __future__ import annotations

import hashlib
import sys
from collections.abc import Callable, Generator, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np

from hdc.readers.columns import normalised
from hdc.readers.files import BadFrame, SettingError, natural_key, require

T = TypeVar("T")


@dataclass(frozen=True)
class Window:
    """Pixels of an image that are kept: a crop (x, y, width, height), then every n-th of it.

    A frame that is a vector [D] has no crop; every n-th of its numbers is kept.
    """

    crop: Sequence[int] | None = None
    subsample: int = 1

    def __post_init__(self) -> None:
        if self.crop is not None:
            crop = tuple(self.crop)
            expected = "null or [x, y, width, height], integers ≥ 0 and sizes ≥ 1"
            require(_is_crop(crop), "crop", self.crop, expected)
            object.__setattr__(self, "crop", crop)
        whole = isinstance(self.subsample, int | np.integer) and self.subsample >= 1
        require(whole, "subsample", self.subsample, "an integer ≥ 1")

    def shape(self, *sides: int) -> tuple[int, ...]:
        """(H, W) that is kept of an image [height, width], or (D,) of a vector.

        Raises:
            SettingError: the crop does not lie inside it.
        """
        if len(sides) == 1:
            expected = "null for frames that are vectors"
            require(self.crop is None, "crop", self.crop, expected)
            return (-(-sides[0] // self.subsample),)
        height, width = sides
        x, y, w, h = self.crop or (0, 0, width, height)
        if x + w > width or y + h > height:
            wanted = f"a window inside frames {width} px wide and {height} px high"
            raise SettingError(
                f"crop: expected {wanted}, found {list(self.crop or ())}"
            )
        return -(-h // self.subsample), -(-w // self.subsample)

    def of(self, image: np.ndarray) -> np.ndarray:
        """A view [H, W], [H, W, channels] or [D] of the pixels that are kept."""
        self.shape(*image.shape[:2])
        if image.ndim == 1:
            return image[:: self.subsample]
        height, width = image.shape[:2]
        x, y, w, h = self.crop or (0, 0, width, height)
        rows = slice(y, y + h, self.subsample)
        columns = slice(x, x + w, self.subsample)
        return image[rows, columns]


def _is_crop(crop: tuple[int, ...]) -> bool:
    whole = all(isinstance(n, int | np.integer) for n in crop)
    if len(crop) != 4 or not whole:
        return False
    return min(crop) >= 0 and min(crop[2:]) >= 1


@dataclass(frozen=True)
class Recording:
    """N frames, decoded when asked for.

    Attributes:
        classes: names of the L classes; label c means ``classes[c]``.
        labels: int64 [N]; None where there are only values.
        shape: (H, W) of one frame in pixels, or (D,) of one vector.
        dtype: of the frames' pixels.
        samples: what is known of the frames before they are decoded, [N] each: ``order``
            (place in time), ``session`` and ``group`` where known, other columns of a table.
        values: float64 [N, k], the numbers to learn; None where there are none.
        value_names: their k names.
        value_units: their k units; empty where none are known.
        other_files: names of files that are no frames of the recording.
        each: frames [H, W] of indices [n], one after the other, decoded ahead of the caller.
        place: file of a frame, or its place in one, for messages.
        digest: gives that of the recorded bytes, in their order.
        window: pixels that are kept.
    """

    classes: tuple[str, ...]
    labels: np.ndarray | None
    shape: tuple[int, ...]
    dtype: np.dtype[Any]
    samples: Mapping[str, np.ndarray]
    each: Callable[[np.ndarray], Iterator[np.ndarray]]
    place: Callable[[int], str]
    digest: Callable[[], str]
    window: Window
    values: np.ndarray | None = None
    value_names: tuple[str, ...] = ()
    value_units: tuple[str, ...] = ()
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
        """Frames [len(indices), H, W] or [len(indices), D].

        Raises:
            IndexError: an index is outside [0, N).
            BadFrame: a frame cannot be used.
        """
        frames = list(self.stream(indices))
        if not frames:
            return np.empty((0, *self.shape), self.dtype)
        return np.stack(frames)

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
        n = len(self.other_files)
        if n == 0:
            return ""
        names = ", ".join(self.other_files[:most])
        if n > most:
            names += ", …"
        files = "file" if n == 1 else "files"
        return f"left out {n} other {files}: {names}"

    def fingerprint(self) -> str:
        """SHA-256 over the recorded bytes, the pixels kept of them, labels, values and order."""
        window = (self.window.crop, self.window.subsample)
        kept = (self.digest(), window, self.classes)
        digest = hashlib.sha256(repr(kept).encode())
        if self.labels is not None:
            labels = np.ascontiguousarray(self.labels, dtype="<i8")
            digest.update(labels.data)
        digest.update(repr(self.order.tolist()).encode())
        if self.values is not None:
            values = (self.value_names, self.values.tolist())
            digest.update(repr(values).encode())
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
    names = normalised(names)
    if order is None:
        classes = tuple(sorted(set(names), key=natural_key))
    else:
        classes = tuple(normalised(order))
    if len(classes) < fewest:
        found = f"only {classes[0]!r}" if classes else "none"
        raise ValueError(f"{where}: expected two classes or more, found {found}")
    if unknown := set(names) - set(classes):
        raise ValueError(
            f"{where}: expected one of the {len(classes)} classes, found {unknown}"
        )
    row_of = {name: row for row, name in enumerate(classes)}
    rows = [row_of[name] for name in names]
    return classes, np.array(rows, dtype=np.int64)


def check_times(where: object, samples: Mapping[str, np.ndarray], n: int) -> None:
    """Raise a ValueError unless ``order`` and ``session`` are N numbers: splits go by them."""
    for key in ("order", "session"):
        values = samples.get(key, np.zeros(n))
        if values.shape != (n,) or values.dtype.kind not in "iuf":
            found = f"{values.dtype} {values.shape}"
            raise ValueError(
                f"{where}: expected {n} numbers in the column {key}, found {found}"
            )
        finite = np.isfinite(values)
        if not finite.all():
            first = int(finite.argmin())
            raise ValueError(
                f"{where}: expected {n} finite numbers in the column {key}, found "
                f"{values[first]} for frame {first}"
            )


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
    if not sys.stderr.isatty():
        yield from items
        return
    from rich.console import Console
    from rich.progress import track

    console = Console(stderr=True)
    yield from track(items, what, total=total, transient=True, console=console)
