"""Errors of configuration in one wording: ``key: expected …, found …``."""

from __future__ import annotations

import math
from typing import Any

import numpy as np


def is_integer(value: object) -> bool:
    """Whether a value is an integer of Python or NumPy; True and False are none."""
    return isinstance(value, int | np.integer) and not isinstance(value, bool)


def is_number(value: object) -> bool:
    """Whether a value is a finite real number of Python or NumPy; True and False are none."""
    return is_integer(value) or (
        isinstance(value, float | np.floating) and math.isfinite(value)
    )


def require(condition: bool, key: str, found: Any, expected: str) -> None:
    """Raise a ValueError that names the configuration key unless the condition holds."""
    if not condition:
        raise ValueError(f"{key}: expected {expected}, found {found!r}")


def require_integer(key: str, value: Any, low: int, high: float = math.inf) -> None:
    """Raise a ValueError unless the value is an integer in [low, high]."""
    expected = (
        f"an integer ≥ {low}" if high == math.inf else f"an integer in [{low}, {high}]"
    )
    require(is_integer(value) and low <= value <= high, key, value, expected)


def require_number(key: str, value: Any, low: float, *, strict: bool = False) -> None:
    """Raise a ValueError unless the value is a finite number ≥ ``low``, > if ``strict``."""
    inside = is_number(value) and (low < value if strict else low <= value)
    require(inside, key, value, f"a finite number {'>' if strict else '≥'} {low:g}")
