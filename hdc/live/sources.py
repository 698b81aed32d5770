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

    def frame(self) -> np.ndarray:
        """The next frame, uint8 or uint16 [H, W]; a ValueError if there are no more."""
        ...

    def samples(self, n: int) -> list[np.ndarray]:
        """Up to n different frames of what is seen now, to learn from."""
        ...


def open_source(
    window: readers.Window,
    folder: Path | None,
    video: Path | None,
    camera: int,
) -> Source:
    """A recording or a video, over and over, or else a camera.

    Raises:
        ValueError: there is none, the crop does not fit its frames, or they are no images.
    """
    if folder is not None:
        recording = readers.open_recording(folder, window=window, fewest_classes=0)
        in_time = np.argsort(recording.order, kind="stable")
        return Stream(
            f"Recording {folder.name}", window, lambda: recording.stream(in_time)
        )
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


class Stream:
    """Frames one after the other; samples are the next ones.

    Args:
        title: of the page.
        window: by which the frames are cut.
        start: makes the frames; called again at their end.

    Raises:
        ValueError: the first frame is no image of 8 or 16 bits.
    """

    def __init__(
        self,
        title: str,
        window: readers.Window,
        start: Callable[[], Iterator[np.ndarray]],
    ) -> None:
        self.title = title
        self.metadata = {"crop": window.crop, "subsample": window.subsample}
        self._start, self._frames = start, start()
        first = self.frame()
        self.shape = first.shape
        if first.ndim != 2 or first.dtype not in (np.uint8, np.uint16):
            found = f"{first.dtype} {first.shape}"
            raise ValueError(f"{title}: expected images of 8 or 16 bits, found {found}")

    def frame(self) -> np.ndarray:
        found = next(self._frames, None)
        if found is None:
            self._frames = self._start()
            found = next(self._frames)
        return found

    def samples(self, n: int) -> list[np.ndarray]:
        return [self.frame() for _ in range(n)]
