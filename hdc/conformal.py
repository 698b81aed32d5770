"""Which classes a frame may be of: conformal prediction by the scores of a read-out.

**Read-outs that count.** A model keeps up to 19 training frames of each class, chosen at random
(:class:`hdc.sample.Sample`). To ask whether a frame x is of class c, with n training frames and
their prototype P, compare

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

A p-value is at least 1/(m + 1). If that is above α, a class of at least 4 frames is compared with
those of all such classes: their leave-one-out distances minus the mean of their class, and those of
class c minus the mean of all m + 1. Coverage is then that of all classes together, and holds if
their distances spread alike. Distances of fewer frames minus their mean are too near to zero (those
of two frames are zero), so such a class is in every set, and nothing is refused.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from typing import Self

import numpy as np
import torch
from torch import Tensor

from hdc import bits
from hdc.inputs import Label
from hdc.readouts.base import HeldOut
from hdc.readouts.majority import EXTRAS, Counted, Counting, Majority
from hdc.sample import Sample

RATE = 0.05
"""Share of known frames that are refused unless another is given."""
_ROUNDING = 1e-300  # beyond zero, where distances are
FEWEST = 4
"""Frames of a class from which its distances are compared with those of other classes."""


@dataclass(frozen=True)
class Peers:
    """Training frames of one class, and how far out they are if a new frame is one of them, too."""

    held_out: np.ndarray
    """[m], leave-one-out distances."""
    most: np.ndarray
    """[m], the largest d_i that any frame x makes."""
    masks: Tensor | None = None
    """int64 [1 + m, W] where d_i depends on x: the bits of the prototype that become one if x has a
    one where x_i has none; and of each x_i those that are not lost, or not gained, where x has a
    one, too."""
    twice: np.ndarray | None = None
    """int64 [m], 2·d_i without the distances of x to the masks."""

    @classmethod
    def of(cls, words: Tensor, prototypes: Tensor) -> Self:
        """Peers of kept hypervectors [m, W] and prototypes [5, W] of the read-out's EXTRAS."""
        if_gained, if_zero, prototype, if_one, if_lost = prototypes
        lost = prototype & ~if_lost
        gained = if_gained & ~prototype
        shared = words & (lost | gained)
        # d_i of a black x; another adds |x ∧ gained| − |x ∧ shared_i|, where |x ∧ b| is half of
        # |x| + |b| − Ham(x, b).
        black = bits.count_ones(words ^ prototype) + bits.count_ones(words & lost)
        n_gained = bits.count_ones(gained)
        twice = 2 * black + n_gained - bits.count_ones(shared)
        without = (words & if_one) | (~words & if_zero)
        return cls(
            held_out=bits.count_ones(words ^ without).numpy(force=True),
            most=(black + n_gained).numpy(force=True),
            masks=torch.cat((gained[None], shared)),
            twice=twice.numpy(force=True),
        )

    def __len__(self) -> int:
        return len(self.most)

    def compared(self, words: Tensor) -> np.ndarray:
        """Distances d_i [Q, m] with each of the hypervectors [Q, W] as if of this class.

        [1, m] where they do not depend on it.
        """
        if self.masks is None:
            return self.most[None]
        to_masks = bits.hamming(words, self.masks).numpy(force=True)
        found: np.ndarray = (self.twice + to_masks[:, 1:] - to_masks[:, :1]) // 2
        return found

    @property
    def deviations(self) -> np.ndarray:
        """Leave-one-out distances minus their mean; none of too few frames."""
        if len(self) < FEWEST:
            return np.empty(0)
        return self.held_out - self.held_out.mean()


@dataclass(frozen=True)
class Rule:
    """How p-values are counted for one α, class by class."""

    pools: Sequence[np.ndarray | None]
    """Sorted deviations of the other classes, for a class that is compared with them, too."""
    least: np.ndarray
    """[L], the p-value of a frame that is farther out than all."""
    far: np.ndarray
    """[L], a distance d beyond which a frame is, whatever it is."""
    warning: str
    """Where some class is in every set, so that no frame is refused."""


@dataclass(frozen=True)
class Conformal:
    """Samples to compare with, class by class; None of a class without training frames."""

    peers: Sequence[Peers | None]
    prototypes: Tensor | None = None
    """int64 [L, W] that distances are of, where they are not minus the scores."""
    _rules: dict[float, Rule] = field(default_factory=dict, init=False, repr=False)

    @classmethod
    def of_counting(
        cls, readout: Counting, state: Counted, sample: Sample, labels: Sequence[Label]
    ) -> Self:
        """P-values from exchanging a kept frame and the new one in the counters of a read-out."""
        deciding = readout.deciding(state)
        peers: list[Peers | None] = []
        for row, label in enumerate(labels):
            own = None
            if sample.seen.get(label):
                own = Peers.of(sample.kept[label], deciding[row])
            peers.append(own)
        whole = deciding[:, EXTRAS.index(0)]
        # Those of classes of unequal size are thinned for the scores.
        same = isinstance(readout, Majority) and torch.equal(whole, state.prototypes)
        return cls(peers, None if same else whole.contiguous())

    @classmethod
    def of_scores(cls, held_out: HeldOut, counts: Tensor) -> Self:
        """P-values from scores of training frames as if each had not been learnt.

        Args:
            held_out: the scores; those of the only frame of a class say nothing, and are left out.
            counts: training frames int64 [L] of each class.
        """
        peers: list[Peers | None] = []
        for c, n in enumerate(counts.tolist()):
            own = held_out.scores[held_out.rows == c, c] if n > 1 else torch.empty(0)
            distances = -own.double().numpy()
            peers.append(Peers(distances, distances) if n else None)
        return cls(peers)

    def p_values(self, words: Tensor, scores: Tensor, alpha: float) -> np.ndarray:
        """p_c(x) of Q frames and L classes, [Q, L], to be compared with α.

        A class without training frames has p = 0.

        Args:
            words: hypervectors int64 [Q, W].
            scores: of the read-out [Q, L].
            alpha: α.
        """
        rule = self._rule(alpha)
        if rule.warning:
            warnings.warn(rule.warning, stacklevel=4)
        if self.prototypes is None:
            distances = -scores
        else:
            distances = bits.hamming(words, self.prototypes)
        d = distances.numpy(force=True)
        if d.dtype.kind == "f":
            d = d.astype(np.float64)
        found = np.repeat(rule.least[None], len(d), axis=0)
        near = d <= rule.far
        for c in np.flatnonzero(near.any(0)).tolist():
            own = self.peers[c]
            assert own is not None
            asked = near[:, c]
            of_asked = words
            if own.masks is not None and not asked.all():
                of_asked = words[torch.from_numpy(asked)]
            d_i = own.compared(of_asked)
            found[asked, c] = _p_values(d[asked, c], d_i, rule.pools[c])
        return found

    def possible(self, words: Tensor, scores: Tensor, alpha: float) -> np.ndarray:
        """Which classes Q frames may be of, bool [Q, L]; arguments as of :meth:`p_values`.

        A set that is not empty has the class of the largest score.
        """
        found = self.p_values(words, scores, alpha) > alpha
        known = found.any(1)
        best = scores.argmax(1).numpy(force=True)
        found[known, best[known]] = True
        return found

    def _rule(self, alpha: float) -> Rule:
        """The rule for one α, made once."""
        if alpha not in self._rules:
            self._rules[alpha] = self._made(alpha)
        return self._rules[alpha]

    def _made(self, alpha: float) -> Rule:
        n_classes = len(self.peers)
        pools: list[np.ndarray | None] = []
        least = np.zeros(n_classes)
        far = np.full(n_classes, -np.inf)
        for c, own in enumerate(self.peers):
            pool = None
            if own is not None:
                m = len(own)
                if (m + 1) * alpha < 1 and m >= FEWEST:
                    pool = _held_out_of_others(self.peers, c)
                least[c] = 1 / (m + 1 + (0 if pool is None else len(pool)))
                far[c] = _farthest(own, pool)
            pools.append(pool)
        return Rule(pools, least, far, _of_few(self.peers, alpha))


def _p_values(d: np.ndarray, d_i: np.ndarray, pool: np.ndarray | None) -> np.ndarray:
    """p of Q frames at distances d [Q], with d_i [Q or 1, m] and deviations of other classes."""
    m = d_i.shape[1]
    as_far = (d_i >= d[:, None]).sum(1)
    if pool is None:
        return (1 + as_far) / (m + 1)
    mean = (d_i.sum(1) + d) / (m + 1)
    nearer = np.searchsorted(pool, d - mean, "left")
    as_far += len(pool) - nearer
    return (1 + as_far) / (1 + m + len(pool))


def _farthest(own: Peers, pool: np.ndarray | None) -> float:
    """A distance d at which, and beyond, a frame is farther out than all that it is compared with.

    With the others of `pool`, it is d − (Σ d_i + d)/(m + 1) that has to exceed them.
    """
    m = len(own)
    if m == 0:
        return -math.inf
    found = float(own.most.max())
    if pool is not None and len(pool):
        beyond = ((m + 1) * float(pool[-1]) + float(own.most.sum())) / m
        found = max(found, beyond)
    return found + 1e-9 * abs(found) + _ROUNDING


def _of_few(peers: Sequence[Peers | None], alpha: float) -> str:
    """A warning where some class is in every set, so that no frame is refused."""
    kept = [len(peer) for peer in peers if peer is not None]
    n, least = sum(kept), min(kept, default=0)
    if (n + 1) * alpha < 1:
        # Exact shares: 1/0.05 − 1 is 19, not the 20 that rounding up floats gives.
        needed = math.ceil(1 / Fraction(str(alpha)) - 1)
        text = f"needs at least {needed} stored frames, found {n}"
    elif least < FEWEST and (least + 1) * alpha < 1:
        text = f"needs at least {FEWEST} stored frames of each class, found {least}"
    else:
        return ""
    return f"alpha={alpha:g} {text}; no frame is refused"


def _held_out_of_others(peers: Sequence[Peers | None], c: int) -> np.ndarray:
    """Leave-one-out distances, each minus the mean of its class, of all classes but c, sorted;
    without those of fewer frames than :data:`FEWEST`."""
    others = [own for b, own in enumerate(peers) if own is not None and b != c]
    found = [own.deviations for own in others]
    return np.sort(np.concatenate([np.empty(0), *found]))
