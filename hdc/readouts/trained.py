"""Binary prototypes corrected by their mistakes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import torch
from torch import Tensor

from hdc import bits
from hdc.bits import combinations
from hdc.hypervectors import Hypervectors
from hdc.parameters import check_integer, check_share
from hdc.readouts.base import Readout, State
from hdc.tensors import Kinds

_FAR = 2**62


@dataclass(frozen=True, kw_only=True, eq=False)
class Corrected(State):
    """Corrected prototypes."""

    kinds: ClassVar[Kinds] = {"prototypes": "int64 L W", "empty": "int64 L"}
    prototypes: Tensor
    """int64 [L, W]."""
    empty: Tensor
    """int64 [L] (CPU), zeros: version 3.0 reads a file with it."""


class Trained(Readout):
    """Nearest prototype in Hamming distance, where prototypes are corrected in several passes.

    The rule is QuantHD (Imani et al., IEEE TCAD 39, 2268 (2020)) with a margin. In each pass, every
    frame that is not nearer to its own prototype than to all others, by a margin, is added to the
    counter of its class and subtracted from the counter of the nearest other class. Prototypes are
    the signs of the counters. Nothing is random. In pass p a frame counts 1/p, for which stochastic
    approximation converges (Robbins, Monro, Ann. Math. Stat. 22, 400 (1951)); with equal steps the
    prototypes oscillate if most frames lie within the margin.

    Args:
        margin: margin as a share of the D bits.
        passes: passes over the training frames at most; training ends when no frame is corrected.
    """

    State = Corrected
    needs = ("prototypes",)

    def __init__(self, margin: float = 0.02, passes: int = 20):
        self.margin = margin
        self.passes = passes

    def check(self) -> None:
        check_share("margin", self.margin, "[0, 1)")
        check_integer("passes", self.passes, 0)

    def fit(self, words: Hypervectors, rows: Tensor, n_classes: int) -> Corrected:
        """See :meth:`hdc.readouts.base.Readout.fit`; takes 16·L·D bytes of memory."""
        everyone = torch.nn.functional.one_hot(rows, n_classes)
        counters = combinations(everyone, words.packed).double()
        state = _binarised(counters, words)
        for number in range(1, self.passes + 1):
            votes = self._corrections(state, words, rows)
            if not votes.any():
                break
            wrong = votes.any(1)
            step = combinations(votes[wrong], words[wrong].packed).double()
            counters += step / number
            state = _binarised(counters, words)
        return state

    def _corrections(
        self, state: Corrected, words: Hypervectors, rows: Tensor
    ) -> Tensor:
        """Corrections [N, L]: 1 for a wrong frame's class, −1 for the nearest other class."""
        distances = -self.scores(state, words).cpu()
        places = torch.arange(len(rows))
        own = distances[places, rows]
        distances[places, rows] = _FAR
        nearest, rival = distances.min(1)
        wrong = nearest - own < self.margin * words.dimension
        votes = torch.zeros(len(rows), distances.shape[1])
        votes[places[wrong], rows[wrong]] = 1
        votes[places[wrong], rival[wrong]] = -1
        return votes

    def scores(self, state: Corrected, words: Hypervectors) -> Tensor:
        """Minus the Hamming distances, int64 [Q, L]."""
        return -bits.hamming(words.packed, state.prototypes)


def _binarised(counters: Tensor, words: Hypervectors) -> Corrected:
    """The state with the signs of counters [L, 64·W] as prototypes."""
    signs = counters[:, : words.dimension] > 0
    packed = bits.pack(signs).to(words.packed.device)
    none = torch.zeros(len(packed), dtype=torch.int64)
    return Corrected(prototypes=packed, empty=none)
