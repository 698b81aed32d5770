"""Errors of configuration: which key, what was found, what was expected."""

from __future__ import annotations

import math
from typing import Any


def require(condition: bool, key: str, found: Any, expected: str) -> None:
    """Raise ``ValueError`` naming the configuration key unless the condition holds."""
    if not condition:
        raise ValueError(f"{key}: found {found!r}, expected {expected}")


def require_number(
    key: str, value: Any, low: float, high: float = math.inf, *, strict: bool = False
) -> None:
    """A finite number in [low, high], or in (low, high] if ``strict``."""
    number = isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)
    inside = number and (low < value if strict else low <= value) and value <= high
    limits = f"{'>' if strict else '>='} {low:g}" + (f" and <= {high:g}" if high < math.inf else "")
    require(inside, key, value, f"a number {limits}")


def require_count(key: str, value: Any, low: int = 1) -> None:
    """An integer of at least ``low``."""
    good = isinstance(value, int) and not isinstance(value, bool) and value >= low
    require(good, key, value, f"an integer >= {low}")
