"""A CSV with a row per frame: vectors such as spectra, one number per column.

``label``, ``order``, ``session`` and ``group`` are known by name, columns that are chosen as values
are what is learnt, and all others are the numbers of the frame, in their order.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from pathlib import Path

from hdc.readers.about import KNOWN, Asked, Columns, is_unnamed
from hdc.readers.axes import Frames
from hdc.readers.files import file_digest
from hdc.readers.recording import Recording, Window
from hdc.readers.table import parse_number


def open_frames(path: Path, window: Window, asked: Asked) -> Recording:
    """Open a CSV of vectors [N, D]; see the module's description.

    Raises:
        ValueError: the table is not as described; a cell that is no number is named.
    """
    columns = Columns.read(path, asked.named if asked.fewest_classes > 0 else ())
    _check_header(path, [*columns.columns])
    columns = columns.known_as(asked)
    chosen = [name for name in asked.named if name in columns.columns]
    known = columns.only("label", *KNOWN, *chosen)
    if asked.fewest_classes > 0 and not chosen and "label" not in known.columns:
        raise ValueError(
            f"{path}: expected a column label, or a chosen column of values, found neither"
        )
    numbers = [name for name in columns.columns if name not in known.columns]
    vectors = columns.values(numbers)
    if vectors is None:
        raise ValueError(
            f"{path}: expected columns of numbers, found {[*columns.columns]}"
        )
    return Recording.of(
        known.about(chosen, asked.fewest_classes),
        Frames(columns.place, vectors, ("frame", "feature"), window),
        window,
        digest=cache(lambda: file_digest(path)),
        features=tuple(numbers[:: window.subsample]),
    )


def _check_header(path: Path, names: Sequence[str]) -> None:
    """Raise a ValueError for a column without a name, such as the index that pandas writes, or
    where the first line is a frame: numbers that neither rise nor fall."""
    numbers = [number for name in names if (number := parse_number(name)) is not None]
    in_order = sorted(numbers, reverse=numbers[:1] > numbers[-1:])
    is_frame = len(numbers) == len(names) and numbers != in_order
    unnamed = [name for name in names if is_unnamed(name)]
    if is_frame or unnamed:
        found = ", ".join(unnamed or names[:3])
        raise ValueError(
            f"{path}: expected a name of each column in the first line, found {found!r} (pandas "
            "leaves its index out with to_csv(…, index=False))"
        )
