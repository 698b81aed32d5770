"""Which axis of an array is which."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import Any

import numpy as np

from hdc.readers.files import Ambiguous, SettingError, wrong
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
    4: ("frame,height,width,channel", _COLOURS, "height,width,channel,frame"),
}


def reading(where: str, array: Any, n: int | None, frames_last: bool) -> list[str]:
    """The reading of an array's axes that its shape and the number of labels leave.

    Where nothing says how many frames there are, it is the usual one.

    Raises:
        Ambiguous: two are left, or planes [N, 3, H, W] of floats may be colours or frames.
        SettingError: none is left.
    """
    shape = tuple(array.shape)
    possible = []
    for axes in READINGS.get(len(shape), ()):
        lengths = dict(zip(axes.split(","), shape, strict=True))
        if lengths.get("channel", 1) in CHANNELS and n in (None, lengths["frame"]):
            possible.append(axes)
    if n is None:
        possible = possible[-1:] if frames_last else possible[:1]
    if not possible:
        labels = "" if n is None else f" with N = {n}, as there are labels or values"
        raise SettingError(
            f"{where}: expected shape [N, H, W] or [N, D]{labels}, found {shape} (--axes names "
            "them)"
        )
    if _COLOURS in possible and shape[1] > 1 and array.dtype.kind == "f":
        possible.append(_SEVERAL)
    if len(possible) > 1:
        labels = "" if n is None else f" for {n} labels"
        choices = [f"--axes {axes}" for axes in possible]
        raise Ambiguous(f"{where} {array.dtype} {shape}{labels}", choices)
    return possible[0].split(",")


class Frames:
    """Frames [H, W] or [D] of an array whose axes have names, as this machine's kind of numbers.

    Args:
        place: names a frame, for errors.
        array: anything with ``shape``, ``dtype`` and ``[…]``.
        axes: names among :data:`ALONG` and :data:`INSIDE`.
        window: pixels that are kept.

    Attributes:
        size: (H, W) or (D,) before the window.
        shape, dtype: of a frame.
        counts: lengths of the axes along the frames.
    """

    def __init__(
        self,
        place: Callable[[int], str],
        array: Any,
        axes: Sequence[str],
        window: Window,
    ) -> None:
        self.place, self._array, self._window = place, array, window
        self._along = [k for k, axis in enumerate(axes) if axis in ALONG]
        inside = [axis for axis in axes if axis in INSIDE]
        ordered = tuple(axis for axis in INSIDE if axis in inside)
        self._order = [inside.index(axis) for axis in ordered]
        n = len(array.shape)
        is_named = len(axes) == n == len({*axes}) == len(self._along) + len(inside)
        if ordered not in (INSIDE[:2], INSIDE[:3], INSIDE[3:]) or not is_named:
            wanted = (
                f"{n} different names among {', '.join(ALONG)}, then height and width"
            )
            raise wrong("axes", [*axes], wanted)
        lengths = dict(zip(axes, array.shape, strict=True))
        if lengths.get("channel", 1) not in CHANNELS:
            # Four may be the angles of a polariser as well as RGBA.
            wanted = "1 or 3 channels (red, green and blue)"
            raise wrong("axes", lengths["channel"], wanted)
        self.counts = [array.shape[k] for k in self._along]
        self.size = tuple(lengths[axis] for axis in ordered[:2])
        self.shape = window.shape(*self.size)
        self.dtype = array.dtype.newbyteorder("=")

    def each(self, index: np.ndarray) -> Iterator[np.ndarray]:
        """Frames of indices [n], one after the other."""
        for i in index:
            place, frame = self.place(i), self._frame(i)
            if frame.ndim == 3:
                kept = _luminance(place, frame, self._window)
            else:
                kept = self._window.of(frame)
            yield check_finite(place, np.ascontiguousarray(kept, dtype=self.dtype))

    def _frame(self, i: int) -> np.ndarray:
        key: list[Any] = [slice(None)] * len(self._array.shape)
        places = np.unravel_index(i, self.counts)
        for axis, place in zip(self._along, places, strict=True):
            key[axis] = int(place)
        return np.asarray(self._array[tuple(key)]).transpose(self._order)


def _luminance(place: str, frame: np.ndarray, window: Window) -> np.ndarray:
    """The pixels [H, W] that are kept of a frame [H, W, 1 or 3], red first."""
    from hdc.readers.images import frame_of

    blue_first = frame[..., ::-1].astype(frame.dtype.newbyteorder("="))
    return frame_of(place, blue_first, window)
