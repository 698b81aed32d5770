"""One threshold at another quantile than the median."""

from __future__ import annotations

from fractions import Fraction
from typing import Any

from hdc.encoders.ranks import RankEncoder


class Quantile(RankEncoder):
    """One bit per pixel: the brightest ⌊(1 − q)·D⌋ pixels become ones.

    If a share b of every frame is dark, the median of the lit part is the quantile b + (1 − b)/2 of
    the frame.

    Args:
        at: the quantile q in (0, 1), a number or a text such as ``"3/4"``.
        ties: as in :class:`hdc.encoders.Median`.

    Example:
        >>> import torch
        >>> Quantile(at="3/4").encode(torch.tensor([[3, 9, 1, 5]]))  # pixel 1
        tensor([[2]])
    """

    def __init__(self, at: float | str = "3/4", ties: str = "spread"):
        self.at = at
        self.ties = ties

    @property
    def quantiles(self) -> tuple[Fraction, ...]:  # type: ignore[override]
        return (_exact(self.at),)


def _exact(value: Any) -> Fraction:
    """A quantile as an exact fraction, from ``"3/4"``, ``0.9`` or a Fraction.

    It is read from the text, since ⌊(1 − .9)·250000⌋ is 24999 in floating point.

    Raises:
        ValueError: unless it is a number in (0, 1).
    """
    try:
        quantile = Fraction(str(value))
    except (ValueError, ZeroDivisionError):
        quantile = Fraction(0)
    if not 0 < quantile < 1:
        raise ValueError(f"at: expected a quantile in (0, 1), found {value!r}")
    return quantile
