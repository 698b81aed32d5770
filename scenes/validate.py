"""Errors of configuration, all as ``key: expected …, found …``."""

from __future__ import annotations

from typing import Any

import numpy as np

from hdc.parameters import is_number


def is_integer(value: object) -> bool:
    """Whether a value is an integer of Python or NumPy; True and False are not."""
    if isinstance(value, bool):
        return False
    return isinstance(value, int | np.integer)


def require(
    condition: bool,
    key: str,
    found: Any,
    expected: str,
) -> None:
    """Raise a ValueError that names the configuration key unless the condition holds."""
    if not condition:
        raise ValueError(f"{key}: expected {expected}, found {found!r}")


def require_number(
    key: str,
    value: Any,
    low: float,
    *,
    strict: bool = False,
) -> None:
    """Raise a ValueError unless the value is a finite number ≥ ``low``, > if ``strict``."""
    if strict:
        inside = is_number(value) and low < value
        require(inside, key, value, f"a finite number > {low:g}")
    else:
        inside = is_number(value) and low <= value
        require(inside, key, value, f"a finite number ≥ {low:g}")
