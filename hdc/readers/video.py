"""A video with a table: labelled intervals, or a row of values a frame; or frame by frame.

A frame belongs to the interval with start ≤ time < end; frames outside all intervals are left out.
Times are those of the container, in seconds from its first frame, evenly spaced or not. OpenCV
gives 8 bits per pixel, whatever was stored. The frames that are used are kept in memory.

The video is decoded once, from its beginning: seeking is slow, and not exact in every container
(opencv/opencv issues 4890 and 9053).
"""

from __future__ import annotations

import hashlib
import math
from bisect import bisect_right
from collections.abc import Iterator, Sequence
from functools import cache
from itertools import count, pairwise
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from hdc.readers.columns import Columns
from hdc.readers.files import BadFrame, file_digest, parse_number, read_csv
from hdc.readers.images import grey, quiet
from hdc.readers.recording import (
    Recording,
    Window,
    check_times,
    class_indices,
    with_progress,
)

_ROUNDED_S = 1e-3
"""Some containers round their times to this."""
_EARLY_S = 1e-5
"""Frames so much before an interval belong to it: 3 × 0.1 s is after 0.3 s, in floats."""


def open_video(
    path: Path, table: Path, window: Window, fewest_classes: int
) -> Recording:
    """Open a video and its table of intervals; see the module's description.

    Raises:
        BadFrame: the video ends before its header says, or has lost frames.
        ValueError: the video or its table is not as described, or a crop does not fit.
    """
    intervals = _intervals(table)
    starts = [start - _EARLY_S for start, _, _ in intervals]
    last = intervals[-1][1]
    numbers, times, members, frames = [], [], [], []
    for number, (time, frame) in enumerate(stream_video(path, window, last)):
        member = bisect_right(starts, time) - 1
        if member >= 0 and time < intervals[member][1] - _EARLY_S:
            numbers.append(number)
            times.append(time)
            members.append(member)
            frames.append(frame)
    empty = sorted(set(range(len(intervals))) - set(members))
    if empty:
        start, end, _ = intervals[empty[0]]
        wanted = f"intervals of at least one frame of {path.name}"
        raise ValueError(f"{table}: expected {wanted}, found {start:g}–{end:g} s")
    labels = [intervals[m][2] for m in members]
    classes, indices = class_indices(labels, f"{path} with {table}", fewest_classes)
    samples = {
        "order": np.arange(len(numbers)),
        "frame": np.array(numbers),
        "time": np.array(times),  # seconds
        "interval": np.array(members),
    }
    return _recording(
        path, window, frames, samples, {"classes": classes, "labels": indices}
    )


def open_video_of_values(
    path: Path,
    table: Path,
    window: Window,
    value_columns: Sequence[str],
    fewest_classes: int,
) -> Recording:
    """Open a video and a table with a row a frame: its number from 0 as ``frame``, and values.

    ``label``, ``order``, ``session`` and ``group`` are known by name, as in a table of images;
    frames without a row are left out.

    Raises:
        BadFrame: the video ends before its header says, or has lost frames.
        ValueError: the video or its table is not as described, or a crop does not fit.
    """
    rows: dict[int, dict[str, str]] = {}
    places = []
    for place, row in read_csv(table, ("frame", *value_columns)):
        text = row.pop("frame")
        if not text.isdecimal() or int(text) in rows:
            wanted = "a number of a frame from 0, each once"
            raise ValueError(f"{place}: expected {wanted}, found {text!r}")
        rows[int(text)] = row
        places.append(place)
    if not rows:
        raise ValueError(f"{table}: expected at least one row, found none")
    columns = Columns.of(places, list(rows.values()))
    labels = columns.pop_labels()
    samples = columns.samples()
    check_times(table, samples, len(rows))
    names = tuple(value_columns) or tuple(columns.numeric())
    if labels is None and not names:
        raise ValueError(f"{table}: expected columns of numbers, found none")
    about: dict[str, Any] = {"classes": (), "labels": None}
    if labels is not None:
        indices = class_indices(labels, table, fewest_classes)
        about = dict(zip(("classes", "labels"), indices, strict=True))
    frames, times = _numbered_frames(path, table, window, list(rows))
    samples |= {"frame": np.array(list(rows)), "time": np.array(times)}
    samples = {"order": samples["frame"], **samples}
    about |= {"values": columns.values(names), "value_names": names}
    return _recording(path, window, frames, samples, about)


def _numbered_frames(
    path: Path, table: Path, window: Window, numbers: list[int]
) -> tuple[list[np.ndarray], list[float]]:
    """Frames of these numbers and their times in s."""
    wanted = set(numbers)
    found = {}
    n = 0
    for number, (time, frame) in enumerate(stream_video(path, window)):
        n = number + 1
        if number in wanted:
            found[number] = time, frame
    missing = sorted(wanted - set(found))
    if missing:
        wanted_numbers = f"numbers of the {n} frames of {path.name}, from 0"
        raise ValueError(f"{table}: expected {wanted_numbers}, found {missing[0]}")
    chosen = [found[number] for number in numbers]
    return [frame for _, frame in chosen], [time for time, _ in chosen]


def _recording(
    path: Path,
    window: Window,
    frames: list[np.ndarray],
    samples: dict[str, np.ndarray],
    about: dict[str, Any],
) -> Recording:
    """The recording of frames that were decoded.

    Raises:
        ValueError: all are the same image.
    """
    if len(frames) > 1 and all(np.array_equal(frame, frames[0]) for frame in frames):
        raise ValueError(
            f"{path}: expected frames that differ, found the same image again and again; OpenCV "
            f"reads no interlaced video (ffmpeg -i {path.name} -vf yadif … deinterlaces)"
        )
    numbers = samples["frame"].tolist()

    def digest() -> str:
        used = hashlib.sha256(np.array(numbers, dtype="<i8").tobytes()).hexdigest()
        return repr((file_digest(path), used))

    return Recording(
        shape=frames[0].shape,
        dtype=frames[0].dtype,
        samples=samples,
        each=lambda index: (frames[i] for i in index),
        place=lambda i: f"{path}, frame {numbers[i]}",
        digest=cache(digest),
        window=window,
        **about,
    )


def _intervals(table: Path) -> list[tuple[float, float, str]]:
    """Start and end in s and label of each interval, in order of time."""
    intervals = []
    for where, row in read_csv(table, required=("start_s", "end_s", "label")):
        start, end = (_seconds(where, row[name]) for name in ("start_s", "end_s"))
        if not 0 <= start < end < math.inf:
            raise ValueError(
                f"{where}: expected 0 ≤ start_s < end_s, found {start}, {end}"
            )
        intervals.append((start, end, row["label"]))
    if not intervals:
        raise ValueError(f"{table}: expected at least one row, found none")
    intervals.sort()
    for (start, end, _), (later, last, _) in pairwise(intervals):
        if later < end:
            found = f"{start:g}–{end:g} s and {later:g}–{last:g} s"
            raise ValueError(
                f"{table}: expected intervals that do not overlap, found {found}"
            )
    return intervals


def _seconds(where: str, text: str) -> float:
    try:
        seconds = float(text)
    except ValueError as error:
        raise ValueError(f"{where}: expected seconds, found: {error}") from error
    if parse_number(text) is None and math.isfinite(seconds):  # such as 1_0
        raise ValueError(f"{where}: expected seconds, found {text!r}")
    return seconds


# Decoding ----------------------------------------------------------------------------------------


def stream_video(
    path: Path, window: Window, end: float = math.inf
) -> Iterator[tuple[float, np.ndarray]]:
    """Time in s and grey frame [H, W] of each frame of a video before ``end`` in s.

    Raises:
        BadFrame: it ends before its header says, and before ``end``; or frames are missing from a
            video of an even rate.
        ValueError: it is no video that is read here.
    """
    with quiet():
        video = _Video(path, end)
        total = math.ceil(min(video.length, end * video.rate))
        for _ in with_progress(count(), total, "Reading video"):
            time = video.grab()
            if time is None or time >= end - _EARLY_S:
                video.check_whole()
                return
            yield time, grey(window.of(video.image(time)))


class _Video:
    """A video that is decoded frame after frame, with what its times tell of missing frames.

    Args:
        path: of the file.
        end: time in s up to which the video is needed.

    Raises:
        ValueError: it is no video that is read here.
    """

    def __init__(self, path: Path, end: float) -> None:
        # One thread: several conceal what is damaged in a different way each time.
        one_thread = [cv2.CAP_PROP_N_THREADS, 1]
        source = str(path.resolve())
        self._capture = cv2.VideoCapture(source, cv2.CAP_FFMPEG, one_thread)
        self._path, self._end = path, end
        self.rate = self._capture.get(cv2.CAP_PROP_FPS)
        self.length = self._capture.get(cv2.CAP_PROP_FRAME_COUNT)
        if not (self._capture.isOpened() and self.rate > 0 and self.length > 0):
            found = f"{self.length:g} frames at {self.rate:g} Hz"
            raise ValueError(f"{path}: expected a video of known length, found {found}")
        self._grabbed = 0
        self._first = 0.0
        self._before = -math.inf
        self._ended = False
        self._steps = [0, 0]  # even ones, and those over several periods
        self._widest = 1 / self.rate

    def grab(self) -> float | None:
        """Time in s of the next frame; None after the last."""
        if not self._capture.grab():
            self._ended = True
            return None
        stated = self._capture.get(cv2.CAP_PROP_POS_MSEC) / 1e3
        even = self._grabbed / self.rate
        if self._grabbed == 0:
            self._first = stated
        time = stated - self._first
        if abs(time - even) <= _ROUNDED_S:
            time = even
        if time <= self._before:
            found = (
                f"frame {self._grabbed} at {time:g} s after one at {self._before:g} s"
            )
            raise ValueError(
                f"{self._path}: expected frames one after the other, found {found}"
            )
        if self._grabbed:
            self._count_step(time - self._before)
        self._before = time
        self._grabbed += 1
        return time

    def _count_step(self, step: float) -> None:
        periods = step * self.rate
        if abs(step - round(periods) / self.rate) <= 2 * _ROUNDED_S:
            self._steps[round(periods) > 1] += 1
        self._widest = max(self._widest, step)

    def image(self, time: float) -> np.ndarray:
        """The frame that was grabbed last."""
        ok, image = self._capture.retrieve()
        if not ok:
            raise BadFrame(f"{self._path}: expected a frame at {time:g} s, found none")
        return image

    def check_whole(self) -> None:
        """Raise a BadFrame where the part up to the end lacks frames."""
        wanted = f"{self.length:g} frames as its header says"
        missing = self._grabbed < self.length - 1
        # A header may only estimate the number of frames, so times are asked as well.
        last = min(self._end, self.length / self.rate) - _EARLY_S
        if self._ended and missing and self._before + self._widest < last:
            raise BadFrame(f"{self._path}: expected {wanted}, found {self._grabbed}")
        even, wide = self._steps
        if wide == 0 or 9 * wide > even:
            return  # nothing is missing, or the rate varies
        while self.grab() is not None:
            pass
        if self._grabbed < self.length:
            raise BadFrame(
                f"{self._path}: expected {wanted}, found {self._grabbed} with gaps between: some "
                "are damaged (if its rate varies, ffmpeg -i … -c copy out.mp4 counts its frames)"
            )
