"""A video with a table: labelled intervals, or a row of labels or values a frame.

A frame belongs to the interval with start ≤ time < end, and has its label, session and group.
Where neither sessions nor groups say what was recorded together, an interval is a group.
Frames outside all intervals are left out.
"""

from __future__ import annotations

import hashlib
from dataclasses import replace
from functools import cache
from itertools import pairwise
from pathlib import Path

import numpy as np

from hdc.readers.about import About, Asked, Columns
from hdc.readers.files import file_digest
from hdc.readers.film import EARLY_S, Film, note
from hdc.readers.recording import Recording, Window
from hdc.readers.table import columns_in


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
    film = Film(path, window)
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


def _of_intervals(table: Path, film: Film, asked: Asked) -> About:
    columns = Columns.read(table, ("start_s", "end_s", "label"))
    starts, ends = _intervals(table, columns)
    order = np.argsort(starts)  # intervals are counted in order of time
    starts, ends = starts[order], ends[order]

    def interval_of(time: float) -> int:
        """The number of the interval at a time; -1 between them."""
        number = int(np.searchsorted(starts - EARLY_S, time, side="right")) - 1
        return number if time < ends[number] - EARLY_S else -1

    found = film.read(
        lambda _, time: interval_of(time) >= 0, asked.memory_bytes, ends[-1]
    )
    members = np.array([interval_of(time) for time in found.values()], int)
    for number, (start, end) in enumerate(zip(starts, ends, strict=True)):
        if number not in members:
            wanted = f"intervals of at least one frame of {film.path.name}"
            raise ValueError(f"{table}: expected {wanted}, found {start:g}–{end:g} s")
    known = columns.only("label", "session", "group")
    whole = known.about((), asked.fewest_classes)
    assert whole.labels is not None
    rows = order[members]
    samples = {
        **{name: column[rows] for name, column in whole.samples.items()},
        "order": np.arange(len(members)),
        "frame": np.array(list(found)),
        "time": np.array(list(found.values())),  # seconds
        "interval": members,
    }
    about = About(samples, whole.classes, whole.labels[rows])
    if "group" in samples or len(np.unique(samples.get("session", 0))) > 1:
        return about
    return _grouped(about, film)


def _intervals(table: Path, columns: Columns) -> tuple[np.ndarray, np.ndarray]:
    """Start and end in s of each row."""
    starts, ends = columns.numbers("start_s"), columns.numbers("end_s")
    fits = (starts >= 0) & (starts < ends)
    if not fits.all():
        k = int(fits.argmin())
        raise ValueError(
            f"{columns.place(k)}: expected 0 ≤ start_s < end_s, found {starts[k]}, {ends[k]}"
        )
    order = np.argsort(starts)
    for first, second in pairwise(order):
        if starts[second] < ends[first]:
            found = " and ".join(
                f"{starts[k]:g}–{ends[k]:g} s" for k in (first, second)
            )
            raise ValueError(
                f"{table}: expected intervals that do not overlap, found {found}"
            )
    return starts, ends


def _grouped(about: About, film: Film) -> About:
    """The same with an interval as a group; frames of a class of one interval are split."""
    assert about.labels is not None
    members = about.samples["interval"]
    pairs = np.unique(np.stack([about.labels, members]), axis=1)
    alone = np.bincount(pairs[0])[about.labels] == 1
    if alone.all():
        return about
    names = ", ".join(about.classes[c] for c in np.unique(about.labels[alone]))
    note(film.notes, names != "", f"{names}: one interval, whose frames are split")
    apart = members.max() + 1 + np.arange(len(members))
    samples = {**about.samples, "group": np.where(alone, apart, members)}
    return replace(about, samples=samples)


def _of_frames(table: Path, film: Film, asked: Asked) -> About:
    columns = Columns.read(table, ("frame", *asked.named))
    numbers = columns.columns.pop("frame").tolist()
    seen = set()
    for i, number in enumerate(numbers):
        if not isinstance(number, int) or number < 0 or number in seen:
            wanted = f"a number of a frame from 0, each once, found {number!r}"
            raise ValueError(f"{columns.place(i)}: expected {wanted}")
        seen.add(number)
    about = columns.about(asked.values, asked.fewest_classes)
    times = film.read(lambda number, _: number in seen, asked.memory_bytes)
    if missing := sorted(seen - set(times)):
        wanted = f"numbers of the {film.count} frames of {film.path.name}, from 0"
        raise ValueError(f"{table}: expected {wanted}, found {missing[0]}")
    order = np.array(numbers)
    return replace(
        about,
        samples={
            **about.samples,
            "order": about.samples["order"] if "order" in columns.columns else order,
            "frame": order,
            "time": np.array([times[number] for number in numbers]),
        },
    )
