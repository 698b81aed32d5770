"""A CSV with a row per frame: vectors such as spectra, one number per column.

``label``, ``order``, ``session`` and ``group`` are known by name, columns that are chosen as values
are what is learnt, and all others are the numbers of the frame, in their order.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import cache
from pathlib import Path

import numpy as np

from hdc.readers.columns import KNOWN, Columns
from hdc.readers.files import file_digest
from hdc.readers.recording import Recording, Window


def open_table(
    path: Path, window: Window, value_columns: Sequence[str], fewest_classes: int
) -> Recording:
    """Open a CSV of vectors [N, D]; see the module's description.

    Raises:
        ValueError: the table is not as described; a cell that is no number is named.
    """
    needed = value_columns if fewest_classes > 0 else ()
    columns = Columns.read(path, needed)
    chosen = [name for name in value_columns if name in columns.texts]
    known = columns.only(("label", *KNOWN, *chosen))
    if fewest_classes > 0 and not chosen and "label" not in known.texts:
        raise ValueError(
            f"{path}: expected a column label, or a chosen column of values, found neither"
        )
    about = known.about(path, fewest_classes, chosen)
    numbers = [name for name in columns.texts if name not in ("label", *KNOWN, *chosen)]
    frames = columns.values(numbers)
    if frames is None:
        raise ValueError(
            f"{path}: expected columns of numbers, found {[*columns.texts]}"
        )
    about["samples"] = {"order": np.arange(len(frames)), **about["samples"]}

    def each(index: np.ndarray) -> Iterator[np.ndarray]:
        return (np.ascontiguousarray(window.of(frames[i])) for i in index)

    return Recording(
        frame_shape=window.shape(frames.shape[1]),
        dtype=frames.dtype,
        each=each,
        place=lambda i: columns.places[i],
        digest=cache(lambda: file_digest(path)),
        window=window,
        features=tuple(numbers[:: window.subsample]),
        **about,
    )
