"""A parquet file with a column of encoded images, as collections of robot touches are published.

Other columns of numbers and text are read as those of a table of images: ``label``, ``order``,
``session`` and ``group`` are known by name. A group of rows is in memory at a time.
"""

from __future__ import annotations

import json
import shlex
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from hdc.readers.about import Asked, Columns
from hdc.readers.files import Ambiguous, BadFrame, file_digest, require
from hdc.readers.images import Alike, decoded
from hdc.readers.recording import Recording, Window


def open_parquet(
    path: Path, window: Window, asked: Asked, image_column: str = "image"
) -> Recording:
    """Open the images [N, H, W] of a parquet file; see the module's description.

    Args:
        path: of the file.
        window: pixels that are kept.
        asked: the column of labels is ``label`` by default.
        image_column: the column of images, where there are several.

    Raises:
        Ambiguous: there are several columns of images, and none is named.
        SettingError: the one that is named is not among them.
        ValueError: the file is not as described.
    """
    file = opened(path)
    if file.metadata.num_rows == 0:
        raise ValueError(f"{path}: expected a row per frame, found none")
    column = _image_column(path, file.schema_arrow, image_column)
    columns = _columns(path, file, asked.labels or "label")
    images = _Rows(path, file, column, window)
    return Recording(
        **vars(columns.about(asked.values, asked.fewest_classes)),
        frame_shape=images.shape,
        dtype=images.dtype,
        each=images.each,
        place=images.place,
        digest=cache(lambda: file_digest(path)),
        window=window,
        notes=(f"images of the column {column}",),
        image_shape=images.size,
    )


def opened(path: Path) -> Any:
    """The file, of which nothing but its description is read.

    Raises:
        ValueError: it is damaged, or of another kind.
    """
    with _named(path):
        return pq.ParquetFile(path)


def _image_column(path: Path, schema: Any, wanted: str) -> str:
    found = [field.name for field in schema if _holds_bytes(field.type)]
    if wanted in found:
        return wanted
    if not found:
        listed = ", ".join(f"{field.name} ({field.type})" for field in schema)
        raise ValueError(f"{path}: expected a column of encoded images, found {listed}")
    require(wanted == "image", "image_column", wanted, f"one of {', '.join(found)}")
    if len(found) > 1:
        choices = [f"--image-column {shlex.quote(name)}" for name in found]
        raise Ambiguous(f"{path}: several columns of images", choices)
    return found[0]


def _holds_bytes(kind: Any) -> bool:
    """Whether a column is of bytes, or of structs with bytes as Hugging Face writes them."""
    if pa.types.is_struct(kind):
        return kind.get_field_index("bytes") >= 0
    return pa.types.is_binary(kind) or pa.types.is_large_binary(kind)


def _columns(path: Path, file: Any, label: str) -> Columns:
    """All other columns, as text; the chosen one is the label."""
    names = [
        field.name
        for field in file.schema_arrow
        if not (pa.types.is_nested(field.type) or _holds_bytes(field.type))
    ]
    with _named(path):
        table = file.read(columns=names)
    columns = {}
    for name in names:
        cells = table.column(name).to_pylist()
        columns[name] = ["" if cell is None else str(cell) for cell in cells]
    if label in columns:
        by_number = _class_names(file.schema_arrow, label)
        numbers = columns.pop(label)
        columns["label"] = [by_number.get(number, number) for number in numbers]
    elif label != "label":
        raise ValueError(
            f"labels: {path}: expected one of {', '.join(names)}, found {label!r}"
        )
    return Columns.of_texts(path, len(table), lambda i: f"{path}, row {i}", columns)


def _class_names(schema: Any, label: str) -> dict[str, str]:
    """Names of numbered classes, where the file's makers state them for Hugging Face."""
    try:
        stated = json.loads((schema.metadata or {}).get(b"huggingface", b"{}"))
        names = stated["info"]["features"][label]["names"]
    except (ValueError, KeyError, TypeError):  # other makers have other metadata
        return {}
    return {str(number): name for number, name in enumerate(names or ())}


@contextmanager
def _named(path: Path) -> Iterator[None]:
    """Errors of damaged files name them."""
    try:
        yield
    except (pa.ArrowException, OSError) as error:
        raise ValueError(
            f"{path}: expected an intact parquet file, found: {error}"
        ) from error


class _Rows:
    """Images of one size and depth, those of the first row."""

    def __init__(self, path: Path, file: Any, column: str, window: Window) -> None:
        self._path, self._file, self._column = path, file, column
        groups = range(file.num_row_groups)
        counts = [file.metadata.row_group(group).num_rows for group in groups]
        self._starts = np.cumsum([0, *counts])
        (first,) = self._decoded(np.arange(1))
        self._alike = Alike(self.place(0), first, window)
        self.dtype, self.shape = self._alike.dtype, self._alike.shape
        self.size = self._alike.size

    def place(self, i: int) -> str:
        return f"{self._path}, row {i}"

    def each(self, index: np.ndarray) -> Iterator[np.ndarray]:
        for i, image in zip(index, self._decoded(index), strict=True):
            yield self._alike.frame(self.place(i), image)

    def _decoded(self, index: np.ndarray) -> Iterator[np.ndarray]:
        held, cells = -1, pa.chunked_array([[]])
        for i in index:
            group = int(np.searchsorted(self._starts, i, side="right")) - 1
            if group != held:
                held = group
                with _named(self._path):
                    cells = self._file.read_row_group(group, [self._column]).column(0)
            cell = cells[int(i - self._starts[group])].as_py()
            data = cell["bytes"] if isinstance(cell, dict) else cell
            if data is None:
                raise BadFrame(f"{self.place(i)}: expected an image, found none")
            yield decoded(self.place(i), data)
