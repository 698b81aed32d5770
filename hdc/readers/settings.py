"""Settings that all readers share, checked: which pixels are kept, and what reading may cost."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

_MOST_THREADS = 256


class SettingError(ValueError):
    """A setting that cannot be, as ``name: expected …, found …``; its name is a parameter's.

    Whoever gives settings other names puts theirs before it: ``crop``, ``--crop``.
    """


def require(condition: bool, name: str, found: Any, expected: str) -> None:
    """Raise a :class:`SettingError` unless the condition holds."""
    if not condition:
        raise SettingError(f"{name}: expected {expected}, found {found!r}")


def require_integer(name: str, value: Any, low: int) -> None:
    """Raise a :class:`SettingError` unless the value is an integer ≥ low."""
    require(_is_integer(value) and value >= low, name, value, f"an integer ≥ {low}")


def _is_integer(value: object) -> bool:
    return isinstance(value, int | np.integer) and not isinstance(value, bool)


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
            whole = len(crop) == 4 and all(_is_integer(v) for v in crop)
            require(
                whole and min(crop) >= 0 and min(crop[2:]) >= 1,
                "crop",
                self.crop,
                "null or [x, y, width, height], integers ≥ 0 and sizes ≥ 1",
            )
            object.__setattr__(self, "crop", crop)
        require_integer("subsample", self.subsample, 1)

    def shape(self, height: int, width: int) -> tuple[int, int]:
        """(H, W) of what is kept of an image of that size.

        Raises:
            SettingError: the crop does not lie inside it.
        """
        x, y, w, h = self.crop or (0, 0, width, height)
        if x + w > width or y + h > height:
            raise SettingError(
                f"crop: expected a window inside frames {width} px wide and {height} px high, "
                f"found {list(self.crop or ())}"
            )
        return (-(-h // self.subsample), -(-w // self.subsample))

    def of(self, image: np.ndarray) -> np.ndarray:
        """A view [H, W] or [H, W, channels] of the pixels that are kept."""
        self.shape(*image.shape[:2])
        x, y, w, h = self.crop or (0, 0, image.shape[1], image.shape[0])
        return image[y : y + h : self.subsample, x : x + w : self.subsample]


@dataclass(frozen=True)
class Options:
    """Settings of :func:`hdc.readers.open_recording`, checked.

    Attributes:
        fewest_classes: a recording of fewer is refused. Two, but for frames that a model which
            knows its classes is asked about.
    """

    window: Window = field(default_factory=Window)
    on_bad_frame: str = "stop"
    threads: int | None = None
    memory_bytes: int = 2**28
    max_pixels: int = 2**24
    fewest_classes: int = 2

    def __post_init__(self) -> None:
        known = self.on_bad_frame in ("stop", "skip")
        require(known, "on_bad_frame", self.on_bad_frame, "stop or skip")
        threads = self.threads
        fits = threads is None or (_is_integer(threads) and 1 <= threads <= _MOST_THREADS)
        require(fits, "threads", threads, f"null or an integer in [1, {_MOST_THREADS}]")
        require_integer("memory_bytes", self.memory_bytes, 0)
        require_integer("max_pixels", self.max_pixels, 1)

    @property
    def skip(self) -> bool:
        return self.on_bad_frame == "skip"
