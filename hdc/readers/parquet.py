"""A parquet file with a column of encoded images, as collections of robot touches are published.

Other columns of numbers and text are read as in a table of images: ``label``, ``order``,
``session`` and ``group`` are known by name. The encoded images are in memory.
"""

from __future__ import annotations

import json
import shlex
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from hdc.readers.about import Columns
from hdc.readers.asked import Asked
from hdc.readers.files import Ambiguous, BadFrame, file_digest, wrong
from hdc.readers.images import Images, decoded
from hdc.readers.recording import Recording, Window


def open_frames(path: Path, window: Window, asked: Asked) -> Recording:
    """Open the images [N, H, W] of a parquet file; see the module's description.

    Raises:
        Ambiguous: there are several columns of images, and none is named.
        SettingError: the one that is named is not among them.
        ValueError: the file is not as described.
    """
    schema = schema_of(path)
    column = _image_column(path, schema, asked.image_column)
    names = [field.name for field in schema if not _is_nested(field.type)]
    label = asked.labels or "label"
    if asked.labels and label not in names:
        raise wrong(f"labels: {path}", label, f"one of {', '.join(names)}")
    try:
        table = pq.read_table(path, columns=[*names, column])
    except (pa.ArrowException, OSError) as error:
        raise _damaged(path, error) from error
    if len(table) == 0:
        raise ValueError(f"{path}: expected a row per frame, found none")
    texts = {name: _texts(table[name].to_pylist()) for name in names}
    if label in texts:
        by_number = _class_names(schema, label)
        texts["label"] = [by_number.get(text, text) for text in texts.pop(label)]

    def place(i: int) -> str:
        return f"{path}, row {i}"

    def image(i: int) -> np.ndarray:
        cell = table[column][i].as_py()
        data = cell["bytes"] if isinstance(cell, dict) else cell
        if data is None:
            raise BadFrame(f"{place(i)}: expected an image, found none")
        return decoded(place(i), data)

    columns = Columns.of_texts(path, len(table), place, texts).known_as(asked)
    images = Images(len(table), image, place, window)
    return Recording.of(
        columns.about(asked.values, asked.fewest_classes),
        images,
        window,
        digest=cache(lambda: file_digest(path)),
        image_shape=images.size,
        notes=(f"images of the column {column}",),
    )


def _texts(cells: list[Any]) -> list[str]:
    return ["" if cell is None else str(cell) for cell in cells]


def schema_of(path: Path) -> Any:
    """The columns of a file, and what its makers state of them.

    Raises:
        ValueError: it is damaged, or of another kind.
    """
    try:
        return pq.read_schema(path)
    except (pa.ArrowException, OSError) as error:
        raise _damaged(path, error) from error


def _damaged(path: Path, error: Exception) -> ValueError:
    found = " ".join(str(error).split())  # of several lines
    return ValueError(f"{path}: expected an intact parquet file, found: {found}")


def _image_column(path: Path, schema: Any, wanted: str) -> str:
    found = [field.name for field in schema if _holds_bytes(field.type)]
    if wanted in found:
        return wanted
    if not found:
        listed = ", ".join(f"{field.name} ({field.type})" for field in schema)
        raise ValueError(f"{path}: expected a column of encoded images, found {listed}")
    if wanted != "image":
        raise wrong("image_column", wanted, f"one of {', '.join(found)}")
    if len(found) > 1:
        choices = [f"--image-column {shlex.quote(name)}" for name in found]
        raise Ambiguous(f"{path}: several columns of images", choices)
    return found[0]


def _is_nested(kind: Any) -> bool:
    return pa.types.is_nested(kind) or _holds_bytes(kind)


def _holds_bytes(kind: Any) -> bool:
    """Whether a column is of bytes, or of structs with bytes as Hugging Face writes them."""
    if pa.types.is_struct(kind):
        return kind.get_field_index("bytes") >= 0
    return pa.types.is_binary(kind) or pa.types.is_large_binary(kind)


def _class_names(schema: Any, label: str) -> dict[str, str]:
    """Names of numbered classes, where the file's makers state them for Hugging Face."""
    try:
        stated = json.loads((schema.metadata or {}).get(b"huggingface", b"{}"))
        names = stated["info"]["features"][label]["names"]
    except (ValueError, KeyError, TypeError):  # other makers have other metadata
        return {}
    return {str(number): name for number, name in enumerate(names or ())}
