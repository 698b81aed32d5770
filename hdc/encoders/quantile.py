"""One threshold at another quantile than the median."""

from __future__ import annotations

from fractions import Fraction

from hdc.encoders.ranks import RankEncoder, exact_quantile


class Quantile(RankEncoder):
    """One bit per pixel: the brightest ⌊(1 − q)·D⌋ pixels become ones.

    Where a part b of every frame is dark, the median of the lit part is the quantile b + (1 − b)/2
    of the frame.

    Args:
        at: the quantile q in (0, 1), a number or a text such as ``"3/4"``.
        ties: as of :class:`hdc.encoders.Median`.

    Example:
        >>> import torch
        >>> Quantile(at="3/4").encode(torch.tensor([[3, 9, 1, 5]]))  # pixel 1
        tensor([[2]])
    """

    def __init__(self, at: float | str = "3/4", ties: str = "spread"):
        self.at = at
        self.ties = ties

    @property
    def quantiles(self) -> tuple[Fraction, ...]:
        return (exact_quantile("at", self.at),)
