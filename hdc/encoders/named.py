"""Encoders by name, and the base class of encoders that use another encoder."""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any, ClassVar

from torch import Tensor

from hdc.encoders.base import Encoder
from hdc.parameters import Family

ENCODERS = Family(
    "encoder",
    Encoder,
    {
        "median": "hdc.encoders.median.Median",
        "quantile": "hdc.encoders.quantile.Quantile",
        "levels": "hdc.encoders.levels.Levels",
        "reference": "hdc.encoders.reference.Reference",
        "reference_levels": "hdc.encoders.reference.ReferenceLevels",
        "deviation": "hdc.encoders.deviation.Deviation",
        "smoothed": "hdc.encoders.smoothed.Smoothed",
    },
)
"""Our own encoders by name."""
make_encoder: Callable[..., Encoder] = ENCODERS
"""An encoder from a name, a dotted name ``"module.Class"``, or an object; see
:class:`hdc.parameters.Family`."""


class Around(Encoder):
    """An encoder that uses another one, its parameter `base`: a name or an object."""

    parts: ClassVar = {"base": functools.partial(ENCODERS, what="base")}
    numbered = True

    base: Any

    @property
    def base_(self) -> Encoder:
        """The other encoder, created from `base`; it may learn."""
        kept = getattr(self, "_base", None)
        if kept is None or kept[0] is not self.base:  # changed since
            kept = self._base = self.base, self.parts["base"](self.base).unlearned()
        return kept[1]

    def encode_by_base(self, frames: Tensor, first: int) -> Tensor:
        """Hypervectors of frames by the other encoder; `first` is the index of the first frame."""
        base: Any = self.base_
        return base.encode(frames, first) if base.numbered else base.encode(frames)

    def check(self) -> None:
        self.base_.check()

    def dimension(self, n_pixels: int) -> int:
        return self.base_.dimension(n_pixels)
