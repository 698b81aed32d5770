"""A video with a table: labelled intervals, or a row of labels or values a frame.

A frame belongs to the interval with start ≤ time < end, and has its label, session and group.
Where no groups say what was recorded together, an interval is a group.
Frames without a row are left out.
"""

from __future__ import annotations

import hashlib
from pathlib import Path

import numpy as np

from hdc.readers.about import Columns
from hdc.readers.asked import Asked
from hdc.readers.files import file_digest
from hdc.readers.film import Film
from hdc.readers.recording import Recording, Window
from hdc.readers.table import columns_in

EARLY_S = 5.1e-4
"""Frames so much before a time belong to it: some containers round their times to 1 ms."""


def open_frames(path: Path, window: Window, asked: Asked) -> Recording:
    """Frames of a video and its table, which has a row per interval or a row per frame.

    The table is beside it by default, its suffix replaced by .csv. A row per interval has
    ``start_s``, ``end_s`` and ``label``, and may have ``session`` and ``group``; one per frame has
    ``frame``, its number from 0, and labels or values.

    Raises:
        BadFrame: the video ends before its header says.
        ValueError: the video or its table is not as described, or a crop does not fit.
    """
    table = asked.table or path.with_suffix(".csv")
    film, names = Film(path, window), columns_in(table)
    is_of_frames = "frame" in names
    if is_of_frames:
        columns = Columns.read(table, ("frame", *asked.named))
        _read_frames(columns, film)
    elif "start_s" in names:
        columns = Columns.read(table, ("start_s", "end_s", "label"))
        _read_intervals(columns, film)
    else:
        wanted = "a table with start_s, end_s and label, or with a row per frame"
        found = ", ".join(names) or "none"
        raise ValueError(
            f"{table}: expected {wanted}, found {found} (--values names it)"
        )
    rows, numbers = np.array(film.rows, int), np.array(film.numbers)
    absent = np.setdiff1d(np.arange(columns.n), rows)
    if len(absent):
        where = columns.place(absent[0])
        raise ValueError(f"{where}: expected a frame of {path.name}, found none")
    kept = columns.take(rows)
    of_film = {"frame": numbers, "time": np.array(film.times)}
    kept.columns = {"order": numbers, **kept.columns, **of_film}
    has_groups = asked.groups is not None or "group" in names

    def digest() -> str:
        used = hashlib.sha256(numbers.astype("<i8").tobytes())
        return repr((file_digest(path), used.hexdigest()))

    return Recording.of(
        kept,
        film,
        window,
        asked,
        digest,
        values=asked.values if is_of_frames else (),
        parts=None if is_of_frames or has_groups else rows,
        is_decoded=True,
    )


def _read_intervals(columns: Columns, film: Film) -> None:
    """Choose the frames in the intervals of a table.

    Raises:
        ValueError: an interval is none, or two overlap.
    """
    starts, ends = columns.numbers("start_s"), columns.numbers("end_s")
    order, before = np.argsort(starts), 0.0
    for k in order:
        if not before <= starts[k] < ends[k]:
            wanted = f"{before:g} ≤ start_s < end_s, after the interval before it"
            raise ValueError(
                f"{columns.place(k)}: expected {wanted}, found {starts[k]:g} and {ends[k]:g}"
            )
        before = ends[k]

    def row_of(_: int, time: float) -> int:
        """The row of the interval at a time; -1 between them."""
        late = time + EARLY_S
        row = int(order[np.searchsorted(starts[order], late, side="right") - 1])
        return row if starts[row] <= late < ends[row] else -1

    film.read(row_of, before - EARLY_S)


def _read_frames(columns: Columns, film: Film) -> None:
    """Choose the frames whose numbers are in a table."""
    row_of: dict[int, int] = {}
    for i, number in enumerate(columns.columns["frame"].tolist()):
        if not isinstance(number, int) or number in row_of:
            wanted = "a number of a frame from 0, each once"
            raise ValueError(f"{columns.place(i)}: expected {wanted}, found {number!r}")
        row_of[number] = i
    film.read(lambda number, _: row_of.get(number, -1))


def whole(path: Path, window: Window, asked: Asked) -> Recording:
    """All frames of a video, of which nothing is said."""
    film = Film(path, window)
    film.expect()
    columns = Columns(path, len(film.numbers), film.place, {})
    return Recording.of(columns, film, window, asked, lambda: file_digest(path))
