"""A video with a table of labelled intervals: columns ``start_s``, ``end_s``, ``label``.

Frame i is at the time i / (frames a second), as the container states them; it belongs to the
interval with start ≤ time < end, and frames outside all intervals are left out. Colour becomes
luminance as in :mod:`scenes.recorded.images`; OpenCV gives 8 bits a pixel, whatever was stored.

The video is decoded once from its beginning when it is opened. If the frames do not fit in memory
they are read again later, and a frame is compared with the check sum it had: seeking is not exact
in every container (opencv/opencv issues 4890 and 9053), decoding from the beginning is.
"""

from __future__ import annotations

import math
import threading
import zlib
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import cv2
import numpy as np

from scenes.recorded.files import BadFrame, file_digest, label, read_csv, shown
from scenes.recorded.images import grey, quiet_opencv
from scenes.recorded.scene import (
    Options,
    RecordedScene,
    check_number,
    class_indices,
    in_memory,
    with_progress,
)

_ATOMS = (b"ftyp", b"moov", b"mdat", b"wide", b"free", b"skip")  # first in an mp4 or mov
_SEEK = 64
"""Frames ahead that are skipped by decoding instead of seeking."""


@dataclass(frozen=True)
class _Interval:
    start: float
    end: float
    label: str


def open_video(path: Path, table: Path, options: Options) -> RecordedScene:
    """Open a video and its table of intervals; see the module's description.

    Raises:
        BadFrame: the video ends before a frame that an interval asks for.
        ValueError: the video or its table is not as described.
    """
    intervals = _intervals(table)
    with quiet_opencv():
        capture = _open(path)
        rate = capture.get(cv2.CAP_PROP_FPS)
        count = capture.get(cv2.CAP_PROP_FRAME_COUNT)
        width = int(capture.get(cv2.CAP_PROP_FRAME_WIDTH))
        height = int(capture.get(cv2.CAP_PROP_FRAME_HEIGHT))
        if not (math.isfinite(rate) and 0 < rate < 1e6 and 0 < count < 2**40):
            raise ValueError(f"{shown(path)}: expected a length, found {count} frames at {rate} Hz")
        if not 0 < width * height <= options.max_pixels:
            raise ValueError(
                f"{shown(path)}: expected at most {options.max_pixels} pixels a frame "
                f"(scene.max_pixels), found {width} × {height}"
            )
        shape = options.window.shape(height, width)
        numbers, members = _numbers(path, table, intervals, rate, int(count))

        # A video that ends early is found here, not in the middle of a training.
        images: list[np.ndarray] | None = []
        if len(numbers) * math.prod(shape) > options.memory_bytes:
            images = None
        checks: list[int] = []
        for k in with_progress(range(int(numbers[-1]) + 1), int(numbers[-1]) + 1, "Reading video"):
            if not capture.grab():
                break
            if k == numbers[len(checks)]:
                image = _retrieve(capture, (height, width), options)
                if image is None:
                    break
                checks.append(zlib.crc32(image.data))
                if images is not None:
                    images.append(image)
    skipped = _missing(path, numbers, len(checks), int(count), rate, options)
    numbers, members = numbers[: len(checks)], members[: len(checks)]
    names = [intervals[m].label for m in members]
    classes, labels = class_indices(names, f"{path} with {table}")
    reader = _Reader(path, (height, width), numbers, checks, options)
    return RecordedScene(
        classes=classes,
        labels=labels,
        shape=shape,
        samples={
            "order": np.arange(len(numbers)),
            "frame": numbers,
            "time": numbers / rate,  # seconds
            "interval": members,
        },
        read=in_memory(np.stack(images)) if images is not None else reader.read,
        digest=repr((file_digest(path), len(skipped))),
        window=options.window,
        skipped=skipped,
    )


def _intervals(table: Path) -> list[_Interval]:
    found = []
    for line, row in enumerate(read_csv(table, required=("start_s", "end_s", "label")), start=2):
        where = f"{shown(table)}, row {line}"
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


def _open(path: Path) -> cv2.VideoCapture:
    """Only a container with its own pixels: FFmpeg would follow a playlist to other files."""
    with path.open("rb") as file:
        head = file.read(12)
    known = head[4:8] in _ATOMS or head[:4] == b"\x1aE\xdf\xa3"
    if not known and not (head[:4] == b"RIFF" and head[8:12] == b"AVI "):
        raise ValueError(
            f"{shown(path)}: expected an mp4, mov, avi, mkv or webm video, found other"
        )
    # One thread: several conceal what is damaged in a different way each time.
    one_thread = [cv2.CAP_PROP_N_THREADS, 1]
    capture = cv2.VideoCapture(str(path.resolve()), cv2.CAP_FFMPEG, one_thread)
    if not capture.isOpened():
        raise ValueError(f"{shown(path)}: expected a video, found one that cannot be decoded")
    return capture


def _numbers(
    path: Path, table: Path, intervals: list[_Interval], rate: float, count: int
) -> tuple[np.ndarray, np.ndarray]:
    """Numbers of the labelled frames, increasing, and the interval of each."""
    numbers, members, total = [], [], 0
    for m, interval in enumerate(intervals):
        # A thousandth of a frame: 0.3 s × 10 Hz must be frame 3, and is 3.0000000000000004 or less.
        first, last = (math.ceil(t * rate - 1e-3) for t in (interval.start, interval.end))
        if last > count:
            raise ValueError(
                f"{shown(table)}: expected intervals within the {count / rate:g} s of "
                f"{shown(path.name)}, found {interval.start:g}–{interval.end:g} s"
            )
        if first == last:
            raise ValueError(
                f"{shown(table)}: expected at least one frame in each interval ({rate:g} Hz), "
                f"found none in {interval.start:g}–{interval.end:g} s"
            )
        total += last - first
        check_number(path, total)
        numbers.append(np.arange(first, last))
        members.append(np.full(last - first, m))
    return np.concatenate(numbers), np.concatenate(members)


def _retrieve(
    capture: cv2.VideoCapture, size: tuple[int, int], options: Options
) -> np.ndarray | None:
    """The frame that was grabbed; None where it cannot be decoded at the size of the video."""
    ok, image = capture.retrieve()
    if not ok or image.shape[:2] != size or image.dtype != np.uint8:
        return None
    return grey(options.window.of(image))


def _missing(
    path: Path, numbers: np.ndarray, decoded: int, count: int, rate: float, options: Options
) -> tuple[str, ...]:
    """A line for each labelled frame after the end."""
    lines = tuple(
        f"{shown(path)}: expected {count} frames as its header says, found it ending before frame "
        f"{number} ({number / rate:g} s)"
        for number in numbers[decoded:]
    )
    if lines and not (options.skip and decoded):
        raise BadFrame(lines[0])
    return lines


class _Reader:
    """Frames of a video by their numbers, each as it was when the video was opened."""

    def __init__(
        self,
        path: Path,
        size: tuple[int, int],
        numbers: np.ndarray,
        checks: list[int],
        options: Options,
    ) -> None:
        self.path, self.size, self.options = path, size, options
        self.numbers, self.checks = numbers, checks
        self.capture: cv2.VideoCapture | None = None
        self.next = 0
        self.lock = threading.Lock()

    def read(self, index: np.ndarray) -> np.ndarray:
        out = np.empty((len(index), *self.options.window.shape(*self.size)), np.uint8)
        with self.lock, quiet_opencv():
            for k in np.argsort(index, kind="stable"):  # forwards, whatever was asked first
                out[k] = self._frame(int(index[k]))
        return out

    def _frame(self, i: int) -> np.ndarray:
        number = int(self.numbers[i])
        for attempt in (self._forward, self._from_the_start):
            image = attempt(number)
            if image is not None and zlib.crc32(image.data) == self.checks[i]:
                return image
        raise BadFrame(f"{shown(self.path)}: expected frame {number} as it was opened, found other")

    def _forward(self, number: int) -> np.ndarray | None:
        if self.capture is None:
            self.capture, self.next = _open(self.path), 0
        if not 0 <= number - self.next <= _SEEK:
            self.capture.set(cv2.CAP_PROP_POS_FRAMES, number)
            self.next = number
        return self._decode(self.capture, number)

    def _from_the_start(self, number: int) -> np.ndarray | None:
        self.capture, self.next = _open(self.path), 0
        return self._decode(self.capture, number)

    def _decode(self, capture: cv2.VideoCapture, number: int) -> np.ndarray | None:
        while self.next <= number:
            if not capture.grab():
                return None
            self.next += 1
        return _retrieve(capture, self.size, self.options)
