"""Frames of a video, decoded by PyAV (FFmpeg) from its beginning.

Times are as in the container, in seconds from its first frame, evenly spaced or not. A frame is
turned as the file says. Grey of more than 8 bits is left as it is stored, and colour of more
becomes luminance of 16. Seeking is slow, and not exact in every container, so a video is decoded
from its beginning.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import av
import numpy as np
from av.sidedata.sidedata import Type

from hdc.readers.files import BadFrame, check_file
from hdc.readers.images import grey
from hdc.readers.recording import Window, in_any_order


class Film:
    """Frames of a video that are chosen.

    Attributes:
        path: of the file.
        numbers: from 0, of the frames that are chosen.
        times: of all frames in s; known after :meth:`read`.
        shape, dtype: of a frame; known after :meth:`read` or :meth:`expect`.
    """

    def __init__(self, path: Path, window: Window) -> None:
        self.path, self._window = path, window
        self.numbers, self.times = np.arange(0), np.empty(0)
        self.shape: tuple[int, ...] = ()
        self.dtype = np.dtype(np.uint8)

    def read(self) -> None:
        """Choose all frames, which are decoded."""
        times = []
        for time, frame in stream_video(self.path, self._window):
            self.shape, self.dtype = frame.shape, frame.dtype
            times.append(time)
        self.numbers, self.times = np.arange(len(times)), np.array(times)

    def expect(self) -> None:
        """Choose all frames that the header states, or as many as there are; none is decoded but
        the first."""
        first = next(stream_video(self.path, self._window))[1]
        self.shape, self.dtype = first.shape, first.dtype
        with opened(self.path) as (_, stream):
            self.numbers = np.arange(stream.frames)
        if not len(self.numbers):
            self.read()

    def place(self, i: int) -> str:
        """The video, and the number of a frame."""
        return f"{self.path}, frame {self.numbers[i]}"

    def each(self, index: np.ndarray) -> Iterator[np.ndarray]:
        """Frames [H, W] of indices [n]; the video is decoded from its beginning."""
        return in_any_order(index, self._ordered)

    def _ordered(self, index: np.ndarray) -> Iterator[np.ndarray]:
        """Frames of these indices, which increase."""
        frames = enumerate(stream_video(self.path, self._window))
        for wanted in self.numbers[index]:
            found = (frame for number, (_, frame) in frames if number == wanted)
            frame = next(found, None)
            if frame is None:
                raise BadFrame(f"{self.path}: expected a frame {wanted}, found none")
            yield frame


def stream_video(path: Path, window: Window) -> Iterator[tuple[float, np.ndarray]]:
    """Time in s and grey frame [H, W] of each frame of a video.

    Raises:
        BadFrame: a frame is damaged, or frames are missing.
        ValueError: it is no video that is read here.
    """
    times: list[float] = []
    with opened(path) as (container, stream):
        for frame in _decoded(path, container.decode(stream)):
            if frame.time is None or frame.is_corrupt:
                raise BadFrame(
                    f"{path}: expected whole frames, found that number {len(times)} is damaged"
                )
            if times and frame.time <= times[-1]:
                found = f"frame {len(times)} at {frame.time:g} s after one at {times[-1]:g} s"
                raise BadFrame(
                    f"{path}: expected frames one after the other, found {found}"
                )
            times.append(frame.time)
            yield frame.time - times[0], grey(window.of(_pixels(path, frame)))
        if not times or len(times) < stream.frames:
            wanted = f"{stream.frames or 'some'} frames as its header says"
            raise BadFrame(f"{path}: expected {wanted}, found {len(times)}")


def _decoded(path: Path, frames: Iterator[Any]) -> Iterator[Any]:
    """The same frames; what FFmpeg logs and goes on over is damage.

    Raises:
        BadFrame: it logged an error.
    """
    av.logging.set_level(av.logging.ERROR)
    while True:
        with av.logging.Capture() as said:
            frame = next(frames, None)
        errors = [text for level, _, text in said if level <= av.logging.ERROR]
        if errors:
            found = errors[0].strip()
            raise BadFrame(f"{path}: expected whole frames, found: {found}")
        if frame is None:
            return
        yield frame


@contextmanager
def opened(path: Path) -> Iterator[tuple[Any, Any]]:
    """A container and its one stream of video, decoded without concealing what is damaged.

    Raises:
        BadFrame: it is damaged, or no video.
        ValueError: there are several streams.
    """
    check_file(path)
    try:
        with av.open(str(path), options={"err_detect": "explode"}) as container:
            streams = container.streams.video
            if len(streams) != 1:
                wanted = "one stream of video"
                raise ValueError(f"{path}: expected {wanted}, found {len(streams)}")
            if streams[0].codec_context is None:
                wanted = "a codec that FFmpeg decodes"
                raise ValueError(f"{path}: expected {wanted}, found another")
            streams[0].thread_type = "NONE"
            streams[0].codec_context.options = {"err_detect": "explode"}
            yield container, streams[0]
    except GeneratorExit:  # at the end of Python, when the names below are gone
        raise
    except (av.error.FFmpegError, UnicodeDecodeError) as error:
        found = getattr(error, "strerror", "") or "text that is damaged"
        raise BadFrame(f"{path}: expected a whole video, found: {found}") from error


def _pixels(path: Path, frame: Any) -> np.ndarray:
    """Pixels [H, W] or [H, W, 3] (blue first) of a decoded frame, shown as the file says."""
    form = "bgr24"
    if frame.format.name.startswith("gray"):
        form = frame.format.name
    elif max(component.bits for component in frame.format.components) > 8:
        form = "gray16le"
    image = frame.to_ndarray(format=form)
    matrix = frame.side_data.get(Type.DISPLAYMATRIX)
    if matrix is None:
        return image
    turns = np.frombuffer(bytes(matrix), np.int32)[[0, 1, 3, 4]] / 65536
    return _shown(path, image, *turns)


def _shown(
    path: Path, image: np.ndarray, a: float, b: float, c: float, d: float
) -> np.ndarray:
    """An image turned by quarters, or mirrored.

    The pixel at (x, y) is shown at (a·x + c·y, b·x + d·y), apart from a shift.
    """
    if (abs(a), abs(b), abs(c), abs(d)) not in ((1, 0, 0, 1), (0, 1, 1, 0)):
        raise ValueError(
            f"{path}: expected a display matrix of quarter turns, found {a:g}, {b:g}, {c:g}, {d:g} "
            "(ffmpeg -i … out.mp4 applies it)"
        )
    image = image if a else image.swapaxes(0, 1)
    image = image if a + c > 0 else image[:, ::-1]
    return image if b + d > 0 else image[::-1]
