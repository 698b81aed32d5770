"""A video with a table of labelled intervals: columns ``start_s``, ``end_s``, ``label``.

A frame belongs to the interval with start ≤ time < end, and frames outside all intervals are left
out. Times are those of the container, in seconds from its first frame, whether they are evenly
spaced or not: a delay of the first frame (an edit list of an mp4), which players add, does not
count. Colour becomes luminance as in :mod:`hdc.readers.images`; OpenCV gives 8 bits a pixel,
whatever was stored. Interlaced videos, which OpenCV 5 does not convert, are refused.

The video is decoded once, from its beginning to the last interval's end, when it is opened: seeking
is slow, and not exact in every container (opencv/opencv issues 4890 and 9053). Frames that do not
fit in memory are kept in a temporary file that goes with the process (in ``TMPDIR``).
"""

from __future__ import annotations

import hashlib
import math
import shutil
import tempfile
from bisect import bisect_right
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cache
from itertools import pairwise
from pathlib import Path
from typing import BinaryIO

import cv2
import numpy as np

from hdc.readers.files import BadFrame, file_digest, label, read_csv, shown
from hdc.readers.images import grey, quiet_opencv
from hdc.readers.recording import (
    Recording,
    check_number,
    class_indices,
    in_memory,
    with_progress,
)
from hdc.readers.settings import Options

_ATOMS = (b"ftyp", b"moov", b"mdat", b"wide", b"free", b"skip")  # first in an mp4 or mov
_ROUNDED_S = 1e-3
"""Some containers round their times to this."""
_LEFT_FREE_BYTES = 2**28
"""Of the disk that holds the temporary file."""


@dataclass(frozen=True)
class _Interval:
    start: float
    end: float
    label: str


def open_video(path: Path, table: Path, options: Options) -> Recording:
    """Open a video and its table of intervals; see the module's description.

    Raises:
        BadFrame: the video ends before a frame that an interval asks for.
        ValueError: the video or its table is not as described, or its frames do not fit on disk.
    """
    intervals = _intervals(table)
    with quiet_opencv():
        video = _Video(path, options)
        found = _labelled(video, intervals, options)
        found.check_converted()
    skipped = _missing(video, table, intervals, found, options)
    _check_every_interval(table, intervals, found, video)
    classes, labels = class_indices(
        [intervals[m].label for m in found.members], f"{path} with {table}", options
    )
    numbers = np.array(found.numbers, dtype="<i8")
    return Recording(
        classes=classes,
        labels=labels,
        shape=video.shape,
        samples={
            "order": np.arange(len(numbers)),
            "frame": numbers,
            "time": np.array(found.times),  # seconds
            "interval": np.array(found.members),
        },
        read=found.frames.read(),
        digest=cache(lambda: _digest(path, numbers, len(skipped))),
        window=options.window,
        skipped=skipped,
    )


def _digest(path: Path, numbers: np.ndarray, skipped: int) -> str:
    """Of the whole file, which of its frames are labelled, and how many of those are missing."""
    return repr((file_digest(path), skipped, hashlib.sha256(numbers.tobytes()).hexdigest()))


def _intervals(table: Path) -> list[_Interval]:
    found = []
    for where, row in read_csv(table, required=("start_s", "end_s", "label")):
        try:
            start, end = float(row["start_s"]), float(row["end_s"])
        except ValueError as error:
            raise ValueError(f"{where}: expected seconds, found: {error}") from error
        if not (math.isfinite(end) and 0 <= start < end):
            raise ValueError(f"{where}: expected 0 ≤ start_s < end_s, found {start}, {end}")
        found.append(_Interval(start, end, label(row["label"], where)))
    found.sort(key=lambda interval: interval.start)
    for before, after in pairwise(found):
        if after.start < before.end:
            raise ValueError(
                f"{shown(table)}: expected intervals that do not overlap, found "
                f"{before.start:g}–{before.end:g} s and {after.start:g}–{after.end:g} s"
            )
    return found


class _Video:
    """A video file, and what its header says: frames a second, how many, their size."""

    def __init__(self, path: Path, options: Options) -> None:
        self.path, self.window = path, options.window
        capture = self.capture()
        self.rate = capture.get(cv2.CAP_PROP_FPS)
        self.count = capture.get(cv2.CAP_PROP_FRAME_COUNT)
        width = int(capture.get(cv2.CAP_PROP_FRAME_WIDTH))
        height = int(capture.get(cv2.CAP_PROP_FRAME_HEIGHT))
        if not (math.isfinite(self.rate) and 0 < self.rate < 1e6 and 0 < self.count < 2**40):
            raise ValueError(
                f"{shown(path)}: expected a length, found {self.count} frames at {self.rate} Hz"
            )
        if not 0 < width * height <= options.max_pixels:
            raise ValueError(
                f"{shown(path)}: expected at most {options.max_pixels} pixels a frame "
                f"(max_pixels), found {width} × {height}"
            )
        self.size = (height, width)
        self.shape = self.window.shape(height, width)

    def capture(self) -> cv2.VideoCapture:
        """Only a container with its own pixels: FFmpeg would follow a playlist to other files."""
        with self.path.open("rb") as file:
            head = file.read(12)
        known = head[4:8] in _ATOMS or head[:4] == b"\x1aE\xdf\xa3"
        if not known and not (head[:4] == b"RIFF" and head[8:12] == b"AVI "):
            raise ValueError(
                f"{shown(self.path)}: expected an mp4, mov, avi, mkv or webm video, found other"
            )
        # One thread: several conceal what is damaged in a different way each time.
        one_thread = [cv2.CAP_PROP_N_THREADS, 1]
        capture = cv2.VideoCapture(str(self.path.resolve()), cv2.CAP_FFMPEG, one_thread)
        if not capture.isOpened():
            raise ValueError(
                f"{shown(self.path)}: expected a video, found one that cannot be decoded"
            )
        return capture

    def times(self, capture: cv2.VideoCapture) -> Iterator[float]:
        """Grabs one frame after the other; the time of each in seconds, increasing.

        As long as they are those of a constant rate, but for the container's rounding, the exact
        ones of that rate.
        """
        first, before, constant, number = 0.0, -math.inf, True, 0
        while capture.grab():
            stated = capture.get(cv2.CAP_PROP_POS_MSEC) / 1e3
            first = first if number else stated
            # OpenCV says 0 where an AVI states no time: for the last frames, as it is decoded.
            time = stated - first if stated or not number else number / self.rate
            constant = constant and abs(time - number / self.rate) <= _ROUNDED_S
            time = number / self.rate if constant else time
            if not before < time < math.inf:
                raise ValueError(
                    f"{shown(self.path)}: expected frames one after the other, found frame "
                    f"{number} at {time:g} s after one at {before:g} s"
                )
            yield time
            before, number = time, number + 1

    def retrieve(self, capture: cv2.VideoCapture) -> np.ndarray | None:
        """The frame that was grabbed; None where it cannot be decoded at the size of the video."""
        ok, image = capture.retrieve()
        if not ok or image.shape[:2] != self.size or image.dtype != np.uint8:
            return None
        return image


class _Labelled:
    """The labelled frames of a video: their numbers, times, intervals and pixels.

    Attributes:
        gap: the longest time between two frames, in seconds.
        next_time: when the first frame that was not decoded is due, at the latest; infinite if all
            intervals were passed.
    """

    def __init__(self, video: _Video, options: Options) -> None:
        self.video, self.frames = video, _Frames(video.path, video.shape, options.memory_bytes)
        self.numbers: list[int] = []
        self.times: list[float] = []
        self.members: list[int] = []
        self.next_time = 0.0
        self.gap = 1 / video.rate
        self._last: np.ndarray | None = None
        self._changed = 0  # since this one of the numbers all images are alike
        self._repeats: list[tuple[int, int]] = []

    def append(self, number: int, time: float, member: int, image: np.ndarray) -> None:
        if self._last is None or not np.array_equal(image, self._last):
            self._changed = len(self.numbers)
        elif len(self.numbers) == self._changed + 1 and self._changed > 0:
            self._repeats.append((self.numbers[self._changed - 1], number))
        self._last = image
        self.numbers.append(number)
        self.times.append(time)
        self.members.append(member)
        check_number(self.video.path, len(self.numbers))
        self.frames.append(grey(self.video.window.of(image)))

    def check_converted(self) -> None:
        """OpenCV 5 says it retrieved an interlaced frame, and leaves its buffer as it was.

        Then a frame is, bit for bit, the one that was retrieved before it, whichever that is. So
        frames that repeat the one before are retrieved once more after another one.

        Raises:
            ValueError: they come out as that one, or all frames are alike.
        """
        unconverted = len(self.numbers) > 1 and self._changed == 0
        if self._repeats:
            others, repeats = ({pair[k] for pair in self._repeats} for k in (0, 1))
            capture, other = self.video.capture(), None
            for number in range(self._repeats[-1][1] + 1):
                capture.grab()
                if number in others | repeats:
                    image = self.video.retrieve(capture)
                    if number in repeats and other is not None and image is not None:
                        unconverted = unconverted or np.array_equal(image, other)
                    other = image
        if unconverted:
            raise ValueError(
                f"{shown(self.video.path)}: expected progressive frames, found what OpenCV "
                f"{cv2.__version__} makes of interlaced ones, the same image again and again "
                f"(ffmpeg -i {shown(self.video.path.name)} -vf yadif … deinterlaces)"
            )


def _labelled(video: _Video, intervals: list[_Interval], options: Options) -> _Labelled:
    """Decode the video up to the end of the last interval, or as far as it goes."""
    found = _Labelled(video, options)
    # A thousandth of a frame: 0.3 s × 10 Hz must be frame 3, and is 3.0000000000000004 or less.
    early = 1e-3 / video.rate
    starts, end = [interval.start - early for interval in intervals], intervals[-1].end - early
    capture = video.capture()
    total = math.ceil(min(video.count, end * video.rate))
    times = with_progress(video.times(capture), total, "Reading video")
    before = 0.0
    for number, time in enumerate(times):
        if time >= end:
            found.next_time = math.inf
            return found
        member = bisect_right(starts, time) - 1
        if member >= 0 and time < intervals[member].end - early:
            image = video.retrieve(capture)
            if image is None:
                return found
            found.append(number, time, member, image)
        found.gap = max(found.gap, time - before)
        before, found.next_time = time, time + found.gap
    return found


def _missing(
    video: _Video, table: Path, intervals: list[_Interval], found: _Labelled, options: Options
) -> tuple[str, ...]:
    """A line for each labelled frame after the end."""
    early, seconds = 1e-3 / video.rate, video.count / video.rate
    if found.next_time >= intervals[-1].end - early:
        return ()
    for interval in intervals:
        if interval.end - early > seconds:
            raise ValueError(
                f"{shown(table)}: expected intervals within the {seconds:g} s of "
                f"{shown(video.path.name)}, found {interval.start:g}–{interval.end:g} s"
            )
    lines: list[str] = []
    for interval in intervals:
        first = math.ceil((max(interval.start, found.next_time) - early) / found.gap)
        last = max(first, math.ceil((interval.end - early) / found.gap))
        check_number(video.path, len(lines) + last - first)
        lines += (
            f"{shown(video.path)}: expected {video.count:g} frames as its header says, found it "
            f"ending before the one at {k * found.gap:g} s"
            for k in range(first, last)
        )
    if lines and not (options.skip and found.numbers):
        raise BadFrame(lines[0])
    return tuple(lines)


def _check_every_interval(
    table: Path, intervals: list[_Interval], found: _Labelled, video: _Video
) -> None:
    """Raises a ValueError if an interval that was decoded holds no frame."""
    for m in sorted(set(range(len(intervals))) - set(found.members)):
        if intervals[m].end - 1e-3 / video.rate <= found.next_time:
            raise ValueError(
                f"{shown(table)}: expected at least one frame in each interval "
                f"({video.rate:g} Hz), found none in "
                f"{intervals[m].start:g}–{intervals[m].end:g} s"
            )


class _Frames:
    """Frames [N, H, W] of 8 bits, in memory up to a number of bytes, then in a temporary file."""

    def __init__(self, path: Path, shape: tuple[int, int], memory_bytes: int) -> None:
        self.path, self.shape, self.memory_bytes = path, shape, memory_bytes
        self.images: list[np.ndarray] = []
        self.file: BinaryIO | None = None
        self.n = 0

    def append(self, image: np.ndarray) -> None:
        self.n += 1
        self.images.append(image)
        if self.file is None and self.n * image.nbytes <= self.memory_bytes:
            return
        folder = tempfile.gettempdir()
        room = (
            f"{shown(self.path)}: expected room for its decoded frames in memory "
            f"(memory_bytes) or in {shown(folder)} (TMPDIR), found"
        )
        if (free := shutil.disk_usage(folder).free) < _LEFT_FREE_BYTES + len(
            self.images
        ) * image.nbytes:
            raise ValueError(f"{room} {free} bytes on that disk")
        try:
            if self.file is None:
                self.file = tempfile.TemporaryFile()  # noqa: SIM115, it goes with the recording
            for one in self.images:
                self.file.write(one.data)
            self.file.flush()
        except OSError as error:
            raise ValueError(f"{room}: {error.strerror}") from error
        self.images.clear()

    def read(self) -> Callable[[np.ndarray], np.ndarray]:
        if self.file is None:
            return in_memory(np.stack(self.images))
        return in_memory(np.memmap(self.file, np.uint8, "r", shape=(self.n, *self.shape)))
