"""The published encoder: each pixel against the median of its frame."""

from __future__ import annotations

from fractions import Fraction

from hdc.encoders.ranks import RankEncoder


class Median(RankEncoder):
    """One bit per pixel, exactly ⌊D/2⌋ ones (Kitagawa et al., Opt. Express 32, 3209, Sec. II).

    In other fields this is a median threshold bitmap (Ward, J. Graph. Tools 8, 17 (2003)). It is
    invariant under monotone changes of a whole frame.

    Args:
        ties: which of the pixels equal to the median become ones: ``"spread"``, the first in one
            pseudo-random order of pixels (:mod:`hdc.encoders.ties`).

    Example:
        >>> import torch
        >>> Median().encode(torch.tensor([[3, 9, 1, 5]]))  # pixels 1 and 3
        tensor([[10]])
    """

    quantiles = (Fraction(1, 2),)
