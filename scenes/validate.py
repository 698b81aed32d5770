"""Errors of configuration, all as ``key: expected …, found …``."""

from __future__ import annotations

from typing import Any

from hdc.parameters import is_number


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
    sign = ">" if strict else "≥"
    inside = is_number(value) and value >= low and not (strict and value == low)
    require(inside, key, value, f"a finite number {sign} {low:g}")
