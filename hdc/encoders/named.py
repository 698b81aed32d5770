"""Encoders by name, and how one asks another; the package fills in its own."""

from __future__ import annotations

from typing import Any

from torch import Tensor

from hdc.encoders.base import Encoder
from hdc.parameters import make_part

ENCODERS: dict[str, type[Encoder]] = {}
"""Our own encoders by name."""


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
