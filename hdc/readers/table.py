"""A CSV with a row per frame: vectors such as spectra, one number per column.

``label``, ``order``, ``session`` and ``group`` are known by name, columns that are chosen as values
are what is learnt, and all others are the numbers of the frame, in their order.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache
from pathlib import Path

import numpy as np

from hdc.readers.about import KNOWN, Asked, Columns, is_unnamed
from hdc.readers.files import file_digest, parse_number
from hdc.readers.recording import Recording, Window


def open_table(path: Path, window: Window, asked: Asked) -> Recording:
    """Open a CSV of vectors [N, D]; see the module's description.

    Raises:
        ValueError: the table is not as described; a cell that is no number is named.
    """
    wanted = asked.named
    columns = Columns.read(path, wanted if asked.fewest_classes > 0 else ())
    _check_header(path, [*columns.columns])
    chosen = [name for name in wanted if name in columns.columns]
    known = columns.only(("label", *KNOWN, *chosen))
    if asked.fewest_classes > 0 and not chosen and "label" not in known.columns:
        raise ValueError(
            f"{path}: expected a column label, or a chosen column of values, found neither"
        )
    numbers = [name for name in columns.columns if name not in known.columns]
    about = known.about(chosen, asked.fewest_classes)
    frames = _frames(path, columns, numbers)

    def each(index: np.ndarray) -> Iterator[np.ndarray]:
        return (np.ascontiguousarray(window.of(frames[i])) for i in index)

    return Recording(
        **vars(about),
        frame_shape=window.shape(frames.shape[1]),
        dtype=frames.dtype,
        each=each,
        place=columns.place,
        digest=cache(lambda: file_digest(path)),
        window=window,
        features=tuple(numbers[:: window.subsample]),
    )


def _frames(path: Path, columns: Columns, numbers: list[str]) -> np.ndarray:
    """The vectors [N, D] of these columns."""
    unnamed = [name for name in numbers if is_unnamed(name)]
    if unnamed:
        raise ValueError(
            f"{path}: expected a name of each column, found {unnamed[0]!r} (pandas leaves its "
            "index out with to_csv(…, index=False))"
        )
    frames = columns.values(numbers)
    if frames is None:
        found = [*columns.columns]
        raise ValueError(f"{path}: expected columns of numbers, found {found}")
    return frames


def _check_header(path: Path, names: list[str]) -> None:
    """Raise a ValueError where the first line is a frame: numbers that neither rise nor fall."""
    numbers = [number for name in names if (number := parse_number(name)) is not None]
    in_order = sorted(numbers, reverse=numbers[:1] > numbers[-1:])
    if len(numbers) == len(names) and numbers != in_order:
        found = ", ".join(names[:3])
        raise ValueError(
            f"{path}: expected names of columns in the first line, found {found}, …"
        )
