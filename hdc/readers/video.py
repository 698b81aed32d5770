"""A video with a table: labelled intervals, or a row of labels or values a frame.

A frame belongs to the interval with start ≤ time < end, and has its label, session and group.
Where neither sessions nor groups say what was recorded together, an interval is a group.
Frames outside all intervals are left out.
"""

from __future__ import annotations

import hashlib
from bisect import bisect_right
from dataclasses import replace
from functools import cache
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

import numpy as np

from hdc.readers.about import About, Asked, Columns
from hdc.readers.files import (
    columns_in,
    file_digest,
    parse_number,
    read_csv,
)
from hdc.readers.film import EARLY_S, Film, note
from hdc.readers.recording import Recording, Window


def open_video(
    path: Path, window: Window, asked: Asked, memory_bytes: int
) -> Recording:
    """Open a video and its table, which has a row per interval or a row per frame.

    The table is beside it by default, its suffix replaced by .csv. A row per interval has
    ``start_s``, ``end_s`` and ``label``, and may have ``session`` and ``group``; one per frame has
    ``frame``, its number from 0, and labels or values.

    Raises:
        BadFrame: the video ends before its header says, or has lost frames.
        ValueError: the video or its table is not as described, or a crop does not fit.
    """
    table = asked.table or path.with_suffix(".csv")
    if not table.is_file():
        wanted = "a table with start_s, end_s and label, or with a row per frame"
        raise ValueError(f"{table}: expected {wanted}, found none (--values names it)")
    film = Film(path, window)
    names = columns_in(table)
    if "frame" in names:
        about = _of_frames(table, film, asked, memory_bytes)
    elif "start_s" in names:
        about = _of_intervals(table, film, asked.fewest_classes, memory_bytes)
    else:
        raise ValueError(
            f"{table}: expected a column frame, or start_s, end_s and label, found "
            f"{', '.join(names)}"
        )
    numbers = about.samples["frame"]

    def digest() -> str:
        used = hashlib.sha256(numbers.astype("<i8").tobytes()).hexdigest()
        return repr((file_digest(path), used))

    return Recording(
        **vars(about),
        frame_shape=film.shape,
        dtype=film.dtype,
        each=lambda index: film.each(numbers[index].tolist()),
        place=lambda i: f"{path}, frame {numbers[i]}",
        digest=cache(digest),
        window=window,
        notes=tuple(film.notes),
    )


def _of_intervals(
    table: Path, film: Film, fewest_classes: int, memory_bytes: int
) -> About:
    intervals = _intervals(table)
    starts = [interval.start - EARLY_S for interval in intervals]

    def interval_of(time: float) -> int:
        """The number of the interval at a time; -1 between them."""
        number = bisect_right(starts, time) - 1
        return number if time < intervals[number].end - EARLY_S else -1

    end = intervals[-1].end
    found = film.read(lambda _, time: interval_of(time) >= 0, memory_bytes, end)
    members = np.array([interval_of(time) for time in found.values()], int)
    _check_each(table, film, intervals, members)
    rows = [interval.row for interval in intervals]
    places = [interval.place for interval in intervals]
    columns = Columns.of(f"{film.path} with {table}", places, rows)
    whole = columns.only(("label", "session", "group")).about((), fewest_classes)
    assert whole.labels is not None
    labels = whole.labels[members]
    samples = {
        **{name: column[members] for name, column in whole.samples.items()},
        "order": np.arange(len(members)),
        "frame": np.array(list(found)),
        "time": np.array(list(found.values())),  # seconds
        "interval": members,
    }
    about = About(samples, whole.classes, labels)
    if "group" in samples or len(np.unique(samples.get("session", 0))) > 1:
        return about
    return _grouped(about, film)


def _check_each(
    table: Path, film: Film, intervals: list[_Interval], members: np.ndarray
) -> None:
    """Raise a ValueError for an interval without a frame."""
    for number, interval in enumerate(intervals):
        if number not in members:
            wanted = f"intervals of at least one frame of {film.path.name}"
            raise ValueError(f"{table}: expected {wanted}, found {interval}")


def _grouped(about: About, film: Film) -> About:
    """The same with an interval as a group; frames of a class of one interval are split."""
    assert about.labels is not None
    members = about.samples["interval"]
    alone = _of_one_interval(about.labels, members)
    if alone.all():
        return about
    apart = members.max() + 1 + np.arange(len(members))
    names = ", ".join(about.classes[c] for c in np.unique(about.labels[alone]))
    note(film.notes, names != "", f"{names}: one interval, whose frames are split")
    samples = {**about.samples, "group": np.where(alone, apart, members)}
    return replace(about, samples=samples)


def _of_one_interval(labels: np.ndarray, intervals: np.ndarray) -> np.ndarray:
    """Which frames [N] are of a class of a single interval."""
    pairs = np.unique(np.stack([labels, intervals]), axis=1)
    return np.bincount(pairs[0])[labels] == 1


def _of_frames(table: Path, film: Film, asked: Asked, memory_bytes: int) -> About:
    columns = Columns.read(table, ("frame", *asked.named))
    rows: dict[int, None] = {}
    for i, text in enumerate(map(str, columns.columns.pop("frame").tolist())):
        if not text.isdecimal() or int(text) in rows:
            wanted = "a number of a frame from 0, each once"
            raise ValueError(f"{columns.place(i)}: expected {wanted}, found {text!r}")
        rows[int(text)] = None
    about = columns.about(asked.values, asked.fewest_classes)
    times = film.read(lambda number, _: number in rows, memory_bytes)
    if missing := sorted(set(rows) - set(times)):
        wanted = f"numbers of the {film.count} frames of {film.path.name}, from 0"
        raise ValueError(f"{table}: expected {wanted}, found {missing[0]}")
    samples = dict(about.samples)
    if "order" not in columns.columns:
        samples["order"] = np.array([*rows])
    samples |= {
        "frame": np.array([*rows]),
        "time": np.array([times[number] for number in rows]),
    }
    return replace(about, samples=samples)


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
