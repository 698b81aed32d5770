"""Colours of the page: Okabe and Ito's, which the colour-blind tell apart, darkened for text."""

from __future__ import annotations

from collections.abc import Sequence

BLUE, ORANGE = "#0060a0", "#b35900"
_CLASSES = (BLUE, "#a83c00", "#007a56", "#9a4f7e", "#7a6a00", "#2f7fa8", "#555555", "#5b3fa0")


def of(names: Sequence[str], name: str) -> str:
    """The colour of a class among others."""
    return _CLASSES[names.index(name) % len(_CLASSES)] if name in names else "#222222"
