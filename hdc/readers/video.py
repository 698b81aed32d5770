"""A video with a table of labelled intervals, or frame by frame.

A frame belongs to the interval with start ≤ time < end; frames outside all intervals are left out.
Times are those of the container, in seconds from its first frame, evenly spaced or not. OpenCV
gives 8 bits per pixel, whatever was stored. The labelled frames are kept in memory.

The video is decoded once, from its beginning: seeking is slow, and not exact in every container
(opencv/opencv issues 4890 and 9053).
"""

from __future__ import annotations

import hashlib
import math
from bisect import bisect_right
from collections.abc import Iterator
from functools import cache
from itertools import count, pairwise
from pathlib import Path

import cv2
import numpy as np

from hdc.readers.files import BadFrame, file_digest, read_csv
from hdc.readers.images import grey, quiet
from hdc.readers.recording import Recording, Window, class_indices, with_progress

_ROUNDED_S = 1e-3
"""Some containers round their times to this."""
_EARLY_S = 1e-5
"""Frames so much before an interval belong to it: 3 × 0.1 s is after 0.3 s, in floats."""


def open_video(
    path: Path, table: Path, window: Window, fewest_classes: int
) -> Recording:
    """Open a video and its table of intervals; see the module's description.

    Raises:
        BadFrame: the video ends before its header says.
        ValueError: the video or its table is not as described, or a crop does not fit.
    """
    intervals = _intervals(table)
    starts = [start - _EARLY_S for start, _, _ in intervals]
    numbers, times, members, frames = [], [], [], []
    for number, (time, frame) in enumerate(
        stream_video(path, window, intervals[-1][1])
    ):
        member = bisect_right(starts, time) - 1
        if member >= 0 and time < intervals[member][1] - _EARLY_S:
            numbers.append(number)
            times.append(time)
            members.append(member)
            frames.append(frame)
    for m, (start, end, _) in enumerate(intervals):
        if m not in members:
            wanted = f"intervals of at least one frame of {path.name}"
            raise ValueError(f"{table}: expected {wanted}, found {start:g}–{end:g} s")
    if len(frames) > 1 and all(np.array_equal(frame, frames[0]) for frame in frames):
        raise ValueError(
            f"{path}: expected frames that differ, found the same image again and again; OpenCV "
            f"reads no interlaced video (ffmpeg -i {path.name} -vf yadif … deinterlaces)"
        )
    classes, labels = class_indices(
        [intervals[m][2] for m in members], f"{path} with {table}", fewest_classes
    )

    def digest() -> str:
        labelled = hashlib.sha256(np.array(numbers, dtype="<i8").tobytes()).hexdigest()
        return repr((file_digest(path), labelled))

    return Recording(
        classes=classes,
        labels=labels,
        shape=frames[0].shape,
        samples={
            "order": np.arange(len(numbers)),
            "frame": np.array(numbers),
            "time": np.array(times),  # seconds
            "interval": np.array(members),
        },
        each=lambda index: (frames[i] for i in index),
        place=lambda i: f"{path}, frame {numbers[i]}",
        digest=cache(digest),
        window=window,
    )


def _intervals(table: Path) -> list[tuple[float, float, str]]:
    """Start and end in s and label of each interval, in order of time."""
    intervals = []
    for where, row in read_csv(table, required=("start_s", "end_s", "label")):
        try:
            start, end = float(row["start_s"]), float(row["end_s"])
        except ValueError as error:
            raise ValueError(f"{where}: expected seconds, found: {error}") from error
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


def stream_video(
    path: Path, window: Window, end: float = math.inf
) -> Iterator[tuple[float, np.ndarray]]:
    """Time in s and grey frame [H, W] of each frame of a video before ``end`` in s.

    Raises:
        BadFrame: it ends before its header says, and before ``end``.
        ValueError: it is no video that is read here.
    """
    # One thread: several conceal what is damaged in a different way each time.
    one_thread = [cv2.CAP_PROP_N_THREADS, 1]
    with quiet():
        capture = cv2.VideoCapture(str(path.resolve()), cv2.CAP_FFMPEG, one_thread)
        rate, length = (
            capture.get(cv2.CAP_PROP_FPS),
            capture.get(cv2.CAP_PROP_FRAME_COUNT),
        )
        if not (capture.isOpened() and rate > 0 and length > 0):
            raise ValueError(
                f"{path}: expected a video of known length, found {length:g} frames at {rate:g} Hz"
            )
        first, before = 0.0, -math.inf
        total = math.ceil(min(length, end * rate))
        for number in with_progress(count(), total, "Reading video"):
            if not capture.grab():
                if number < length - 1 and before + 1 / rate < end < math.inf:
                    wanted = f"{length:g} frames as its header says"
                    raise BadFrame(f"{path}: expected {wanted}, found {number}")
                return
            stated, even = capture.get(cv2.CAP_PROP_POS_MSEC) / 1e3, number / rate
            first = first if number else stated
            time = even if abs(stated - first - even) <= _ROUNDED_S else stated - first
            if time <= before:
                found = f"frame {number} at {time:g} s after one at {before:g} s"
                raise ValueError(
                    f"{path}: expected frames one after the other, found {found}"
                )
            if time >= end - _EARLY_S:
                return
            ok, image = capture.retrieve()
            if not ok:
                raise BadFrame(f"{path}: expected a frame at {time:g} s, found none")
            yield time, grey(window.of(image))
            before = time
