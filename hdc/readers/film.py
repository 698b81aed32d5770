"""Frames of a video, decoded by PyAV (FFmpeg) from its beginning.

Times are as in the container, in seconds from its first frame, evenly spaced or not. A frame is
turned as the file says. Grey of more than 8 bits is left as it is stored. Seeking is slow, and not
exact in every container, so a video is decoded from its beginning. Frames that fit are kept in
memory.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import av
import numpy as np
from av.sidedata.sidedata import Type

from hdc.readers.files import BadFrame, check_file
from hdc.readers.images import grey
from hdc.readers.recording import Window


class Film:
    """Frames of a video that are chosen.

    Attributes:
        path: of the file.
        count: of all frames that were read.
        numbers, times: of the frames that are chosen, in s.
        shape, dtype: of a frame; known after :meth:`read`.
        notes: how frames are read where the file could be read otherwise.
    """

    def __init__(self, path: Path, window: Window, memory_bytes: int) -> None:
        self.path, self._window, self._memory_bytes = path, window, memory_bytes
        self.count = 0
        self.numbers: list[int] = []
        self.times: list[float] = []
        self.shape: tuple[int, ...] = ()
        self.dtype = np.dtype(np.uint8)
        self.notes: list[str] = []
        self._kept: dict[int, np.ndarray] = {}

    def read(
        self, is_wanted: Callable[[int, float], bool], end: float = math.inf
    ) -> None:
        """Choose each frame before ``end`` that is wanted by its number and time in s.

        Frames are kept in memory if all of them fit.
        """
        frames = stream_video(self.path, self._window, end, self.notes)
        for number, (time, frame) in enumerate(frames):
            self.count = number + 1
            self.shape, self.dtype = frame.shape, frame.dtype
            if is_wanted(number, time):
                self.numbers.append(number)
                self.times.append(time)
                if len(self.numbers) * frame.nbytes <= self._memory_bytes:
                    self._kept[number] = frame
        if len(self._kept) < len(self.numbers):
            self._kept = {}

    def expect(self) -> None:
        """Choose all frames that the header states, or as many as there are; none is decoded but
        the first."""
        first = next(stream_video(self.path, self._window, notes=self.notes))[1]
        with opened(self.path) as (_, stream):
            count = stream.frames
        if count == 0:
            self.read(lambda *_: False)
            count = self.count
        self.shape, self.dtype = first.shape, first.dtype
        self.numbers = [*range(count)]

    def choose(self, table: Path, numbers: list[int]) -> None:
        """Choose frames of these numbers, in this order, of those that were read for a table."""
        time_of = dict(zip(self.numbers, self.times, strict=True))
        if absent := sorted(set(numbers) - set(time_of)):
            wanted = f"numbers of the {self.count} frames of {self.path.name}, from 0"
            raise ValueError(f"{table}: expected {wanted}, found {absent[0]}")
        self.numbers, self.times = numbers, [time_of[number] for number in numbers]

    def samples(self) -> dict[str, np.ndarray]:
        """Number and time in s of each frame."""
        return {"frame": np.array(self.numbers), "time": np.array(self.times)}

    def place(self, i: int) -> str:
        """The video, and the number of a frame."""
        return f"{self.path}, frame {self.numbers[i]}"

    def each(self, index: np.ndarray) -> Iterator[np.ndarray]:
        """Frames [H, W] of indices [n]; the video is decoded once more where they are not kept."""
        numbers = [self.numbers[i] for i in index]
        if self._kept:
            return (self._kept[number] for number in numbers)
        ordered = sorted(set(numbers))
        if ordered == numbers:
            return self._of_numbers(ordered)
        found = dict(zip(ordered, self._of_numbers(ordered), strict=True))
        return (found[number] for number in numbers)

    def _of_numbers(self, ordered: Sequence[int]) -> Iterator[np.ndarray]:
        """Frames of these numbers, which increase."""
        frames = enumerate(stream_video(self.path, self._window))
        for wanted in ordered:
            found = (frame for number, (_, frame) in frames if number == wanted)
            frame = next(found, None)
            if frame is None:
                raise BadFrame(f"{self.path}: expected a frame {wanted}, found none")
            yield frame


def stream_video(
    path: Path,
    window: Window,
    end: float = math.inf,
    notes: list[str] | None = None,
) -> Iterator[tuple[float, np.ndarray]]:
    """Time in s and grey frame [H, W] of each frame of a video before ``end`` in s.

    Statements of the file on its frames are added to ``notes``.

    Raises:
        BadFrame: a frame is damaged, or frames are missing.
        ValueError: it is no video that is read here.
    """
    times: list[float] = []
    with opened(path) as (container, stream):
        start = lasts = 0.0
        for frame in _decoded(path, container.decode(stream)):
            if frame.time is None or frame.is_corrupt:
                raise BadFrame(
                    f"{path}: expected whole frames, found that number {len(times)} is damaged"
                )
            start = start if times else frame.time
            time = frame.time - start
            if times and time <= times[-1]:
                found = f"frame {len(times)} at {time:g} s after one at {times[-1]:g} s"
                raise BadFrame(
                    f"{path}: expected frames one after the other, found {found}"
                )
            times.append(time)
            if time >= end:
                break
            lasts = float((frame.duration or 0) * frame.time_base)
            yield time, grey(window.of(_pixels(path, frame, notes)))
        stated_end = 0.0
        if len(container.streams) == 1 and container.duration is not None:
            stated_end = float(container.duration / av.time_base) - start
        check_whole(path, times, end, stream.frames, stated_end, lasts)


def check_whole(
    path: Path,
    times: Sequence[float],
    end: float,
    stated_frames: int,
    stated_end: float,
    lasts: float,
) -> None:
    """Raise BadFrame unless there are as many frames, or seconds, as the header states.

    Where it states no frames, a gap in steps that are even but for one in ten is a loss.

    Args:
        path: of the video.
        times: of its frames, in s.
        end: seconds up to which it is needed.
        stated_frames: how many its header states; 0 where it states none.
        stated_end: seconds of its end; 0 where it states none.
        lasts: seconds of the last frame.
    """
    n = len(times)
    if n == 0:
        raise BadFrame(f"{path}: expected frames, found none")
    steps = np.diff(times)
    if times[-1] < end:
        step = max(lasts, *steps.tolist(), 0.0)
        lacks_end = times[-1] + 1.5 * step < stated_end and not stated_frames
        if n < stated_frames or lacks_end:
            stated = f"{stated_frames} frames" if stated_frames else f"{stated_end:g} s"
            found = f"{n} frames to {times[-1]:g} s"
            raise BadFrame(
                f"{path}: expected {stated} as its header says, found {found}"
            )
    gaps = int((steps > 1.5 * np.median(steps)).sum()) if n > 2 else 0
    if 0 < 9 * gaps < len(steps) and not stated_frames:
        raise BadFrame(
            f"{path}: expected frames at an even rate, found {gaps} gaps: some are lost (if its "
            "rate varies, ffmpeg -i … -c copy out.mp4 counts its frames)"
        )


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


def _pixels(path: Path, frame: Any, notes: list[str] | None) -> np.ndarray:
    """Pixels [H, W] or [H, W, 3] (blue first) of a decoded frame, shown as the file says."""
    bits = max(component.bits for component in frame.format.components)
    form, said = "bgr24", []
    if frame.format.name.startswith("gray"):
        form = frame.format.name
        said += [f"{bits} bits per pixel"] * (bits > 8)
    elif bits > 8:
        form = "gray16le"
        said.append(f"luminance of {bits} bits, scaled to 16")
    if frame.interlaced_frame:
        said.append("interlaced: ffmpeg -vf yadif separates fields")
    image = frame.to_ndarray(format=form)
    matrix = frame.side_data.get(Type.DISPLAYMATRIX)
    if matrix is not None:
        turns = np.frombuffer(bytes(matrix), np.int32)[[0, 1, 3, 4]] / 65536
        if turns.tolist() != [1, 0, 0, 1]:
            image = _shown(path, image, *turns)
            said.append("turned or mirrored as the file says")
    if notes is not None:
        notes += [text for text in said if text not in notes]
    return image


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
