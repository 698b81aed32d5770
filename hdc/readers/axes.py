"""Which axis of an array is which."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import Any

import numpy as np

from hdc.readers.files import Ambiguous, SettingError, wrong
from hdc.readers.recording import Window, check_finite

INSIDE = ("height", "width", "channel", "feature")
"""Axes of one frame; channels are grey, or red, green and blue."""
CHANNELS = (1, 3)
_OF_FRAME = {2: ("feature",), 3: ("height", "width"), 4: ("height", "width", "channel")}
"""Axes of a frame of an array of so many axes."""


def readings(n_axes: int) -> list[tuple[str, ...]]:
    """The axes of an array, frames first, and frames last; none of an array that has no usual
    ones."""
    inside = _OF_FRAME.get(n_axes)
    return [] if inside is None else [("frame", *inside), (*inside, "frame")]


def reading(
    where: str, array: Any, n: int | None, frames_last: bool
) -> tuple[str, ...]:
    """The axes of an array: frames are first or last, whichever axis is as long as there are
    labels.

    Where nothing says how many frames there are, they are as the file's makers have them.

    Raises:
        Ambiguous: both are so long.
        SettingError: none is.
    """
    shape = tuple(array.shape)
    usual = readings(len(shape))[:: -1 if frames_last else 1]
    if n is None:
        possible = usual[:1]
    else:
        possible = [axes for axes in usual if shape[axes.index("frame")] == n]
    if not possible:
        labels = "" if n is None else f" with N = {n}, as there are labels or values"
        raise SettingError(
            f"{where}: expected shape [N, H, W] or [N, D]{labels}, found {shape} (--axes names "
            "them, as --axes feature a vector that is one frame)"
        )
    if len(possible) > 1:
        choices = [f"--axes {','.join(axes)}" for axes in readings(len(shape))]
        raise Ambiguous(f"{where} {array.dtype} {shape} for {n} labels", choices)
    return possible[0]


class Frames:
    """Frames [H, W] or [D] of an array whose axes have names, as this machine's kind of numbers.

    Args:
        place: names a frame, for errors.
        array: anything with ``shape``, ``dtype`` and ``[…]``.
        axes: ``frame``, unless the array is one, and names among :data:`INSIDE`.
        window: pixels that are kept.

    Attributes:
        size: (H, W) or (D,) before the window.
        shape, dtype: of a frame.
        n: number of frames.
    """

    def __init__(
        self,
        place: Callable[[int], str],
        array: Any,
        axes: Sequence[str],
        window: Window,
    ) -> None:
        self.place, self._array, self._axes, self._window = place, array, axes, window
        inside = [axis for axis in axes if axis != "frame"]
        ordered = tuple(axis for axis in INSIDE if axis in inside)
        self._order = [inside.index(axis) for axis in ordered]
        n_axes = len(array.shape)
        is_named = len(axes) == n_axes == len({*axes}) and len(inside) == len(ordered)
        if ordered not in (INSIDE[:2], INSIDE[:3], INSIDE[3:]) or not is_named:
            wanted = f"{n_axes} different names among frame, {', '.join(INSIDE)}"
            raise wrong("axes", [*axes], wanted)
        lengths = dict(zip(axes, array.shape, strict=True))
        if lengths.get("channel", 1) not in CHANNELS:
            # Four may be the angles of a polariser as well as RGBA.
            wanted = "1 or 3 channels (red, green and blue)"
            raise wrong("axes", lengths["channel"], wanted)
        self.n = lengths.get("frame", 1)
        self.size = tuple(lengths[axis] for axis in ordered[:2])
        self.shape = window.shape(*self.size)
        self.dtype = array.dtype.newbyteorder("=")

    def each(self, index: np.ndarray) -> Iterator[np.ndarray]:
        """Frames of indices [n], one after the other."""
        for i in index.tolist():
            key = tuple(i if axis == "frame" else slice(None) for axis in self._axes)
            place = self.place(i)
            frame = np.asarray(self._array[key]).transpose(self._order)
            if frame.ndim == 3:
                kept = _luminance(place, frame, self._window)
            else:
                kept = self._window.of(frame)
            yield check_finite(place, np.ascontiguousarray(kept, dtype=self.dtype))


def _luminance(place: str, frame: np.ndarray, window: Window) -> np.ndarray:
    """The pixels [H, W] that are kept of a frame [H, W, 1 or 3], red first."""
    from hdc.readers.images import frame_of

    blue_first = frame[..., ::-1].astype(frame.dtype.newbyteorder("="))
    return frame_of(place, blue_first, window)
