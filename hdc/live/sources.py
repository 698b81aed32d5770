"""Sources of frames for the page: a camera, a recording or a video."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from hdc import readers


class Source(Protocol):
    """Frames for the page, taken by one thread."""

    title: str
    shape: tuple[int, int]  # (H, W) of a frame
    metadata: dict[str, Any]  # kept with a saved model: crop and subsample

    @property
    def label(self) -> str | None:
        """Class of the latest frame, if it is known."""
        ...

    def frame(self) -> np.ndarray:
        """The next frame, uint8 or uint16 [H, W]; a ValueError if there are no more."""
        ...

    def samples(self, n: int) -> list[np.ndarray]:
        """Up to n different frames of the class that is seen now, to learn from."""
        ...


def open_source(
    window: readers.Window,
    folder: Path | None,
    video: Path | None,
    camera: int,
    settings: Mapping[str, Any],
) -> Source:
    """A recording opened with these settings, else a video without labels, else a camera.

    Raises:
        ValueError: see :class:`Recorded`, :class:`Film` and :class:`Camera`.
    """
    if folder is not None:
        return Recorded(folder, window, **settings)
    if video is not None:
        return Film(video, window)
    return Camera(camera, window)


def _kept(window: readers.Window) -> dict[str, Any]:
    """What is kept with a saved model of frames cut so."""
    return {"crop": window.crop, "subsample": window.subsample}


class Camera:
    """A connected camera; its samples are the next frames.

    Raises:
        ValueError: there is no such camera, or the crop does not fit its frames.
    """

    label = None

    def __init__(self, index: int, window: readers.Window) -> None:
        self._frames = readers.camera(index, window.crop, window.subsample)
        self.title = f"Camera {index}"
        self.metadata = _kept(window)
        height, width = next(self._frames).shape
        self.shape = (height, width)

    def frame(self) -> np.ndarray:
        try:
            return next(self._frames)
        except StopIteration:
            raise ValueError(
                "camera: it gives no more frames; start the page again"
            ) from None

    def samples(self, n: int) -> list[np.ndarray]:
        return [self.frame() for _ in range(n)]


class Recorded:
    """A recording played back in its order, over and over.

    Args:
        path, window, settings: of :func:`hdc.readers.open_recording`.

    Attributes:
        classes: names of the classes.
        playing: False: paused.

    Raises:
        ValueError: see :func:`hdc.readers.open_recording`.
    """

    def __init__(self, path: Path, window: readers.Window, **settings: Any) -> None:
        recording = readers.open_recording(path, window=window, **settings)
        self._recording = recording
        self.title = f"Recording {path.name}"
        self.metadata = _kept(window)
        if len(recording.frame_shape) != 2 or recording.labels is None:
            found = f"frames {recording.frame_shape}, classes {recording.classes}"
            raise ValueError(f"{path}: expected images with labels, found {found}")
        if recording.dtype not in (np.uint8, np.uint16):
            found = f"{recording.dtype}"
            raise ValueError(f"{path}: expected frames of 8 or 16 bits, found {found}")
        self.shape = recording.frame_shape[0], recording.frame_shape[1]
        self.classes = recording.classes
        self._order = np.argsort(recording.samples["order"], kind="stable")
        self._labels = recording.labels[self._order]
        self._place = -1
        self.playing = True

    @property
    def label(self) -> str:
        shown = max(0, self._place)
        return self.classes[self._labels[shown]]

    def frame(self) -> np.ndarray:
        if self.playing or self._place < 0:
            self._place = (self._place + 1) % len(self._order)
        (frame,) = self._recording.frames(self._order[[self._place]])
        return frame

    def play(self) -> None:
        """Play, or pause."""
        self.playing = not self.playing

    def step(self, frames: int) -> None:
        """Pause, this many frames ahead (or, negative, back)."""
        self.playing = False
        self._place = (self._place + frames) % len(self._order)

    def samples(self, n: int) -> list[np.ndarray]:
        """The next n frames of the class that is shown, or all of them where there are fewer."""
        shown = max(0, self._place)
        all_places = np.arange(len(self._order))
        ahead = np.roll(all_places, -shown - 1)
        same = self._labels[ahead] == self._labels[shown]
        places = ahead[same][:n]
        self._place = int(places[-1])
        return list(self._recording.frames(self._order[places]))


class Film:
    """A video without labels, over and over; its samples are the next frames.

    Raises:
        ValueError: it is no video that is read here, or the crop does not fit its frames.
    """

    label = None

    def __init__(self, path: Path, window: readers.Window) -> None:
        self._path, self._window = path, window
        self._frames = self._start()
        self.title = f"Video {path.name}"
        self.metadata = _kept(window)
        height, width = self.frame().shape
        self.shape = (height, width)

    def _start(self) -> Iterator[tuple[float, np.ndarray]]:
        from hdc.readers.film import stream_video

        return stream_video(self._path, self._window)

    def frame(self) -> np.ndarray:
        found = next(self._frames, None)
        if found is None:
            self._frames = self._start()
            found = next(self._frames)
        _, frame = found
        return frame

    def samples(self, n: int) -> list[np.ndarray]:
        return [self.frame() for _ in range(n)]
