"""A video with a table of labelled intervals, or frame by frame, and a camera.

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
from collections.abc import Callable, Iterator
from functools import cache
from itertools import count, groupby, pairwise
from operator import itemgetter
from pathlib import Path
from typing import NamedTuple

import cv2
import numpy as np

from hdc.readers.files import BadFrame, read_csv
from hdc.readers.images import grey, quiet
from hdc.readers.recording import Recording, Window, class_indices, with_progress

_ROUNDED_S = 1e-3
"""Some containers round their times to this."""
_EARLY_S = 1e-5
"""Frames so much before an interval belong to it: 3 × 0.1 s is after 0.3 s, in floats."""


class _Interval(NamedTuple):
    start: float
    end: float
    label: str


def open_video(path: Path, table: Path, window: Window, fewest_classes: int) -> Recording:
    """Open a video and its table of intervals; see the module's description.

    Raises:
        BadFrame: the video is damaged, or ends before its header says.
        ValueError: the video or its table is not as described, or a crop does not fit.
    """
    intervals = _intervals(table)
    starts = [interval.start - _EARLY_S for interval in intervals]

    def member(time: float) -> int | None:
        m = bisect_right(starts, time) - 1
        return m if m >= 0 and time < intervals[m].end - _EARLY_S else None

    decoded = list(_frames(path, window, lambda t: member(t) is not None, intervals[-1].end))
    numbers, times = [n for n, _, _ in decoded], [t for _, t, _ in decoded]
    members = [m for m in map(member, times) if m is not None]
    for m, (start, end, _) in enumerate(intervals):
        if m not in members:
            raise ValueError(
                f"{table}: expected intervals of at least one frame of {path.name}, found "
                f"{start:g}–{end:g} s"
            )
    classes, labels = class_indices(
        [intervals[m].label for m in members], f"{path} with {table}", fewest_classes
    )

    def digest() -> str:
        with path.open("rb") as file:
            content = hashlib.file_digest(file, "sha256").hexdigest()
        labelled = np.array(numbers, dtype="<i8").tobytes()
        return repr((content, hashlib.sha256(labelled).hexdigest()))

    return Recording(
        classes=classes,
        labels=labels,
        shape=decoded[0][2].shape,
        samples={
            "order": np.arange(len(numbers)),
            "frame": np.array(numbers),
            "time": np.array(times),  # seconds
            "interval": np.array(members),
        },
        each=lambda index: (decoded[i][2] for i in index),
        place=lambda i: f"{path}, frame {numbers[i]}",
        digest=cache(digest),
        window=window,
    )


def stream_video(path: Path, window: Window) -> Iterator[tuple[float, np.ndarray]]:
    """Times in s and grey frames [H, W] of a whole video.

    Raises:
        ValueError: it is no video that is read here.
    """
    return ((time, frame) for _, time, frame in _frames(path, window))


def _intervals(table: Path) -> list[_Interval]:
    intervals = []
    for where, row in read_csv(table, required=("start_s", "end_s", "label")):
        try:
            start, end = float(row["start_s"]), float(row["end_s"])
        except ValueError as error:
            raise ValueError(f"{where}: expected seconds, found: {error}") from error
        if not 0 <= start < end < math.inf:
            raise ValueError(f"{where}: expected 0 ≤ start_s < end_s, found {start}, {end}")
        intervals.append(_Interval(start, end, row["label"]))
    intervals.sort()
    for before, after in pairwise(intervals):
        if after.start < before.end:
            raise ValueError(
                f"{table}: expected intervals that do not overlap, found "
                f"{before.start:g}–{before.end:g} s and {after.start:g}–{after.end:g} s"
            )
    return intervals


def _frames(
    path: Path,
    window: Window,
    wanted: Callable[[float], bool] = lambda time: True,
    end: float = math.inf,
) -> Iterator[tuple[int, float, np.ndarray]]:
    """Number, time in s and grey frame [H, W] of each frame before `end` whose time is wanted."""
    # One thread: several conceal what is damaged in a different way each time.
    one_thread = [cv2.CAP_PROP_N_THREADS, 1]
    with quiet():
        capture = cv2.VideoCapture(str(path.resolve()), cv2.CAP_FFMPEG, one_thread)
        rate, length = capture.get(cv2.CAP_PROP_FPS), capture.get(cv2.CAP_PROP_FRAME_COUNT)
        if not (capture.isOpened() and 0 < rate < 1e6 and 0 < length < 2**40):
            raise ValueError(
                f"{path}: expected a video of known length, found {length:g} frames at {rate:g} Hz"
            )
        checksums: list[tuple[int, int]] = []
        first, before, gap = 0.0, -math.inf, 1 / rate
        total = math.ceil(min(length, end * rate))
        for number in with_progress(count(), total, "Reading video"):
            if not capture.grab():
                if before + gap < end < math.inf and number < length - 1:
                    raise BadFrame(
                        f"{path}: expected {length:g} frames as its header says, found {number}"
                    )
                break
            stated, even = capture.get(cv2.CAP_PROP_POS_MSEC) / 1e3, number / rate
            first = first if number else stated
            # OpenCV says 0 where an AVI states no time: for the last frames, as it is decoded.
            time = stated - first if stated or not number else even
            time = even if abs(time - even) <= _ROUNDED_S else time
            if not before < time < math.inf:
                raise ValueError(
                    f"{path}: expected frames one after the other, found frame {number} at "
                    f"{time:g} s after one at {before:g} s"
                )
            if time >= end - _EARLY_S:
                break
            if wanted(time):
                ok, image = capture.retrieve()
                if not ok or image.dtype != np.uint8:
                    raise BadFrame(f"{path}: expected a frame at {time:g} s, found none")
                checksums.append((number, zlib.crc32(image.data)))
                yield number, time, grey(window.of(image))
            gap, before = max(gap, time - before) if number else gap, time
        _check_progressive(path, capture, checksums)


def _check_progressive(
    path: Path, capture: cv2.VideoCapture, checksums: list[tuple[int, int]]
) -> None:
    """Refuse interlaced frames.

    OpenCV 5 says it retrieved an interlaced frame and leaves its buffer as it was: garbage at
    first, then a copy of another frame. So the last frame of the first and of the longest run of
    equal ones are retrieved again, after another image: if it comes out different, it is
    interlaced.

    Raises:
        ValueError: a frame is interlaced, or all frames are alike, which looks the same.
    """
    if not checksums:
        return

    def again(number: int) -> int:
        capture.set(cv2.CAP_PROP_POS_FRAMES, 0)
        for _ in range(number + 1):
            capture.grab()
        ok, image = capture.retrieve()
        return zlib.crc32(image.data) if ok else -1

    runs = [list(run) for _, run in groupby(checksums, key=itemgetter(1))]
    for last, checksum in (runs[0][-1], max(runs, key=len)[-1]):
        other = next((number for number, found in checksums if found != checksum), None)
        if other is not None:
            again(other)
        if other is None or again(last) != checksum:
            raise ValueError(
                f"{path}: expected progressive frames, found what OpenCV {cv2.__version__} makes "
                f"of interlaced ones, the same image again and again (ffmpeg -i {path.name} -vf "
                "yadif … deinterlaces)"
            )


def camera_frames(index: int, window: Window) -> Iterator[np.ndarray]:
    """See :func:`hdc.readers.camera`."""
    with quiet():
        capture = cv2.VideoCapture(index)
    if not capture.isOpened():
        raise ValueError(
            f"camera: expected a camera that can be opened at index {index}, found none (is it "
            "connected, in use by another program, or not permitted?)"
        )

    def frames() -> Iterator[np.ndarray]:
        try:
            while True:
                ok, image = capture.read()
                if not ok:
                    raise BadFrame(f"camera {index}: expected a frame, found none (disconnected?)")
                yield grey(window.of(image))
        finally:
            capture.release()

    return frames()
