"""Where the page has its frames from: a camera, a recording, or a sensor that the page presses."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol, runtime_checkable

import numpy as np

from hdc import readers
from hdc.readers import BadFrame
from hdc.readers.files import shown

PLAYBACK = 20.0
"""Frames a second of a recording played back."""


@dataclass(frozen=True)
class Touch:
    """A finger on the sensor: position (x, y) and depth in m."""

    x: float
    y: float
    depth: float


class Source(Protocol):
    """Frames, one after the other, taken by one thread.

    Attributes:
        title: what the page calls it.
        note: one sentence about it.
        shape: (H, W) of a frame.
        metadata: what is kept with a saved model; crop and subsample, as the command has them.
    """

    title: str
    note: str
    shape: tuple[int, int]
    metadata: dict[str, Any]

    @property
    def label(self) -> str | None:
        """What is known to be seen now."""
        ...

    def frame(self) -> np.ndarray:
        """The next frame uint8 or uint16 [H, W].

        Raises:
            ValueError: there are no more.
        """
        ...

    def sample(self) -> np.ndarray:
        """A frame to learn what is seen now from."""
        ...


@runtime_checkable
class Pressable(Source, Protocol):
    """A sensor that the page presses.

    Attributes:
        length, width: of its surface in m; x in [0, length], \\|y\\| ≤ width/2.
        deepest: depth in m up to which it may be pressed.
        fibre, camera: (x, y) of where light enters and is seen.
        offset: change of temperature in K since the sensor was new.
        sixteen_days, most: what it is after 16 days, and the largest that can be set.
        touches: as they were told, last.
    """

    length: float
    width: float
    deepest: float
    fibre: tuple[float, float]
    camera: tuple[float, float]
    offset: float
    sixteen_days: float
    most: float
    touches: tuple[Touch, ...]

    def press(self, touches: Sequence[Touch], moved: bool = False) -> None:
        """Press here until told otherwise; none: nobody touches.

        Args:
            touches: where and how deep.
            moved: the fingers that press already were moved; otherwise they come anew.
        """
        ...

    def fresh(self, touches: Sequence[Touch]) -> np.ndarray:
        """A frame of another touch at these places, which misses them as a robot does."""
        ...


class Camera:
    """A camera that is connected.

    Raises:
        ValueError: there is no such camera, or the crop does not fit its frames.
    """

    label = None

    def __init__(self, index: int, window: readers.Window) -> None:
        self._frames = readers.camera(index, window.crop, window.subsample)
        self.title, self.note = f"Camera {index}", "Samples are its next frames."
        self.metadata: dict[str, Any] = {"crop": window.crop, "subsample": window.subsample}
        self.shape: tuple[int, int] = next(self._frames).shape  # type: ignore[assignment]

    def frame(self) -> np.ndarray:
        try:
            return next(self._frames)
        except StopIteration:
            raise BadFrame("camera: it gives no more frames; start the page again") from None

    sample = frame


class Recorded:
    """A recording played back in its order, over and over.

    Raises:
        ValueError: see :func:`hdc.readers.open_recording`.
    """

    def __init__(
        self, path: Path, window: readers.Window, seconds_a_frame: float = 1 / PLAYBACK
    ) -> None:
        self._recording = readers.open_recording(path, None, window.crop, window.subsample)
        self.title = f"Recording {shown(path.name)}"
        self.note = "Played back; samples are its next frames of the class that is shown."
        self.metadata: dict[str, Any] = {"crop": window.crop, "subsample": window.subsample}
        self.shape = self._recording.shape
        self._order = np.argsort(self._recording.samples["order"], kind="stable")
        self._place, self._due, self._step = -1, time.monotonic(), seconds_a_frame

    @property
    def label(self) -> str | None:
        if self._place < 0:
            return None
        row = self._order[self._place % len(self._order)]
        return self._recording.classes[self._recording.labels[row]]

    def frame(self) -> np.ndarray:
        time.sleep(max(0.0, self._due - time.monotonic()))
        self._due = time.monotonic() + self._step
        self._place = (self._place + 1) % len(self._order)
        return self._recording.frames(self._order[[self._place]])[0]

    def sample(self) -> np.ndarray:
        """The next frame of the class that is shown; after its last one, its first."""
        rows = self._order[np.roll(np.arange(len(self._order)), -self._place - 1)]
        classes = self._recording.labels
        now = classes[self._order[self._place]]
        row = rows[classes[rows] == now][0]
        self._place = int(np.flatnonzero(self._order == row)[0])
        return self._recording.frames([row])[0]
