"""A video with a table: labelled intervals, or a row of values a frame; or frame by frame.

A frame belongs to the interval with start ≤ time < end, and has its label, session and group.
Where neither sessions nor groups say what was recorded together, an interval is a group.
Frames outside all intervals are left out. PyAV (FFmpeg) decodes. Times are those of the container,
in seconds from its first frame, evenly spaced or not. A frame is turned as the file says. Grey of
more than 8 bits comes as it is stored.

The video is decoded from its beginning: seeking is slow, and not exact in every container. Frames
that fit are kept in memory.
"""

from __future__ import annotations

import hashlib
import math
from bisect import bisect_right
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import cache
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple

import av
import numpy as np

from hdc.readers.columns import Columns, class_indices
from hdc.readers.files import (
    BadFrame,
    check_file,
    columns_of,
    file_digest,
    parse_number,
    read_csv,
)
from hdc.readers.images import grey
from hdc.readers.recording import Recording, Window

_EARLY_S = 5.1e-4
"""Frames so much before an interval belong to it: some containers round their times to 1 ms."""


def open_video(
    path: Path,
    table: Path,
    window: Window,
    value_columns: Sequence[str] | None,
    fewest_classes: int,
    memory_bytes: int,
) -> Recording:
    """Open a video and its table, which has a row per interval or a row per frame.

    A row per interval has ``start_s``, ``end_s`` and ``label``, and may have ``session`` and
    ``group``; one per frame has ``frame``, its number from 0, and labels or values. With
    ``value_columns`` None all columns of numbers are values.

    Raises:
        BadFrame: the video ends before its header says, or has lost frames.
        ValueError: the video or its table is not as described, or a crop does not fit.
    """
    if not table.is_file():
        wanted = "a table with start_s, end_s and label, or with a row per frame"
        raise ValueError(f"{table}: expected {wanted}, found none (--values names it)")
    film = Film(path, window)
    columns = columns_of(table)
    if "frame" in columns:
        about = _of_frames(table, film, value_columns, fewest_classes, memory_bytes)
    elif "start_s" in columns:
        about = _of_intervals(table, film, fewest_classes, memory_bytes)
    else:
        raise ValueError(
            f"{table}: expected a column frame, or start_s, end_s and label, found "
            f"{', '.join(columns)}"
        )
    numbers = about["samples"]["frame"]
    about["samples"] = {"order": np.arange(len(numbers)), **about["samples"]}

    def digest() -> str:
        used = hashlib.sha256(numbers.astype("<i8").tobytes()).hexdigest()
        return repr((file_digest(path), used))

    return Recording(
        frame_shape=film.shape,
        dtype=film.dtype,
        each=lambda index: film.each(numbers[index].tolist()),
        place=lambda i: f"{path}, frame {numbers[i]}",
        digest=cache(digest),
        window=window,
        notes=tuple(film.notes),
        **about,
    )


def _of_intervals(
    table: Path, film: Film, fewest_classes: int, memory_bytes: int
) -> dict[str, Any]:
    intervals = _intervals(table)
    starts = [interval.start - _EARLY_S for interval in intervals]

    def interval_of(time: float) -> int:
        """The number of the interval at a time; -1 between them."""
        number = bisect_right(starts, time) - 1
        return number if time < intervals[number].end - _EARLY_S else -1

    end = intervals[-1].end
    found = film.read(lambda _, time: interval_of(time) >= 0, memory_bytes, end)
    members = [interval_of(time) for time in found.values()]
    empty = sorted(set(range(len(intervals))) - set(members))
    if empty:
        wanted = f"intervals of at least one frame of {film.path.name}"
        raise ValueError(f"{table}: expected {wanted}, found {intervals[empty[0]]}")
    labels = [intervals[m].row["label"] for m in members]
    where = f"{film.path} with {table}"
    classes, indices = class_indices(labels, where, fewest_classes)
    samples = {
        "frame": np.array(list(found)),
        "time": np.array(list(found.values())),  # seconds
        "interval": np.array(members),
    }
    places = [interval.place for interval in intervals]
    columns = Columns.of(places, [interval.row for interval in intervals])
    for name, numbers in columns.only(("session", "group")).samples().items():
        samples[name] = numbers[members]
    if "group" not in samples and len(np.unique(samples.get("session", 0))) < 2:
        alone = _of_one_interval(indices, samples["interval"])
        if not alone.all():
            apart = len(intervals) + np.arange(len(indices))
            samples["group"] = np.where(alone, apart, samples["interval"])
            names = ", ".join(classes[c] for c in np.unique(indices[alone]))
            _note(
                film.notes,
                names != "",
                f"{names}: one interval, whose frames are split",
            )
    return {"classes": classes, "labels": indices, "samples": samples}


def _of_one_interval(labels: np.ndarray, intervals: np.ndarray) -> np.ndarray:
    """Which frames [N] are of a class of a single interval."""
    pairs = np.unique(np.stack([labels, intervals]), axis=1)
    return np.bincount(pairs[0])[labels] == 1


def _of_frames(
    table: Path,
    film: Film,
    value_columns: Sequence[str] | None,
    fewest_classes: int,
    memory_bytes: int,
) -> dict[str, Any]:
    columns = Columns.read(table, ("frame", *(value_columns or ())))
    rows: dict[int, str] = {}
    for place, text in zip(columns.places, columns.texts.pop("frame"), strict=True):
        if not text.isdecimal() or int(text) in rows:
            wanted = "a number of a frame from 0, each once"
            raise ValueError(f"{place}: expected {wanted}, found {text!r}")
        rows[int(text)] = place
    about = columns.about(table, fewest_classes, value_columns)
    times = film.read(lambda number, _: number in rows, memory_bytes)
    if missing := sorted(set(rows) - set(times)):
        wanted = f"numbers of the {film.count} frames of {film.path.name}, from 0"
        raise ValueError(f"{table}: expected {wanted}, found {missing[0]}")
    about["samples"] |= {
        "frame": np.array(list(rows)),
        "time": np.array([times[number] for number in rows]),
    }
    about["samples"] = {"order": about["samples"]["frame"], **about["samples"]}
    return about


class _Interval(NamedTuple):
    """A row of a table, and its start and end in s."""

    start: float
    end: float
    place: str
    row: dict[str, str]

    def __str__(self) -> str:
        return f"{self.start:g}–{self.end:g} s"


def _intervals(table: Path) -> list[_Interval]:
    """The intervals of a table, in order of time."""
    intervals = []
    for where, row in read_csv(table, required=("start_s", "end_s", "label")):
        start, end = (_seconds(where, row[name]) for name in ("start_s", "end_s"))
        if not 0 <= start < end:
            raise ValueError(
                f"{where}: expected 0 ≤ start_s < end_s, found {start}, {end}"
            )
        intervals.append(_Interval(start, end, where, row))
    if not intervals:
        raise ValueError(f"{table}: expected at least one row, found none")
    intervals.sort(key=lambda interval: interval.start)
    for first, second in pairwise(intervals):
        if second.start < first.end:
            wanted = "intervals that do not overlap"
            raise ValueError(f"{table}: expected {wanted}, found {first} and {second}")
    return intervals


def _seconds(where: str, text: str) -> float:
    seconds = parse_number(text)
    if seconds is None:
        raise ValueError(f"{where}: expected seconds, found {text!r}")
    return seconds


# Decoding ----------------------------------------------------------------------------------------


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
        if all(first < second for first, second in pairwise(numbers)):
            return self._decoded(numbers)
        ordered = sorted(set(numbers))
        found = dict(zip(ordered, self._decoded(ordered), strict=True))
        return (found[number] for number in numbers)

    def _decoded(self, numbers: Sequence[int]) -> Iterator[np.ndarray]:
        wanted, last = set(numbers), max(numbers, default=-1)
        for number, (_, frame) in enumerate(stream_video(self.path, self._window)):
            if number in wanted:
                yield frame
            if number >= last:
                return


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
    with opened(path) as (container, stream):
        times = _Times(path, container, stream)
        for frame in container.decode(stream):
            time = times.of(frame)
            if time >= end - _EARLY_S:
                times.check_whole(before_its_end=True)
                return
            if frame.is_corrupt:
                raise BadFrame(
                    f"{path}: expected whole frames, found a damaged one at {time:g} s"
                )
            yield time, grey(window.of(_pixels(frame, found)))
        times.check_whole()


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
            streams[0].thread_type = "NONE"
            streams[0].codec_context.options = {"err_detect": "explode"}
            yield container, streams[0]
    except av.error.FFmpegError as error:
        raise BadFrame(
            f"{path}: expected a whole video, found: {error.strerror}"
        ) from error


class _Times:
    """Times of frames, and what they tell of missing ones."""

    def __init__(self, path: Path, container: Any, stream: Any) -> None:
        self._path, self._stated = path, stream.frames
        self._end_s = _stated_end(container, stream)
        self._times: list[float] = []
        self._first = 0.0
        self._lasts = 0.0

    def of(self, frame: Any) -> float:
        """Seconds of a frame from the first one."""
        if frame.time is None:
            raise BadFrame(f"{self._path}: expected a time of each frame, found none")
        if not self._times:
            self._first = frame.time
        time = frame.time - self._first
        if self._times and time <= self._times[-1]:
            n = len(self._times)
            found = f"frame {n} at {time:g} s after one at {self._times[-1]:g} s"
            raise BadFrame(
                f"{self._path}: expected frames one after the other, found {found}"
            )
        self._times.append(time)
        self._lasts = float((frame.duration or 0) * frame.time_base)
        return time

    def check_whole(self, before_its_end: bool = False) -> None:
        """Raise BadFrame unless there are as many frames, or seconds, as the header states.

        Where it states no frames, a gap in steps that are even but for one in ten is a loss.
        """
        n = len(self._times)
        if n == 0 and not before_its_end:
            raise BadFrame(f"{self._path}: expected frames, found none")
        if self._stated:
            if n < self._stated and not before_its_end:
                wanted = f"{self._stated} frames as its header says"
                raise BadFrame(f"{self._path}: expected {wanted}, found {n}")
            return
        steps = np.diff(self._times)
        step = max(self._lasts, *steps.tolist(), 0.0)
        last = self._first + self._times[-1] if n else self._end_s
        if last + 1.5 * step < self._end_s and not before_its_end:
            wanted = f"{self._end_s:g} s as its header says"
            raise BadFrame(
                f"{self._path}: expected {wanted}, found {n} frames to {last:g} s"
            )
        wide = int((steps > 1.5 * np.median(steps)).sum()) if n > 2 else 0
        if 0 < 9 * wide < len(steps):
            raise BadFrame(
                f"{self._path}: expected frames at an even rate, found {wide} gaps: some are lost "
                "(if its rate varies, ffmpeg -i … -c copy out.mp4 counts its frames)"
            )


def _stated_end(container: Any, stream: Any) -> float:
    """Seconds to which a header says that the video goes on; 0 where it says nothing."""
    if len(container.streams) > 1 or container.duration is None:
        return 0.0
    return float(container.duration / av.time_base)


def _pixels(frame: Any, notes: list[str]) -> np.ndarray:
    """Pixels [H, W] or [H, W, 3] (blue first) of a decoded frame, turned as the file says."""
    bits = max(component.bits for component in frame.format.components)
    is_grey = len(frame.format.components) == 1
    if is_grey and frame.format.name.startswith("gray"):
        image = frame.to_ndarray()
        _note(notes, bits > 8, f"{bits} bits per pixel")
    elif bits > 8:
        image = frame.to_ndarray(format="gray16le")
        _note(notes, True, f"luminance of {bits} bits, scaled to 16")
    else:
        image = frame.to_ndarray(format="bgr24")
    turns = round(frame.rotation / 90) % 4
    _note(notes, turns != 0, f"turned by {90 * turns}° as the file says")
    _note(
        notes, frame.interlaced_frame, "interlaced: ffmpeg -vf yadif separates fields"
    )
    return np.rot90(image, turns)


def _note(notes: list[str], condition: bool, text: str) -> None:
    if condition and text not in notes:
        notes.append(text)
