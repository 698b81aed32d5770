"""Frames of a video, decoded by PyAV (FFmpeg) from its beginning.

Times are those of the container, in seconds from its first frame, evenly spaced or not. A frame is
turned as the file says. Grey of more than 8 bits comes as it is stored. Seeking is slow, and not
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

EARLY_S = 5.1e-4
"""Frames so much before a time belong to it: some containers round their times to 1 ms."""


class Film:
    """Frames of a video by their numbers.

    Attributes:
        path: of the file.
        count: of all frames that were read.
        shape, dtype: of a frame; known after :meth:`read`.
        notes: how frames are read where the file could be read otherwise.
    """

    def __init__(self, path: Path, window: Window) -> None:
        self.path, self._window = path, window
        self.count = 0
        self.shape: tuple[int, ...] = ()
        self.dtype = np.dtype(np.uint8)
        self.notes: list[str] = []
        self._kept: dict[int, np.ndarray] = {}

    def read(
        self,
        is_wanted: Callable[[int, float], bool],
        memory_bytes: int,
        end: float = math.inf,
    ) -> dict[int, float]:
        """Number and time in s of each frame before ``end`` that is wanted by these two.

        Frames are kept in memory if all that are wanted fit.
        """
        times = {}
        frames = stream_video(self.path, self._window, end, self.notes)
        for number, (time, frame) in enumerate(frames):
            self.count = number + 1
            self.shape, self.dtype = frame.shape, frame.dtype
            if is_wanted(number, time):
                times[number] = time
                if len(times) * frame.nbytes <= memory_bytes:
                    self._kept[number] = frame
        if len(self._kept) < len(times):
            self._kept = {}
        return times

    def each(self, numbers: Sequence[int]) -> Iterator[np.ndarray]:
        """Frames of these numbers; the video is decoded once more where they are not kept."""
        if self._kept:
            return (self._kept[number] for number in numbers)
        ordered = sorted(set(numbers))
        if ordered == [*numbers]:
            return self._decoded(ordered)
        found = dict(zip(ordered, self._decoded(ordered), strict=True))
        return (found[number] for number in numbers)

    def _decoded(self, ordered: Sequence[int]) -> Iterator[np.ndarray]:
        frames = enumerate(stream_video(self.path, self._window))
        for wanted in ordered:
            yield next(frame for number, (_, frame) in frames if number == wanted)


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
    found = [] if notes is None else notes
    times: list[float] = []
    with opened(path) as (container, stream):
        lasts = start = 0.0
        for frame in _decoded(path, container.decode(stream)):
            if frame.time is None or frame.is_corrupt:
                place = f"after {times[-1]:g} s" if times else "at its beginning"
                raise BadFrame(
                    f"{path}: expected whole frames, found a damaged one {place}"
                )
            start = start if times else frame.time
            times.append(frame.time - start)
            _check_later(path, times)
            if times[-1] >= end - EARLY_S:
                break
            lasts = float((frame.duration or 0) * frame.time_base)
            yield times[-1], grey(window.of(_pixels(path, frame, found)))
        stated_end = 0.0
        if len(container.streams) == 1 and container.duration is not None:
            stated_end = float(container.duration / av.time_base) - start
        ends_early = bool(times) and times[-1] >= end - EARLY_S
        check_whole(path, times, ends_early, stream.frames, stated_end, lasts)


def _check_later(path: Path, times: Sequence[float]) -> None:
    """Raise a BadFrame where the last frame is not after the one before it."""
    if len(times) > 1 and times[-1] <= times[-2]:
        n = len(times) - 1
        found = f"frame {n} at {times[-1]:g} s after one at {times[-2]:g} s"
        raise BadFrame(f"{path}: expected frames one after the other, found {found}")


def check_whole(
    path: Path,
    times: Sequence[float],
    ends_early: bool,
    stated_frames: int,
    stated_end: float,
    lasts: float,
) -> None:
    """Raise BadFrame unless there are as many frames, or seconds, as the header states.

    Where it states no frames, a gap in steps that are even but for one in ten is a loss.

    Args:
        path: of the video.
        times: of its frames, in s.
        ends_early: whether no more of it is needed.
        stated_frames: how many its header states; 0 where it states none.
        stated_end: seconds of its end; 0 where it states none.
        lasts: seconds of the last frame.
    """
    n = len(times)
    if n == 0:
        raise BadFrame(f"{path}: expected frames, found none")
    if stated_frames:
        if n < stated_frames and not ends_early:
            wanted = f"{stated_frames} frames as its header says"
            raise BadFrame(f"{path}: expected {wanted}, found {n}")
        return
    steps = np.diff(times)
    step = max(lasts, *steps.tolist(), 0.0)
    if times[-1] + 1.5 * step < stated_end and not ends_early:
        wanted = f"{stated_end:g} s as its header says"
        found = f"{n} frames to {times[-1]:g} s"
        raise BadFrame(f"{path}: expected {wanted}, found {found}")
    gaps = int((steps > 1.5 * np.median(steps)).sum()) if n > 2 else 0
    if 0 < 9 * gaps < len(steps):
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
    except (av.error.FFmpegError, UnicodeDecodeError) as error:
        found = getattr(error, "strerror", "") or "text that is damaged"
        raise BadFrame(f"{path}: expected a whole video, found: {found}") from error


def _pixels(path: Path, frame: Any, notes: list[str]) -> np.ndarray:
    """Pixels [H, W] or [H, W, 3] (blue first) of a decoded frame, turned as the file says."""
    bits = max(component.bits for component in frame.format.components)
    is_grey = len(frame.format.components) == 1
    if is_grey and frame.format.name.startswith("gray"):
        image = frame.to_ndarray()
        note(notes, bits > 8, f"{bits} bits per pixel")
    elif bits > 8:
        image = frame.to_ndarray(format="gray16le")
        note(notes, True, f"luminance of {bits} bits, scaled to 16")
    else:
        image = frame.to_ndarray(format="bgr24")
    note(notes, frame.interlaced_frame, "interlaced: ffmpeg -vf yadif separates fields")
    return _displayed(path, image, frame.side_data.get(Type.DISPLAYMATRIX), notes)


def _displayed(
    path: Path, image: np.ndarray, matrix: Any, notes: list[str]
) -> np.ndarray:
    """An image as the display matrix of its file says: turned by quarters, or mirrored.

    The pixel at (x, y) is shown at (a·x + c·y, b·x + d·y), apart from a shift; the matrix is
    a, b, 0, c, d, 0, …, in steps of 1/65536.
    """
    if matrix is None:
        return image
    a, b, _, c, d, *_ = np.frombuffer(bytes(matrix), np.int32) / 65536
    if (abs(a), abs(b), abs(c), abs(d)) not in ((1, 0, 0, 1), (0, 1, 1, 0)):
        found = f"{a:g}, {b:g}, {c:g}, {d:g}"
        raise ValueError(
            f"{path}: expected a display matrix of quarter turns, found {found} "
            "(ffmpeg -i … out.mp4 applies it)"
        )
    if a == 0:
        image = image.swapaxes(0, 1)
    is_flipped = a + c < 0, b + d < 0
    image = image[:: -1 if is_flipped[1] else 1, :: -1 if is_flipped[0] else 1]
    turns = round(np.degrees(np.arctan2(-b, a))) % 360
    how = "mirrored" if a * d - b * c < 0 else f"turned by {turns}°"
    note(notes, how != "turned by 0°", f"{how} as the file says")
    return image


def note(notes: list[str], condition: bool, text: str) -> None:
    """Add a text to the notes, once, where a condition holds."""
    if condition and text not in notes:
        notes.append(text)
