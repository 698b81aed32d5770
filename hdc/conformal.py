"""Conformal prediction: p-values and prediction sets from the scores of a read-out.

**Read-outs that count.** A model keeps up to 19 training frames of each class, chosen at random
(:class:`hdc.hypervectors.Sample`). To ask whether a frame x is of class c, with n training frames
and their prototype P, compare

- d, the distance of x to P, with
- d_i, the distance of a kept frame x_i to the prototype of the n frames with x in place of x_i.

The counters give each d_i exactly: a prototype bit changes only where one count more or less
decides. The p-value is the share of frames that are as far out as x, x included:

    p_c(x) = (1 + #{i: d_i ≥ d}) / (m + 1)        m frames kept.

If x and the training frames of class c are exchangeable, then P(p_c(x) ≤ α) ≤ α for every α, n and
D, whatever the distribution of frames. This is full conformal prediction (Vovk, Gammerman, Shafer,
Algorithmic Learning in a Random World, 2005, Prop. 2.3), class by class. It holds on average over
training sets, and not after drift.

**Other read-outs.** Here d is minus the score of class c. Training frame i of the class has d_i,
minus its score from a read-out that has not learnt it: in closed form, or from four folds of five.
This is the jackknife. It keeps 1 − α if one frame more or less hardly moves the scores, and has no
guarantee. The 1 − 2α of the jackknife+ and of CV+ (Barber et al., Ann. Statist. 49, 486 (2021))
would need, for each query, a model without each training frame; a file would hold five models, or
all training frames. Scores from four fifths of the frames are lower, and their sets cover more.

**Few frames.** A p-value is at least 1/(m + 1). If that is above α, a class of at least 4 frames is
pooled with all other such classes: their leave-one-out distances, each minus the mean of its class,
join the distances of class c minus the mean of all m + 1. Coverage then holds on average over the
classes, if their distances have the same spread. A class of fewer frames is in every set, so that
no frame is refused: with so few, distances minus their mean are too near zero (for two frames they
are zero).
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction
from typing import Self

import numpy as np
import torch
from torch import Tensor

from hdc import bits
from hdc.hypervectors import Sample
from hdc.readouts.base import HeldOut
from hdc.readouts.majority import EXTRAS, Counted, Counting, Majority
from hdc.warning import warn

RATE = 0.05
"""Default α, the share of known frames that are refused."""
FEWEST = 4
"""Training frames of a class from which on it is pooled with other classes."""


@dataclass(frozen=True)
class Conformal:
    """Training frames to compare with."""

    peers: Mapping[int, Peers]
    """The entries of classes with training frames, by class."""
    prototypes: Tensor | None = None
    """int64 [L, W], for distances to these prototypes instead of minus the scores."""

    @classmethod
    def of_counting(cls, readout: Counting, state: Counted, sample: Sample) -> Self:
        """P-values by exchanging a stored frame for the new one in the counters of a read-out."""
        deciding = readout.deciding(state)
        peers = {row: Peers.of(own, deciding[row]) for row, own in sample.kept.items()}
        whole = deciding[:, EXTRAS.index(0)]
        # For classes of unequal size, the prototypes of the scores may be thinned.
        same = isinstance(readout, Majority) and torch.equal(whole, state.prototypes)
        return cls(peers, None if same else whole.contiguous())

    @classmethod
    def of_scores(cls, held_out: HeldOut, counts: Tensor) -> Self:
        """P-values by the scores of left-out training frames.

        Args:
            held_out: the scores; the only frame of a class says nothing, and is not used.
            counts: training frames of each class, int64 [L].
        """
        peers = {}
        for c in counts.nonzero().flatten().tolist():
            own = held_out.scores[(held_out.rows == c) & (counts[c] > 1), c]
            distances = -own.double().numpy()
            peers[c] = Peers(distances, distances)
        return cls(peers)

    def p_values(self, words: Tensor, scores: Tensor, alpha: float) -> np.ndarray:
        """p-values p_c(x) [Q, L] of Q frames for L classes, to be compared with α.

        A class without training frames has p = 0.

        Args:
            words: hypervectors int64 [Q, W].
            scores: scores of the read-out [Q, L].
            alpha: α.
        """
        _warn_of_few(self.peers, alpha)
        if self.prototypes is None:
            distances = -scores
        else:
            distances = bits.hamming(words, self.prototypes)
        d = distances.numpy(force=True).astype(np.float64)
        found = np.zeros(d.shape)
        for c, own in self.peers.items():
            found[:, c] = own.p_values(words, d[:, c], self._pool(c, alpha))
        return found

    def possible(self, words: Tensor, scores: Tensor, alpha: float) -> np.ndarray:
        """Prediction sets of Q frames, bool [Q, L]; arguments as in :meth:`p_values`.

        A set that is not empty contains the class of the largest score.
        """
        found = self.p_values(words, scores, alpha) > alpha
        known = found.any(1)
        best = scores.argmax(1).numpy(force=True)
        found[known, best[known]] = True
        return found

    def _pool(self, c: int, alpha: float) -> np.ndarray | None:
        """Sorted deviations of all other classes, if class c is pooled with them; else None."""
        m = len(self.peers[c])
        if (m + 1) * alpha >= 1 or m < FEWEST:
            return None
        found = [
            own.held_out - own.held_out.mean()
            for b, own in self.peers.items()
            if b != c and len(own) >= FEWEST
        ]
        return np.sort(np.concatenate([np.empty(0), *found]))


@dataclass(frozen=True)
class Peers:
    """Training frames of one class, and their distances if a new frame joins the class."""

    held_out: np.ndarray
    """[m], leave-one-out distances."""
    most: np.ndarray
    """[m], the largest d_i for any frame x."""
    masks: Tensor | None = None
    """int64 [1 + m, W] where d_i depends on x: the bits of the prototype that become one if x has a
    one where x_i has none; and of each x_i those that are not lost, or not gained, where x has a
    one, too."""
    twice: np.ndarray | None = None
    """int64 [m], 2·d_i without the distances of x to the masks."""

    @classmethod
    def of(cls, words: Tensor, prototypes: Tensor) -> Self:
        """Peers from stored hypervectors [m, W] and the five prototypes [5, W] of EXTRAS."""
        if_gained, if_zero, prototype, if_one, if_lost = prototypes
        lost = prototype & ~if_lost
        gained = if_gained & ~prototype
        shared = words & (lost | gained)
        # d_i of a black x; another adds |x ∧ gained| − |x ∧ shared_i|, where |x ∧ b| is half of
        # |x| + |b| − Ham(x, b).
        black = bits.count_ones(words ^ prototype) + bits.count_ones(words & lost)
        n_gained = bits.count_ones(gained)
        twice = 2 * black + n_gained - bits.count_ones(shared)
        without = bits.where(words, if_one, if_zero)
        return cls(
            held_out=bits.count_ones(words ^ without).numpy(force=True),
            most=(black + n_gained).numpy(force=True),
            masks=torch.cat((gained[None], shared)),
            twice=twice.numpy(force=True),
        )

    def __len__(self) -> int:
        return len(self.most)

    def compared(self, words: Tensor) -> np.ndarray:
        """Distances d_i [Q, m] if each of the hypervectors [Q, W] joins this class.

        The shape is [1, m] if they do not depend on the hypervector.
        """
        if self.masks is None:
            return self.most[None]
        to_masks = bits.hamming(words, self.masks).numpy(force=True)
        found: np.ndarray = (self.twice + to_masks[:, 1:] - to_masks[:, :1]) // 2
        return found

    def p_values(
        self, words: Tensor, d: np.ndarray, pool: np.ndarray | None
    ) -> np.ndarray:
        """p-values [Q] of hypervectors [Q, W] at distances d [Q] from the class."""
        if pool is not None:
            return _p_values(d, self.compared(words), pool)
        found = np.full(len(d), 1 / (len(self) + 1))
        near = (d[:, None] <= self.most).any(1)  # others are farther out than all
        found[near] = _p_values(d[near], self.compared(words[torch.from_numpy(near)]))
        return found


def _p_values(
    d: np.ndarray, d_i: np.ndarray, pool: np.ndarray | None = None
) -> np.ndarray:
    """p-values [Q] of distances d [Q], for d_i [Q or 1, m] and deviations of other classes."""
    m = d_i.shape[1]
    as_far = (d_i >= d[:, None]).sum(1)
    if pool is None:
        return (1 + as_far) / (m + 1)
    mean = (d_i.sum(1) + d) / (m + 1)
    nearer = np.searchsorted(pool, d - mean, "left")
    as_far += len(pool) - nearer
    return (1 + as_far) / (1 + m + len(pool))


def _warn_of_few(peers: Mapping[int, Peers], alpha: float) -> None:
    """Warn if some class is in every set, so that no frame is refused."""
    kept = [len(own) for own in peers.values()]
    n, least = sum(kept), min(kept, default=0)
    if (n + 1) * alpha < 1:
        # Exact shares: 1/0.05 − 1 is 19, not the 20 that rounding up floats gives.
        needed = math.ceil(1 / Fraction(str(alpha)) - 1)
        text = f"needs at least {needed} stored frames, found {n}"
    elif least < FEWEST and (least + 1) * alpha < 1:
        text = f"needs at least {FEWEST} stored frames of each class, found {least}"
    else:
        return
    warn(f"alpha={alpha:g} {text}; no frame is refused")
