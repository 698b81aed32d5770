"""Which axis of an array is which."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from hdc.readers.files import Ambiguous, SettingError, require
from hdc.readers.recording import Window, check_finite

ALONG = ("label", "order", "session", "group", "value", "frame")
"""Axes of an array whose places say something of a frame; ``frame`` says its number only."""
INSIDE = ("height", "width", "channel", "feature")
"""Axes of one frame; channels are grey, or red, green and blue."""
CHANNELS = (1, 3)
_COLOURS, _SEVERAL = "frame,channel,height,width", "frame,order,height,width"
"""Readings of three planes a label: channels of one frame, or frames."""
READINGS = {
    2: ("frame,feature", "feature,frame"),
    3: ("frame,height,width", "height,width,frame"),
    4: (
        "frame,height,width,channel",
        _COLOURS,
        "height,width,channel,frame",
    ),
}


def reading(where: str, array: Any, n: int | None, frames_last: bool) -> list[str]:
    """The reading of an array's axes that its shape and the number of labels leave.

    Raises:
        Ambiguous: two are left, or planes [N, 3, H, W] of floats may be colours or frames.
        SettingError: none is left.
    """
    shape = array.shape
    possible = _possible(shape, n, frames_last)
    if not possible:
        wanted = "shape [N, H, W] or [N, D]"
        if n is not None:
            wanted += f" with N = {n}, as there are labels or values"
        raise SettingError(
            f"{where}: expected {wanted}, found {tuple(shape)} (--axes names them)"
        )
    if _COLOURS in possible and shape[1] > 1 and array.dtype.kind == "f":
        possible.append(_SEVERAL)
    if len(possible) > 1:
        labels = "" if n is None else f" for {n} labels"
        choices = [f"--axes {reading}" for reading in possible]
        found = f"{array.dtype} {tuple(shape)}"
        raise Ambiguous(f"{where} {found}{labels}", choices)
    return possible[0].split(",")


def _possible(shape: Sequence[int], n: int | None, frames_last: bool) -> list[str]:
    """Readings of a shape for so many frames; where nothing says how many, the usual one."""
    fitting = [axes for axes in READINGS.get(len(shape), ()) if _fits(axes, shape)]
    if n is not None:
        return [axes for axes in fitting if _frames_of(axes, shape) == n]
    return fitting[-1:] if frames_last else fitting[:1]


def _frames_of(reading: str, shape: Sequence[int]) -> int:
    return shape[reading.split(",").index("frame")]


def _fits(reading: str, shape: Sequence[int]) -> bool:
    axes = reading.split(",")
    return "channel" not in axes or shape[axes.index("channel")] in CHANNELS


class Frames:
    """Frames [H, W] or [D] of an array whose axes have names, as this machine's kind of numbers.

    Attributes:
        shape: (H, W) or (D,) before the window.
        whole: of the array.
        counts: lengths of the axes along the frames.
    """

    def __init__(
        self, path: Path, array: Any, axes: Sequence[str], window: Window
    ) -> None:
        self._path, self._array, self._window = path, array, window
        self._along = [k for k, axis in enumerate(axes) if axis in ALONG]
        inside = [axis for axis in axes if axis in INSIDE]
        self._order = [inside.index(axis) for axis in INSIDE if axis in inside]
        self._check(axes, inside)
        self.whole = tuple(array.shape)
        self.counts = [array.shape[k] for k in self._along]
        lengths = dict(zip(axes, array.shape, strict=True))
        channels = lengths.get("channel", 1)
        # Four may be the angles of a polariser as well as RGBA.
        wanted = "1 or 3 channels (red, green and blue)"
        require(channels in CHANNELS, "axes", channels, wanted)
        self._has_channels = "channel" in inside
        self.shape = [lengths[axis] for axis in INSIDE if axis in inside][:2]
        self.dtype = array.dtype.newbyteorder("=")

    def _check(self, axes: Sequence[str], inside: Sequence[str]) -> None:
        image = {"height", "width"}
        fits = (
            len(axes) == len(self._array.shape) == len({*axes})
            and len(self._along) + len(inside) == len(axes)
            and len(self._along) > 0
            and set(inside) in (image, image | {"channel"}, {"feature"})
        )
        if not fits:
            n = len(self._array.shape)
            wanted = (
                f"{n} different names among {', '.join(ALONG)}, then height and width"
            )
            raise SettingError(f"axes: expected {wanted}, found {list(axes)}")

    def __len__(self) -> int:
        return math.prod(self.counts)

    def place(self, i: int) -> str:
        return f"{self._path}, frame {i}" if len(self) > 1 else str(self._path)

    def each(self, index: np.ndarray) -> Iterator[np.ndarray]:
        for i in index:
            place, frame = self.place(i), self._frame(i)
            if self._has_channels:
                kept = _luminance(place, frame, self._window)
            else:
                kept = self._window.of(frame)
            yield check_finite(place, np.ascontiguousarray(kept, dtype=self.dtype))

    def _frame(self, i: int) -> np.ndarray:
        key: list[Any] = [slice(None)] * len(self._array.shape)
        places = np.unravel_index(i, self.counts)
        for axis, place in zip(self._along, places, strict=True):
            key[axis] = int(place)
        frame = np.asarray(self._array[tuple(key)])
        return frame.transpose(self._order)


def _luminance(place: str, frame: np.ndarray, window: Window) -> np.ndarray:
    """The pixels [H, W] that are kept of a frame [H, W, 1 or 3], red first."""
    from hdc.readers.images import frame_of

    blue_first = frame[..., ::-1].astype(frame.dtype.newbyteorder("="))
    return frame_of(place, blue_first, window)
