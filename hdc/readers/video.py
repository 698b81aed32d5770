"""A video with a table: labelled intervals, or a row of labels or values a frame.

A frame belongs to the interval with start ≤ time < end, and has its label, session and group.
Where neither sessions nor groups say what was recorded together, an interval is a group.
Frames outside all intervals are left out.
"""

from __future__ import annotations

import hashlib
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np

from hdc.readers.about import About, Columns, grouped
from hdc.readers.asked import Asked
from hdc.readers.files import file_digest
from hdc.readers.film import Film
from hdc.readers.recording import Recording, Window
from hdc.readers.table import columns_in

EARLY_S = 5.1e-4
"""Frames so much before a time belong to it: some containers round their times to 1 ms."""


def open_frames(path: Path, window: Window, asked: Asked) -> Recording:
    """Open a video and its table, which has a row per interval or a row per frame.

    The table is beside it by default, its suffix replaced by .csv. A row per interval has
    ``start_s``, ``end_s`` and ``label``, and may have ``session`` and ``group``; one per frame has
    ``frame``, its number from 0, and labels or values.

    Raises:
        BadFrame: the video ends before its header says, or has lost frames.
        ValueError: the video or its table is not as described, or a crop does not fit.
    """
    table = asked.table or path.with_suffix(".csv")
    film = Film(path, window, asked.memory_bytes)
    names = columns_in(table)
    if "frame" in names:
        about = _of_frames(table, film, asked)
    elif "start_s" in names:
        about = _of_intervals(table, film, asked)
    else:
        wanted = "a table with start_s, end_s and label, or with a row per frame"
        found = ", ".join(names) or "none"
        raise ValueError(
            f"{table}: expected {wanted}, found {found} (--values names it)"
        )

    def digest() -> str:
        used = hashlib.sha256(about.samples["frame"].astype("<i8").tobytes())
        return repr((file_digest(path), used.hexdigest()))

    return Recording.of(
        about, film, window, digest=cache(digest), notes=tuple(film.notes)
    )


def _of_intervals(table: Path, film: Film, asked: Asked) -> About:
    columns = Columns.read(table, ("start_s", "end_s", "label"))
    starts, ends = _intervals(columns)
    order = np.argsort(starts)  # intervals are counted in order of time
    starts, ends = starts[order] - EARLY_S, ends[order] - EARLY_S

    def interval_of(time: float) -> int:
        """The number of the interval at a time; -1 between them."""
        number = int(np.searchsorted(starts, time, side="right")) - 1
        return number if time < ends[number] else -1

    film.read(lambda _, time: interval_of(time) >= 0, ends[-1])
    members = np.array([interval_of(time) for time in film.times], int)
    for number, row in enumerate(order):
        if number not in members:
            raise ValueError(
                f"{columns.place(row)}: expected at least one frame of {film.path.name} from "
                "start_s to end_s, found none"
            )
    known = columns.known_as(asked).only("label", "session", "group")
    whole = known.about((), asked.fewest_classes)
    assert whole.labels is not None
    rows = order[members]
    samples = {name: column[rows] for name, column in whole.samples.items()}
    samples |= {"order": np.arange(len(rows)), "interval": members, **film.samples()}
    about = About(samples, whole.classes, whole.labels[rows])
    if "group" in samples or len(np.unique(samples.get("session", 0))) > 1:
        return about
    about, alone = grouped(about, members)
    if alone:
        film.notes.append(f"{alone}: one interval, whose frames are split")
    return about


def _intervals(columns: Columns) -> tuple[np.ndarray, np.ndarray]:
    """Start and end in s of each row; a ValueError for those that are none or overlap."""
    starts, ends = columns.numbers("start_s"), columns.numbers("end_s")
    before = 0.0
    for k in np.argsort(starts):
        if not before <= starts[k] < ends[k]:
            wanted = f"{before:g} ≤ start_s < end_s, after the interval before it"
            raise ValueError(
                f"{columns.place(k)}: expected {wanted}, found {starts[k]:g} and {ends[k]:g}"
            )
        before = ends[k]
    return starts, ends


def _of_frames(table: Path, film: Film, asked: Asked) -> About:
    columns = Columns.read(table, ("frame", *asked.named)).known_as(asked)
    numbers = columns.columns.pop("frame").tolist()
    seen: set[int] = set()
    for i, number in enumerate(numbers):
        if not isinstance(number, int) or number < 0 or number in seen:
            wanted = "a number of a frame from 0, each once"
            raise ValueError(f"{columns.place(i)}: expected {wanted}, found {number!r}")
        seen.add(number)
    about = columns.about(asked.values, asked.fewest_classes)
    film.read(lambda number, _: number in seen)
    film.choose(table, numbers)
    order = about.samples["order"] if "order" in columns.columns else np.array(numbers)
    samples = {**about.samples, "order": order, **film.samples()}
    return replace(about, samples=samples)
