"""Errors of configuration in one wording: ``key: expected …, found …``."""

from __future__ import annotations

import math
from typing import Any, TypeGuard

import numpy as np


def is_integer(value: object) -> TypeGuard[int]:
    """Whether a value is an integer of Python or NumPy; True and False are none."""
    return isinstance(value, int | np.integer) and not isinstance(value, bool)


def is_number(value: object) -> TypeGuard[float]:
    """Whether a value is a finite real number of Python or NumPy; True and False are none."""
    return is_integer(value) or (isinstance(value, float | np.floating) and math.isfinite(value))


def require(condition: bool, key: str, found: Any, expected: str) -> None:
    """Raise a ValueError that names the configuration key unless the condition holds."""
    if not condition:
        raise ValueError(f"{key}: expected {expected}, found {found!r}")


def require_integer(key: str, value: Any, low: int, high: int | None = None) -> None:
    """Raise a ValueError unless the value is an integer in [low, high] (no bound if None)."""
    inside = is_integer(value) and low <= value and (high is None or value <= high)
    expected = f"an integer ≥ {low}" if high is None else f"an integer in [{low}, {high}]"
    require(inside, key, value, expected)


def require_number(
    key: str, value: Any, low: float, high: float = math.inf, *, strict: bool = False
) -> None:
    """Raise a ValueError unless the value is a finite number in [low, high].

    With ``strict`` the lower end does not belong to the interval.
    """
    inside = is_number(value) and (low < value if strict else low <= value) and value <= high
    expected = f"a finite number {'>' if strict else '≥'} {low:g}"
    require(inside, key, value, expected + (f" and ≤ {high:g}" if high < math.inf else ""))
