"""A video with a table of labelled intervals, or frame by frame.

A frame belongs to the interval with start ≤ time < end; frames outside all intervals are left out.
Times are those of the container, in seconds from its first frame, evenly spaced or not. OpenCV
gives 8 bits a pixel, whatever was stored. The labelled frames are kept in memory.

The video is decoded once, from its beginning: seeking is slow, and not exact in every container
(opencv/opencv issues 4890 and 9053).
"""

from __future__ import annotations

import hashlib
import math
import zlib
from bisect import bisect_right
from collections.abc import Iterator
from functools import cache
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

import cv2
import numpy as np

from hdc.readers.files import BadFrame, check_memory, label, read_csv, shown
from hdc.readers.images import grey, quiet
from hdc.readers.recording import Recording, Window, class_indices, with_progress

_ATOMS = (b"ftyp", b"moov", b"mdat", b"wide", b"free", b"skip")  # first in an mp4 or mov
_ROUNDED_S = 1e-3
"""Some containers round their times to this."""


class _Interval(NamedTuple):
    start: float
    end: float
    label: str


def open_video(
    path: Path, table: Path, window: Window, skip: bool, fewest_classes: int, max_pixels: int
) -> Recording:
    """Open a video and its table of intervals; see the module's description.

    Raises:
        BadFrame: the video ends before the last interval does.
        ValueError: the video or its table is not as described, or the frames are too many.
    """
    intervals = _intervals(table)
    frames, numbers, times, members = [], [], [], []
    with quiet():
        video = _Video(path, window, max_pixels)
        early = 1e-3 / video.rate  # 0.3 s × 10 Hz must be frame 3, and is 3.0000000000000004
        starts = [interval.start - early for interval in intervals]
        end = intervals[-1].end - early
        total = math.ceil(min(video.count, end * video.rate))
        for number, time in enumerate(with_progress(video.times(), total, "Reading video")):
            if time >= end:
                break
            member = bisect_right(starts, time) - 1
            if member >= 0 and time < intervals[member].end - early:
                if (image := video.retrieve(number)) is None:
                    break
                frames.append(grey(window.of(image)))
                numbers.append(number)
                times.append(time)
                members.append(member)
                check_memory(len(frames) * frames[0].nbytes, path, "crop or subsample the frames")
        video.check_progressive()
    skipped = video.cut_off(end)
    if skipped and not (skip and numbers):
        raise BadFrame(skipped[0])
    for m, (start, stop, _) in enumerate(intervals):
        if not skipped and (m not in members or stop - early > video.end):
            raise ValueError(
                f"{shown(table)}: expected intervals of at least one frame, within the "
                f"{video.count / video.rate:g} s of {shown(path.name)}, found {start:g}–{stop:g} s"
            )
    classes, labels = class_indices(
        [intervals[m].label for m in members], f"{path} with {table}", fewest_classes
    )

    def digest() -> str:
        with path.open("rb") as file:
            content = hashlib.file_digest(file, "sha256").hexdigest()
        labelled = np.array(numbers, dtype="<i8").tobytes()
        return repr((content, len(skipped), hashlib.sha256(labelled).hexdigest()))

    return Recording(
        classes=classes,
        labels=labels,
        shape=window.shape(*video.size),
        samples={
            "order": np.arange(len(numbers)),
            "frame": np.array(numbers),
            "time": np.array(times),  # seconds
            "interval": np.array(members),
        },
        each=lambda index: (frames[i] for i in index),
        place=lambda i: f"{shown(path)}, frame {numbers[i]}",
        digest=cache(digest),
        window=window,
        skipped=skipped,
    )


def stream_video(path: Path, window: Window) -> Iterator[tuple[float, np.ndarray]]:
    """Times in s and grey frames [H, W] of a whole video.

    Raises:
        ValueError: it is no video that is read here.
    """
    with quiet():
        video = _Video(path, window, 2**24)
        for number, time in enumerate(video.times()):
            if (image := video.retrieve(number)) is None:
                raise BadFrame(f"{shown(path)}: expected a frame at {time:g} s, found none")
            yield time, grey(window.of(image))
        video.check_progressive()


def _intervals(table: Path) -> list[_Interval]:
    intervals = []
    for where, row in read_csv(table, required=("start_s", "end_s", "label")):
        try:
            start, end = float(row["start_s"]), float(row["end_s"])
        except ValueError as error:
            raise ValueError(f"{where}: expected seconds, found: {error}") from error
        if not 0 <= start < end < math.inf:
            raise ValueError(f"{where}: expected 0 ≤ start_s < end_s, found {start}, {end}")
        intervals.append(_Interval(start, end, label(row["label"], where)))
    intervals.sort()
    for before, after in pairwise(intervals):
        if after.start < before.end:
            raise ValueError(
                f"{shown(table)}: expected intervals that do not overlap, found "
                f"{before.start:g}–{before.end:g} s and {after.start:g}–{after.end:g} s"
            )
    return intervals


class _Video:
    """An opened video.

    Attributes:
        rate, count, size: frames a second, how many by the header, (H, W).
        seen, end: frames that were decoded, and when the next one is due, in s.
    """

    def __init__(self, path: Path, window: Window, max_pixels: int) -> None:
        with path.open("rb") as file:
            head = file.read(12)
        # FFmpeg would follow a playlist to other files.
        if not (head[4:8] in _ATOMS or head[:4] in (b"\x1aE\xdf\xa3", b"RIFF")):
            raise ValueError(
                f"{shown(path)}: expected an mp4, mov, avi, mkv or webm video, found other"
            )
        # One thread: several conceal what is damaged in a different way each time.
        one_thread = [cv2.CAP_PROP_N_THREADS, 1]
        self.path = path
        self._capture = cv2.VideoCapture(str(path.resolve()), cv2.CAP_FFMPEG, one_thread)
        self.rate = self._capture.get(cv2.CAP_PROP_FPS)
        self.count = self._capture.get(cv2.CAP_PROP_FRAME_COUNT)
        width = int(self._capture.get(cv2.CAP_PROP_FRAME_WIDTH))
        height = int(self._capture.get(cv2.CAP_PROP_FRAME_HEIGHT))
        if not (self._capture.isOpened() and 0 < self.rate < 1e6 and 0 < self.count < 2**40):
            raise ValueError(
                f"{shown(path)}: expected a video of known length, found {self.count:g} frames "
                f"at {self.rate:g} Hz"
            )
        if not 0 < width * height <= max_pixels:
            raise ValueError(
                f"{shown(path)}: expected at most {max_pixels} pixels a frame (max_pixels), "
                f"found {width} × {height}"
            )
        window.shape(height, width)
        self.size, self.seen, self.end, self._gap = (height, width), 0, 0.0, 1 / self.rate
        self._retrieved: list[tuple[int, int]] = []  # number and checksum of a frame

    def times(self) -> Iterator[float]:
        """Grab one frame after the other; the time of each in seconds, increasing."""
        first, before = 0.0, -math.inf
        while self._capture.grab():
            stated, even = self._capture.get(cv2.CAP_PROP_POS_MSEC) / 1e3, self.seen / self.rate
            first = first if self.seen else stated
            # OpenCV says 0 where an AVI states no time: for the last frames, as it is decoded.
            time = stated - first if stated or not self.seen else even
            time = even if abs(time - even) <= _ROUNDED_S else time
            if not before < time < math.inf:
                raise ValueError(
                    f"{shown(self.path)}: expected frames one after the other, found frame "
                    f"{self.seen} at {time:g} s after one at {before:g} s"
                )
            self._gap = max(self._gap, time - before) if self.seen else self._gap
            self.end = time + self._gap
            yield time
            self.seen, before = self.seen + 1, time

    def retrieve(self, number: int) -> np.ndarray | None:
        """The frame that was grabbed; None where it cannot be decoded at the size of the video."""
        ok, image = self._capture.retrieve()
        if not ok or image.shape[:2] != self.size or image.dtype != np.uint8:
            return None
        self._retrieved.append((number, zlib.crc32(image.data)))
        return image

    def cut_off(self, end: float) -> tuple[str, ...]:
        """A line where the video ends before `end` and has fewer frames than its header says."""
        if self.end >= end or self.seen >= self.count - 1:
            return ()
        return (
            f"{shown(self.path)}: expected {self.count:g} frames as its header says, found it "
            f"ending at {self.end:g} s",
        )

    def check_progressive(self) -> None:
        """Refuse interlaced frames.

        OpenCV 5 says it retrieved an interlaced frame and leaves its buffer as it was. Such a
        frame is garbage if it is the first one, else a copy of the one before. So the first frame,
        and the last of each run of equal ones, are retrieved again, each after another image: if
        the frame comes out different, it is interlaced.

        Raises:
            ValueError: a frame is interlaced, or all frames are alike, which looks the same.
        """
        numbers, prints = zip(*self._retrieved, strict=True) if self._retrieved else ((), ())
        starts = [i for i, p in enumerate(prints) if i == 0 or p != prints[i - 1]]
        runs = list(pairwise([*starts, len(prints)]))
        again = [(a, b - 1) for a, b in runs if a == 0 or b - a > 1]
        progressive = len(runs) != 1
        if len(runs) > 1:
            self._rewind()
            self._retrieve_again(numbers[runs[1][0]])  # its image is not that of the first run
            self._rewind()
            for start, last in again:
                if start:
                    self._retrieve_again(numbers[start - 1])
                progressive &= self._retrieve_again(numbers[last]) == prints[last]
        if not progressive:
            raise ValueError(
                f"{shown(self.path)}: expected progressive frames, found what OpenCV "
                f"{cv2.__version__} makes of interlaced ones, the same image again and again "
                f"(ffmpeg -i {shown(self.path.name)} -vf yadif … deinterlaces)"
            )

    def _rewind(self) -> None:
        self._capture.set(cv2.CAP_PROP_POS_FRAMES, 0)
        self._place = -1

    def _retrieve_again(self, number: int) -> int:
        while self._place < number:
            self._capture.grab()
            self._place += 1
        ok, image = self._capture.retrieve()
        return zlib.crc32(image.data) if ok else -1
