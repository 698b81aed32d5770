"""Prototypes that learn from their mistakes: one pass, on packed bits.

AdaptHD (Imani et al., BioCAS 2019) and OnlineHD (Hernández-Cano et al., DATE 2021) add a
hypervector that was taken for another class to its own prototype and subtract it from the other.
Written in ±1, subtracting a hypervector is adding its complement, so both are further hypervectors
in a bundle: the counters of :mod:`hdc.prototypes` and their majority serve as they are, and nothing
is kept of a sample but what it added to them.

While a class has few samples, a correction outvotes them wherever they are tied, and its prototype
turns away from what all classes have in common: on simulated touch frames that costs accuracy up to
some tens of samples, and gains next to none beyond.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Self

import torch
from torch import Tensor

from hdc import bits
from hdc.classifier import HDCClassifier
from hdc.inputs import Label


class OnlineHDCClassifier(HDCClassifier):
    """:class:`hdc.HDCClassifier` that weights a sample by whether it was recognised.

    Each frame is first classified with the prototypes of the frames before it, then counted: so
    many times as `bundle` says in its own class, and, if it was taken for another one, `correction`
    times more there and as often with its complement in the class it was taken for. The first frame
    of a class corrects nothing. The order of the frames matters.

    Args:
        bundle: how often every sample is counted; 0 learns from mistakes alone (and from the first
            sample of a class), as AdaptHD does.
        correction: how often a mistake is; 0 is HDCClassifier.
        ties, seed, device: see :class:`hdc.HDCClassifier`.

    Attributes:
        counts_: int64 array [L], hypervectors in each bundle, corrections included.

    Others are those of HDCClassifier. What leaving a frame out would change is not known, so that
    ``is_known``, ``predict_set`` and ``reject`` are refused.

    Raises:
        ValueError: in ``fit``, ``train`` and ``partial_fit``, for weights that are no integers from
            0, or both 0.
    """

    prototype = "binary"
    readout = "prototype"
    n_neighbours = 1
    balance = False
    backend = "numpy"

    def __init__(
        self,
        bundle: int = 2,
        correction: int = 1,
        ties: str = "zero",
        seed: int = 0,
        device: str = "cpu",
    ):
        self.bundle = bundle
        self.correction = correction
        self.ties = ties
        self.seed = seed
        self.device = device

    def _check_parameters(self) -> None:
        super()._check_parameters()
        for name, value in (("bundle", self.bundle), ("correction", self.correction)):
            if isinstance(value, bool) or not isinstance(value, int) or value < 0:
                raise ValueError(f"{name}: expected an integer from 0, found {value!r}")
        if self.bundle == self.correction == 0:
            raise ValueError("bundle, correction: expected one above 0, found 0 and 0")

    def merge(self, other: HDCClassifier) -> Self:
        """Not defined: what a model adds depends on all frames before."""
        raise ValueError(
            f"merge: expected models whose training is a sum, found {type(self).__name__}"
        )

    def _learn(self, words: Tensor, rows: Tensor, labels: Sequence[Label]) -> None:
        """Classify and count hypervectors int64 [N, W] of classes int64 [N], one after another.

        None is kept for :meth:`is_known`: what leaving one out would change is not known.
        """
        inside = bits.pack(torch.ones(self.dimension_, dtype=torch.bool)).to(words.device)
        for word, row in zip(words, rows.tolist(), strict=True):
            known = self.counters_.n[row] > 0
            # (hypervector, class, times)
            adds = [(word, row, self.bundle if known else max(1, self.bundle))]
            if known and (taken := int(self._hamming(word[None])[0].argmin())) != row:
                adds[0] = (word, row, self.bundle + self.correction)
                adds.append((~word & inside, taken, self.correction))
            repeated = [word for word, _, times in adds for _ in range(times)]
            classes = [c for _, c, times in adds for _ in range(times)]
            if repeated:
                self.counters_.add(torch.stack(repeated), torch.tensor(classes))
                self._outdated.update(classes)
                self._update_prototypes()
