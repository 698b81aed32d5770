"""A CSV with a row per frame: vectors such as spectra, one number per column.

``label``, ``order``, ``session`` and ``group`` are known by name, columns that are chosen as values
are what is learnt, and all others are the numbers of the frame, in their order. One that is unlike
its neighbours, such as a force among wavelengths, is noted.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from hdc.readers.about import KNOWN, Columns, is_unnamed
from hdc.readers.axes import Frames
from hdc.readers.files import file_digest
from hdc.readers.recording import Asked, Recording
from hdc.readers.table import parse_number

_DIGITS = re.compile(r"\d+(?:\.\d+)?")
_FEWEST, _MOST, _TIMES = 8, 0.75, 10
"""Columns that say what is usual, their share, and a range that is another."""
_REMEDY = (
    "--column learns a number, --sessions or --groups splits by one, or take it out"
)


def open_frames(path: Path, asked: Asked) -> Recording:
    """The frames of a CSV of vectors [N, D]; see the module's description.

    Raises:
        ValueError: the table is not as described; a cell that is no number is named.
    """
    columns = Columns.read(path, asked.values if asked.fewest_classes > 0 else ())
    names = [*columns.columns]
    _check_header(path, names)
    known = {"label", *KNOWN, *asked.values, asked.labels, asked.sessions, asked.groups}
    numbers = [name for name in names if name not in known]
    vectors = columns.values(numbers)
    if vectors is None:
        raise ValueError(f"{path}: expected columns of numbers, found {names}")
    said = {name: columns.columns[name] for name in names if name in known}
    odd = unlike(numbers, vectors)
    notes = [f"{', '.join(odd)}: a pixel unlike the others, {_REMEDY}"] if odd else []
    values = [name for name in asked.values if name in said]
    return Recording.of(
        replace(columns, columns=said, learnt=()),
        Frames(columns.place, vectors, ("frame", "feature"), asked.window),
        asked._replace(values=values),
        lambda: file_digest(path),
        features=tuple(numbers[:: asked.window.subsample]),
        notes=notes,
    )


def unlike(names: Sequence[str], vectors: np.ndarray) -> list[str]:
    """Names of columns whose name or range of numbers is not that of the columns around them.

    A name is another one where the others differ in a number alone, as 400nm and 401nm; a range is
    where the largest number is ten times or a tenth of that of the four columns around.

    Args:
        names: of D columns.
        vectors: float64 [N, D].
    """
    if len(names) < _FEWEST:
        return []
    forms = [_DIGITS.sub("#", name) for name in names]
    form, count = Counter(forms).most_common(1)[0]
    has_form = count >= _MOST * len(names)
    largest = np.abs(vectors).max(axis=0)
    around = np.median([np.roll(largest, k) for k in (-2, -1, 1, 2)], axis=0)
    is_odd = (largest > _TIMES * around) | (_TIMES * largest < around)
    pairs = zip(names, forms, is_odd.tolist(), strict=True)
    return [name for name, own, odd in pairs if odd or (has_form and own != form)]


def _check_header(path: Path, names: Sequence[str]) -> None:
    """Raise a ValueError for a column without a name, such as the index that pandas writes, or
    where the first line is a frame: numbers that neither rise nor fall."""
    numbers = [number for name in names if (number := parse_number(name)) is not None]
    rises_or_falls = sorted(numbers) in (numbers, numbers[::-1])
    is_frame = len(numbers) == len(names) and not rises_or_falls
    unnamed = [name for name in names if is_unnamed(name)]
    if is_frame or unnamed:
        found = ", ".join(unnamed or names[:3])
        raise ValueError(
            f"{path}: expected a name of each column in the first line, found {found!r} (pandas "
            "leaves its index out with to_csv(…, index=False))"
        )
