"""Arrays by name, as the readers of files of arrays give them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np


class OnDisk:
    """An array that is read as it is asked for."""

    def __init__(self, like: Any, read: Callable[[Any], Any]) -> None:
        self.shape, self.dtype, self._read = like.shape, like.dtype, read

    def __getitem__(self, key: Any) -> np.ndarray:
        return np.asarray(self._read(key))

    @property
    def T(self) -> OnDisk:
        """With its axes in the other order, as MATLAB shows what it writes to HDF5."""

        def read(key: Any) -> np.ndarray:
            return self[key[::-1] if isinstance(key, tuple) else key].T

        turned = OnDisk(self, read)
        turned.shape = self.shape[::-1]
        return turned


@dataclass
class Store:
    """Arrays of a file.

    Attributes:
        arrays: anything with ``shape``, ``dtype`` and ``[…]``, by name.
        frames_last: MATLAB shows a stack as [H, W, N].
        unread: why arrays that are there are not read, by name.
        axes: of arrays whose file states them, by name.
    """

    arrays: dict[str, Any]
    frames_last: bool = False
    unread: dict[str, str] = field(default_factory=dict)
    axes: dict[str, tuple[str, ...]] = field(default_factory=dict)

    def notes(self) -> list[str]:
        """A phrase for each array that is not read, with the reason."""
        return [f"{name} is not read, {why}" for name, why in self.unread.items()]


def not_plain(name: str) -> str:
    """Why an array is not read that holds neither numbers nor text, and the remedy."""
    return (
        "expected numbers or text that are saved plainly, found others (in MATLAB, before saving: "
        f"cellstr({name}) for text, double({name}) for numbers, cat(3, {name}{{:}}) for frames in "
        "cells)"
    )
