"""A video with a table: labelled intervals, or a row of labels or values a frame.

A frame belongs to the interval with start ≤ time < end, and has its label, session and group.
Where no groups say what was recorded together, an interval is a group.
Frames without a row are left out.
"""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from hdc.readers.about import Columns
from hdc.readers.files import file_digest
from hdc.readers.film import Film
from hdc.readers.recording import Asked, Recording
from hdc.readers.table import columns_in

EARLY_S = 5.1e-4
"""Frames so much before a time belong to it: some containers round their times to 1 ms."""


def open_frames(path: Path, asked: Asked) -> Recording:
    """Frames of a video and its table, which has a row per interval or a row per frame.

    The table is beside it by default, its suffix replaced by .csv. A row per interval has
    ``start_s``, ``end_s`` and ``label``, and may have ``session`` and ``group``; one per frame has
    ``frame``, its number from 0, and labels or values.

    Raises:
        BadFrame: the video is damaged, or ends before its header says.
        ValueError: the video or its table is not as described, or a crop does not fit.
    """
    table, film = asked.table or path.with_suffix(".csv"), Film(path, asked.window)
    names = columns_in(table)
    columns, rows = _read(film, table, names, asked)
    absent = np.setdiff1d(np.arange(columns.n), rows)
    if len(absent):
        where = columns.place(absent[0])
        raise ValueError(f"{where}: expected a frame of {path.name}, found none")
    film.numbers = numbers = np.flatnonzero(rows >= 0)
    kept = columns.take(rows[numbers])
    of_film = {"frame": numbers, "time": film.times[numbers]}
    kept.columns = {"order": numbers, **kept.columns, **of_film}
    is_of_frames = "frame" in names
    has_groups = is_of_frames or asked.groups is not None or "group" in names

    def digest() -> str:
        used = hashlib.sha256(numbers.astype("<i8").tobytes())
        return repr((file_digest(path), used.hexdigest()))

    return Recording.of(
        kept,
        film,
        asked,
        digest,
        parts=None if has_groups else rows[numbers],
        is_decoded=True,
    )


def _read(
    film: Film, table: Path, names: Sequence[str], asked: Asked
) -> tuple[Columns, np.ndarray]:
    """The columns of a table, and the row of each frame of a film; -1 of those without a row."""
    if "frame" in names:
        columns = Columns.read(table, ("frame", *asked.values))
        if asked.table is None and "label" in names:
            columns.learnt = ()
        film.read()
        return columns, _rows_by_number(columns, len(film.times))
    if "start_s" in names:
        columns = Columns.read(table, ("start_s", "end_s", "label"))
        columns.learnt = ()
        film.read()
        return columns, _rows_by_time(columns, film.times)
    wanted = "a table with start_s, end_s and label, or with a row per frame"
    found = ", ".join(names) or "none"
    raise ValueError(f"{table}: expected {wanted}, found {found} (--values names it)")


def _rows_by_time(columns: Columns, times: np.ndarray) -> np.ndarray:
    """The row of the interval at each time [n].

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
    late = times + EARLY_S
    rows = order[np.searchsorted(starts[order], late, side="right") - 1]
    return np.where((starts[rows] <= late) & (late < ends[rows]), rows, -1)


def _rows_by_number(columns: Columns, n: int) -> np.ndarray:
    """The row of each of n frames, by their numbers.

    Raises:
        ValueError: a number is none of a frame, or is there twice.
    """
    numbers = columns.columns["frame"]
    if numbers.dtype.kind != "i" or len(np.unique(numbers)) < len(numbers):
        wanted = "different numbers of frames from 0 in the column frame"
        raise ValueError(f"{columns.where}: expected {wanted}, found {numbers}")
    rows, is_there = np.full(n, -1), (numbers >= 0) & (numbers < n)
    rows[numbers[is_there]] = np.flatnonzero(is_there)
    return rows


def whole(path: Path, asked: Asked) -> Recording:
    """All frames of a video, of which nothing is said."""
    film = Film(path, asked.window)
    film.expect()
    columns = Columns(path, len(film.numbers), film.place, {})
    return Recording.of(columns, film, asked, lambda: file_digest(path))
