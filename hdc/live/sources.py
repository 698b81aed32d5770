"""Sources of frames for the page: a camera, a recording or a video."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from hdc import readers


class Source(Protocol):
    """Frames for the page, taken by one thread."""

    title: str
    shape: tuple[int, ...]  # (H, W) of a frame
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
) -> Source:
    """A recording, else a video without labels, else a camera.

    Raises:
        ValueError: there is none, the crop does not fit its frames, or see :class:`Recorded`.
    """
    if folder is not None:
        return Recorded(folder, window)
    if video is not None:
        return Stream(f"Video {video.name}", window, lambda: _film(video, window))
    return Stream(
        f"Camera {camera}",
        window,
        lambda: readers.camera(camera, window.crop, window.subsample),
    )


def _film(path: Path, window: readers.Window) -> Iterator[np.ndarray]:
    from hdc.readers.film import stream_video

    return (frame for _, frame in stream_video(path, window))


def _kept(window: readers.Window) -> dict[str, Any]:
    """The metadata of a saved model: the pixels that are kept of a frame."""
    return {"crop": window.crop, "subsample": window.subsample}


class Stream:
    """Frames without labels; samples are the next ones.

    Args:
        title: of the page.
        window: by which the frames are cut.
        start: makes the frames; called again at their end.
    """

    label = None

    def __init__(
        self,
        title: str,
        window: readers.Window,
        start: Callable[[], Iterator[np.ndarray]],
    ) -> None:
        self.title = title
        self.metadata = _kept(window)
        self._start, self._frames = start, start()
        self.shape = self.frame().shape

    def frame(self) -> np.ndarray:
        found = next(self._frames, None)
        if found is None:
            self._frames = self._start()
            found = next(self._frames)
        return found

    def samples(self, n: int) -> list[np.ndarray]:
        return [self.frame() for _ in range(n)]


class Recorded:
    """A recording played back in its order, over and over.

    Args:
        path, window: of :func:`hdc.readers.open_recording`.

    Attributes:
        playing: False: paused.

    Raises:
        ValueError: see :func:`hdc.readers.open_recording`.
    """

    def __init__(self, path: Path, window: readers.Window) -> None:
        recording = readers.open_recording(path, window=window)
        if len(recording.frame_shape) != 2 or recording.labels is None:
            found = f"frames {recording.frame_shape}, classes {recording.classes}"
            raise ValueError(f"{path}: expected images with labels, found {found}")
        if recording.dtype not in (np.uint8, np.uint16):
            wanted = "frames of 8 or 16 bits"
            raise ValueError(f"{path}: expected {wanted}, found {recording.dtype}")
        self.title = f"Recording {path.name}"
        self.metadata = _kept(window)
        self.shape: tuple[int, ...] = recording.frame_shape
        self._recording = recording
        self._order = np.argsort(recording.samples["order"], kind="stable")
        self._labels = np.array(recording.names)[self._order]
        self._place = -1
        self.playing = True

    @property
    def label(self) -> str:
        return str(self._labels[max(0, self._place)])

    def frame(self) -> np.ndarray:
        if self.playing or self._place < 0:
            self._place = (self._place + 1) % len(self._order)
        (frame,) = self._recording.frames(self._order[[self._place]])
        return frame

    def play(self) -> None:
        """Play, or pause."""
        self.playing = not self.playing

    def samples(self, n: int) -> list[np.ndarray]:
        """The next n frames of the class that is shown, or all of them where there are fewer."""
        ahead = np.roll(np.arange(len(self._order)), -max(0, self._place) - 1)
        places = ahead[self._labels[ahead] == self.label][:n]
        self._place = int(places[-1])
        return list(self._recording.frames(self._order[places]))
