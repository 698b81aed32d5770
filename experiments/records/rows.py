"""Rows of a record as JSON has them; labels as a short text."""

from __future__ import annotations

import base64
import zlib
from collections.abc import Iterable, Mapping
from typing import Any

import msgspec
import numpy as np
from numpy.typing import ArrayLike

Row = dict[str, Any]
"""Values of a row by column: int, float, str, bool, None, or a short list of them."""

_KINDS = ("|u1", "<u2", "<i4")  # from small to large; a row says which it has


class Rows(msgspec.Struct, frozen=True):
    """Rows as a table: names of columns, and a list of values a row; a missing value is None, and
    at the end of a row is left out."""

    columns: list[str] = []
    values: list[list[Any]] = []

    def __post_init__(self) -> None:
        for values in self.values:
            if len(values) > len(self.columns):
                expected = f"at most {len(self.columns)} values a row"
                raise ValueError(f"rows: expected {expected}, found {values!r}")

    @classmethod
    def of(cls, rows: Iterable[Mapping[str, Any]]) -> Rows:
        """The table of rows by column; numbers that are not finite are missing, as JSON has none.

        Raises:
            TypeError: for a value that JSON does not have.
        """
        listed = list(rows)
        columns = list(dict.fromkeys(key for row in listed for key in row))
        values = [[row.get(column) for column in columns] for row in listed]
        plain = msgspec.json.decode(msgspec.json.encode(values, enc_hook=_plain))
        for row in plain:
            while row and row[-1] is None:
                row.pop()
        return cls(columns, plain)

    def dicts(self) -> list[Row]:
        """The rows by column."""
        nothing = dict.fromkeys(self.columns)
        return [nothing | dict(zip(self.columns, row)) for row in self.values]  # noqa: B905


def pack_labels(labels: ArrayLike) -> str:
    """Labels of many frames as one text of a row: kind of integer, then bytes in base 64.

    A row has what its model predicted in a column ``predicted``. The true classes are the same for
    every model of a draw: one row a draw has them, in a column ``labels``. A metric that is thought
    of later needs no new measurement.

    >>> unpack_labels(pack_labels([0, 3, 3, 1]))
    array([0, 3, 3, 1])

    Args:
        labels: integers from 0 to 2^31 - 1, of one dimension.

    Raises:
        ValueError: if they are not that.
    """
    values = np.asarray(labels)
    whole = values.size == 0 or np.issubdtype(values.dtype, np.integer)
    if values.ndim != 1 or not whole:
        found = f"{values.dtype} {values.shape}"
        raise ValueError(f"labels: expected integers of one dimension, found {found}")
    least, most = values.min(initial=0), values.max(initial=0)
    if least < 0 or most > np.iinfo(np.int32).max:
        raise ValueError(f"labels: expected 0 to 2^31 - 1, found {least} to {most}")
    kind = next(kind for kind in _KINDS if most <= np.iinfo(kind).max)
    packed = zlib.compress(values.astype(kind).tobytes(), level=9)
    return f"{kind[1:]}:{base64.b64encode(packed).decode('ascii')}"


def unpack_labels(text: str) -> np.ndarray:
    """The labels in a text of :func:`pack_labels`, int64 [Q].

    Raises:
        ValueError: if it is none, or was damaged.
    """
    kind, _, packed = text.partition(":")
    kinds = {known[1:]: known for known in _KINDS}
    if kind not in kinds:
        raise ValueError(f"labels: expected packed integers, found {text[:20]!r}")
    try:
        data = zlib.decompress(base64.b64decode(packed, validate=True))
        return np.frombuffer(data, kinds[kind]).astype(np.int64)
    except (ValueError, zlib.error) as error:
        raise ValueError(f"labels: expected packed integers, found: {error}") from error


def _plain(value: Any) -> Any:
    """An array of numpy or torch as lists of numbers, for JSON."""
    if hasattr(value, "tolist"):
        return value.tolist()
    raise TypeError(f"record: expected plain values, found {type(value).__name__}")
