"""Encoders: packed hypervectors from frames, one method per file."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from hdc.encoders.base import Encoder
from hdc.encoders.named import ENCODERS, make_encoder
from hdc.encoders.relative import RelativeEncoder

if TYPE_CHECKING:
    from hdc.encoders.deviation import Deviation
    from hdc.encoders.levels import Levels
    from hdc.encoders.median import Median
    from hdc.encoders.quantile import Quantile
    from hdc.encoders.reference import Reference, ReferenceLevels
    from hdc.encoders.smoothed import Smoothed

__all__ = [
    "ENCODERS",
    "Deviation",
    "Encoder",
    "Levels",
    "Median",
    "Quantile",
    "Reference",
    "ReferenceLevels",
    "RelativeEncoder",
    "Smoothed",
    "make_encoder",
]


def __getattr__(name: str) -> Any:
    """The encoders, imported when asked for."""
    return ENCODERS.attribute(__name__, name)
