"""A video with a table of labelled intervals, or frame by frame.

A frame belongs to the interval with start ≤ time < end; frames outside all intervals are left out.
Times are those of the container, in seconds from its first frame, evenly spaced or not. OpenCV
gives 8 bits a pixel, whatever was stored. Interlaced videos, which OpenCV 5 does not convert, are
refused.

The video is decoded once, from its beginning: seeking is slow, and not exact in every container
(opencv/opencv issues 4890 and 9053). Frames that do not fit in memory are kept in a temporary file
that goes with the process (in ``TMPDIR``).
"""

from __future__ import annotations

import hashlib
import math
import tempfile
import zlib
from bisect import bisect_right
from collections.abc import Iterator, Sequence
from functools import cache
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple

import cv2
import numpy as np

from hdc.readers.files import BadFrame, label, read_csv, shown
from hdc.readers.images import grey, quiet_opencv
from hdc.readers.recording import Recording, Window, class_indices, with_progress

_ATOMS = (b"ftyp", b"moov", b"mdat", b"wide", b"free", b"skip")  # first in an mp4 or mov
_ROUNDED_S = 1e-3
"""Some containers round their times to this."""


class _Interval(NamedTuple):
    start: float
    end: float
    label: str


def open_video(
    path: Path,
    table: Path,
    window: Window,
    skip: bool,
    fewest_classes: int,
    memory_bytes: int,
    max_pixels: int,
) -> Recording:
    """Open a video and its table of intervals; see the module's description.

    Raises:
        BadFrame: the video ends before the last interval does.
        ValueError: the video or its table is not as described.
    """
    intervals = _intervals(table)
    with quiet_opencv():
        video = _Video(path, window, max_pixels)
        early = 1e-3 / video.rate  # 0.3 s × 10 Hz must be frame 3, and is 3.0000000000000004
        starts = [interval.start - early for interval in intervals]
        end, due = intervals[-1].end - early, 0.0
        # It goes with the recording.
        kept = tempfile.SpooledTemporaryFile(memory_bytes)  # noqa: SIM115
        numbers, times, members, prints = [], [], [], list[int]()
        total = math.ceil(min(video.count, end * video.rate))
        for number, time in enumerate(with_progress(video.times(), total, "Reading video")):
            due = time + video.gap
            if time >= end:
                break
            member = bisect_right(starts, time) - 1
            if member >= 0 and time < intervals[member].end - early:
                if (image := video.retrieve()) is None:
                    due = time
                    break
                numbers.append(number)
                times.append(time)
                members.append(member)
                prints.append(zlib.crc32(image.data))
                _keep(kept, grey(window.of(image)), path)
        video.check_converted(numbers, prints)
    skipped = _cut_off(video, table, intervals, due)
    if skipped and not (skip and numbers):
        raise BadFrame(skipped[0])
    for m in sorted(set(range(len(intervals))) - set(members)):
        if intervals[m].end - early <= due:
            start, stop, _ = intervals[m]
            raise ValueError(
                f"{shown(table)}: expected at least one frame in each interval "
                f"({video.rate:g} Hz), found none in {start:g}–{stop:g} s"
            )
    classes, labels = class_indices(
        [intervals[m].label for m in members], f"{path} with {table}", fewest_classes
    )
    chosen, shape = np.array(numbers, dtype="<i8"), (len(numbers), *video.shape)
    kept.seek(0)
    if math.prod(shape) <= memory_bytes:
        frames = np.frombuffer(kept.read(), np.uint8).reshape(shape)
    else:
        frames = np.memmap(kept, np.uint8, "r", shape=shape)  # type: ignore[call-overload]

    return Recording(
        classes=classes,
        labels=labels,
        samples={
            "order": np.arange(len(numbers)),
            "frame": chosen,
            "time": np.array(times),  # seconds
            "interval": np.array(members),
        },
        each=lambda index: (np.array(frames[i]) for i in index),
        place=lambda i: f"{shown(path)}, frame {numbers[i]}",
        digest=cache(lambda: _digest(path, chosen, len(skipped))),
        window=window,
        skipped=skipped,
        size=video.shape,
    )


def stream_video(
    path: Path, window: Window, max_pixels: int = 2**24
) -> Iterator[tuple[float, np.ndarray]]:
    """Times in s and grey frames [H, W] of a whole video.

    Raises:
        ValueError: it is no video that is read here.
    """
    with quiet_opencv():
        video = _Video(path, window, max_pixels)
        numbers, prints = list[int](), list[int]()
        for number, time in enumerate(video.times()):
            if (image := video.retrieve()) is None:
                raise BadFrame(f"{shown(path)}: expected a frame at {time:g} s, found none")
            numbers.append(number)
            prints.append(zlib.crc32(image.data))
            yield time, grey(window.of(image))
        video.check_converted(numbers, prints)


def _digest(path: Path, numbers: np.ndarray, skipped: int) -> str:
    """Of the whole file, which of its frames are labelled, and how many of those are missing."""
    with path.open("rb") as file:
        content = hashlib.file_digest(file, "sha256").hexdigest()
    return repr((content, skipped, hashlib.sha256(numbers.tobytes()).hexdigest()))


def _intervals(table: Path) -> list[_Interval]:
    intervals = []
    for where, row in read_csv(table, required=("start_s", "end_s", "label")):
        try:
            start, end = float(row["start_s"]), float(row["end_s"])
        except ValueError as error:
            raise ValueError(f"{where}: expected seconds, found: {error}") from error
        if not (math.isfinite(end) and 0 <= start < end):
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
    """An opened video: frames a second, how many, their size, and the longest gap so far in s."""

    def __init__(self, path: Path, window: Window, max_pixels: int) -> None:
        self.path = path
        self.capture = self._open()
        self.rate = self.capture.get(cv2.CAP_PROP_FPS)
        self.count = self.capture.get(cv2.CAP_PROP_FRAME_COUNT)
        width = int(self.capture.get(cv2.CAP_PROP_FRAME_WIDTH))
        height = int(self.capture.get(cv2.CAP_PROP_FRAME_HEIGHT))
        if not (0 < self.rate < 1e6 and 0 < self.count < 2**40):
            raise ValueError(
                f"{shown(path)}: expected a length, found {self.count} frames at {self.rate} Hz"
            )
        if not 0 < width * height <= max_pixels:
            raise ValueError(
                f"{shown(path)}: expected at most {max_pixels} pixels a frame "
                f"(max_pixels), found {width} × {height}"
            )
        self.size, self.shape = (height, width), window.shape(height, width)
        self.gap = 1 / self.rate

    def _open(self) -> cv2.VideoCapture:
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

    def times(self) -> Iterator[float]:
        """Grab one frame after the other; the time of each in seconds, increasing.

        The exact times of a constant rate, as long as they are those but for rounding.
        """
        first, before, constant, number = 0.0, -math.inf, True, 0
        while self.capture.grab():
            stated = self.capture.get(cv2.CAP_PROP_POS_MSEC) / 1e3
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
            self.gap = max(self.gap, time - before) if number else self.gap
            yield time
            before, number = time, number + 1

    def retrieve(self) -> np.ndarray | None:
        """The frame that was grabbed; None where it cannot be decoded at the size of the video."""
        ok, image = self.capture.retrieve()
        return image if ok and image.shape[:2] == self.size and image.dtype == np.uint8 else None

    def check_converted(self, numbers: Sequence[int], prints: Sequence[int]) -> None:
        """Refuse interlaced frames, given numbers and checksums of the frames as retrieved.

        OpenCV 5 says it retrieved an interlaced frame and leaves its buffer as it was. Such a
        frame is garbage if it is the first one, else a copy of the one before. So the first one,
        and the last of each run of copies, are retrieved again after another image: if they come
        out as that image, they are interlaced.

        Raises:
            ValueError: a frame is interlaced, or all frames are alike, which nobody can tell apart.
        """
        if not numbers:
            return
        n = len(prints)
        repeats = [
            i
            for i in range(1, n)
            if prints[i] == prints[i - 1] and (i + 1 == n or prints[i + 1] != prints[i])
        ]
        other = next((i for i in range(n) if prints[i] != prints[0]), None)
        interlaced = other is None
        if other is not None:
            if prints[-1] == prints[0]:  # the buffer holds the same image: put another one there
                self._again(numbers, prints, [], other)
            interlaced = self._again(numbers, prints, [0], 0)
        if repeats and not interlaced:
            self._again(numbers, prints, [], other or 0)
            interlaced = self._again(numbers, prints, repeats, repeats[-1])
        if interlaced:
            raise ValueError(
                f"{shown(self.path)}: expected progressive frames, found what OpenCV "
                f"{cv2.__version__} makes of interlaced ones, the same image again and again "
                f"(ffmpeg -i {shown(self.path.name)} -vf yadif … deinterlaces)"
            )

    def _again(
        self, numbers: Sequence[int], prints: Sequence[int], suspects: Sequence[int], last: int
    ) -> bool:
        """Go through the frames up to ``last`` again; whether a suspect comes out as another."""
        held, number, waiting = prints[-1], -1, list(suspects)
        self.capture.set(cv2.CAP_PROP_POS_FRAMES, 0)
        for i in range(last + 1):
            while number < numbers[i]:
                self.capture.grab()
                number += 1
            suspect = bool(waiting) and i == waiting[0]
            if not suspect and waiting and prints[i] == prints[waiting[0]]:
                continue  # the buffer must hold another image when the suspect's turn comes
            image = self.retrieve()
            now = held if image is None else zlib.crc32(image.data)
            if suspect and now == held != prints[i]:
                return True
            held = now
            waiting = waiting[1:] if suspect else waiting
        return False


def _cut_off(video: _Video, table: Path, intervals: list[_Interval], due: float) -> tuple[str, ...]:
    """A line where the video ends before an interval does, the next frame being ``due``."""
    seconds, early = video.count / video.rate, 1e-3 / video.rate
    start, end, _ = intervals[-1]
    if due >= end - early:
        return ()
    if end - early > seconds:
        raise ValueError(
            f"{shown(table)}: expected intervals within the {seconds:g} s of "
            f"{shown(video.path.name)}, found {start:g}–{end:g} s"
        )
    return (
        f"{shown(video.path)}: expected {video.count:g} frames as its header says, found it "
        f"ending at {due:g} s",
    )


def _keep(file: Any, frame: np.ndarray, path: Path) -> None:
    try:
        file.write(frame.data)
    except OSError as error:
        raise ValueError(
            f"{shown(path)}: expected room for its frames in memory (memory_bytes) or in "
            f"{shown(tempfile.gettempdir())} (TMPDIR), found: {error.strerror}"
        ) from error
