"""Several thresholds by rank: a distributive thermometer code of each frame."""

from __future__ import annotations

from collections.abc import Mapping
from fractions import Fraction
from typing import Any, Self

from torch import Tensor

from hdc import bits, inputs
from hdc.encoders.ranks import RankEncoder, check_finite
from hdc.parameters import check_integer, check_share
from hdc.tensors import checked

_STEP = 64  # training frames summed at a time


class Levels(RankEncoder):
    """T bits per pixel, by the quantiles 1/(T + 1) … T/(T + 1) of the frame's own pixels.

    A distributive thermometer code (Bacellar et al., ICML 2024), here for each frame instead of
    each feature. For odd T half of all bits are ones, and the Hamming distance of two frames is the
    L1 distance of their pixels' ranks in T + 1 steps. Like the median, the code is invariant under
    monotone changes of a whole frame.

    Args:
        thresholds: T, the bits per pixel.
        lit: rank only the pixels that are lit in the training frames, with a mean of at least this
            share of the mean of all pixels. 0 ranks all pixels and learns nothing.
        ties: as in :class:`hdc.encoders.Median`.

    Attributes:
        lit_: bool tensor [D], the pixels that are ranked, where `lit` is not 0.

    Example:
        >>> import torch
        >>> words = Levels(3).encode(torch.tensor([[3, 9, 1, 5]]))
        >>> bits.unpack(words, 12).int().view(3, 4).tolist()
        [[1, 1, 0, 1], [0, 1, 0, 1], [0, 1, 0, 0]]
    """

    tied_share = 0.5

    lit_: Tensor

    def __init__(self, thresholds: int = 7, lit: float = 0.0, ties: str = "spread"):
        self.thresholds = thresholds
        self.lit = lit
        self.ties = ties

    @property
    def learns(self) -> bool:  # type: ignore[override]
        return self.lit > 0

    @property
    def quantiles(self) -> tuple[Fraction, ...]:  # type: ignore[override]
        steps = self.thresholds + 1
        return tuple(Fraction(t, steps) for t in range(1, steps))

    def check(self) -> None:
        check_integer("thresholds", self.thresholds, 1, 255)
        check_share("lit", self.lit, "[0, 1)")
        super().check()

    def fit(self, frames: Any) -> Self:
        """Learn which pixels are lit, unless `lit` is 0.

        Raises:
            ValueError: if fewer than two pixels are lit, or a pixel is not finite.
        """
        if not self.learns:
            return self
        total: Any = 0
        for start in range(0, len(frames), _STEP):
            part = inputs.tensor(frames[start : start + _STEP])
            values = part.flatten(1).cpu().double()
            if part.is_floating_point():
                check_finite(values, start)
            total = total + values.sum(0)
        lit = total >= self.lit * total.mean()
        if lit.sum() < 2:
            raise ValueError(
                f"lit: expected at least two lit pixels, found {int(lit.sum())}"
            )
        self.lit_ = lit
        return self

    def dimension(self, n_pixels: int) -> int:
        if self.lit > 0:
            n_pixels = int(self.lit_.sum())
        return self.thresholds * n_pixels

    def encode(self, frames: Tensor, first: int = 0) -> Tensor:
        if self.learns:
            lit = self.lit_.to(frames.device)
            frames = frames.flatten(1)[:, lit]
        return super().encode(frames, first)

    def state(self) -> dict[str, Tensor]:
        if not self.learns:
            return {}
        return {"lit": bits.pack(self.lit_)}

    def restore(self, tensors: Mapping[str, Tensor], n_pixels: int) -> None:
        if not self.learns:
            return super().restore(tensors, n_pixels)
        found = checked(tensors, {"lit": "int64 W"}, D=n_pixels)
        self.lit_ = bits.unpack(found["lit"], n_pixels)
