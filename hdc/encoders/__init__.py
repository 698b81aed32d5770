"""Encoders: frames to packed hypervectors, one idea a file."""

from __future__ import annotations

from typing import Any

from torch import Tensor

from hdc.encoders.base import Encoder
from hdc.encoders.deviation import Deviation
from hdc.encoders.levels import Levels
from hdc.encoders.median import Median
from hdc.encoders.quantile import Quantile
from hdc.encoders.reference import Reference, ReferenceLevels
from hdc.encoders.relative import RelativeEncoder
from hdc.encoders.smoothed import Smoothed
from hdc.parameters import make_part

__all__ = [
    "COMPARED",
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

ENCODERS: dict[str, type[Encoder]] = {
    "median": Median,
    "quantile": Quantile,
    "levels": Levels,
    "reference": Reference,
    "reference_levels": ReferenceLevels,
    "deviation": Deviation,
    "smoothed": Smoothed,
}
"""Our own encoders by name."""

COMPARED = tuple(name for name in ENCODERS if name != "smoothed")
"""Those that a comparison tries where none are asked for: smoothing is for images alone."""


def make_encoder(part: Any, what: str = "encoder") -> Encoder:
    """An encoder of a name, a dotted name ``"module.Class"``, or an object; `what` names errors.

    Raises:
        ValueError, TypeError: as of :func:`hdc.parameters.make_part`.
    """
    return make_part(part, what, ENCODERS, Encoder)  # type: ignore[return-value]


def encode_with(
    encoder: Encoder,
    frames: Tensor,
    first: int,
    backend: str,
    out: Tensor | None = None,
) -> Tensor:
    """Hypervectors by an encoder; one from outside is asked for no more than frames to words."""
    if type(encoder) in ENCODERS.values():
        return encoder.encode(frames, first, backend, out)  # type: ignore[call-arg]
    return encoder.encode(frames)
