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

import functools
import math
import warnings
from collections.abc import Sequence
from dataclasses import dataclass
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
    """The kept frames of one class, and what a new frame changes for them."""

    constant: np.ndarray
    """[m], distances d_i for a black frame x."""
    gained: Tensor
    """[W], bits of the prototype that become one if x has a one where x_i has none."""
    shared: Tensor
    """[m, W], bits of x_i that are not lost, or not gained, where x has a one, too."""
    n_shared: Tensor
    """int64 [m], ones of these."""
    held_out: np.ndarray
    """[m], leave-one-out distances minus their mean; none of a single frame."""
    mean: float
    """Mean of the leave-one-out distances; NaN of a single frame."""
    most: np.ndarray
    """[m], the largest d_i that any frame x makes."""

    @classmethod
    def of(cls, words: Tensor, prototypes: Tensor) -> Peers:
        """Peers of kept hypervectors [m, W] and prototypes [5, W] of the read-out's EXTRAS."""
        if_gained, if_zero, prototype, if_one, if_lost = prototypes
        lost = prototype & ~if_lost
        gained = if_gained & ~prototype
        constant = bits.count_ones(words ^ prototype)
        constant += bits.count_ones(words & lost)
        without = (words & if_one) | (~words & if_zero)
        distances = bits.count_ones(words ^ without)
        held_out = distances.numpy(force=True).astype(np.float64)
        mean = np.nan
        if len(held_out) > 1:
            mean = float(held_out.mean())
            held_out = held_out - mean
        else:
            held_out = held_out[:0]
        shared = words & (lost | gained)
        most = constant + bits.count_ones(gained)
        return cls(
            constant=constant.numpy(force=True),
            gained=gained,
            shared=shared,
            n_shared=bits.count_ones(shared),
            held_out=held_out,
            mean=mean,
            most=most.numpy(force=True),
        )

    def __len__(self) -> int:
        return len(self.constant)

    def compared(self, words: Tensor) -> np.ndarray:
        """Distances d_i [Q, m] with each of the hypervectors [Q, W] as if of this class."""
        ones = bits.count_ones(words)[:, None]
        differing = bits.hamming(words, self.shared)
        overlap = (ones + self.n_shared - differing) // 2
        gained = bits.count_ones(words & self.gained)[:, None]
        moved = (gained - overlap).numpy(force=True)
        return self.constant + moved


@dataclass(frozen=True)
class LeftOut:
    """Scores of training frames of one class by read-outs that have not learnt them."""

    most: np.ndarray
    """[m], minus the scores: d_i, whatever the new frame is."""
    held_out: np.ndarray
    """[m], the same minus their mean; none of a single frame."""

    @classmethod
    def of(cls, scores: np.ndarray) -> LeftOut:
        """Mean of the scores [m] of their own class."""
        deviations = scores.mean() - scores if len(scores) > 1 else scores[:0]
        return cls(-scores, deviations)

    def __len__(self) -> int:
        return len(self.most)

    def compared(self, words: Tensor) -> np.ndarray:
        """Distances d_i [Q, m], the same for each of Q frames."""
        return np.broadcast_to(self.most, (len(words), len(self)))


Compared = Peers | LeftOut
"""Samples that frames are compared with, to know whether they may be of one class."""


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

    peers: Sequence[Compared | None]
    prototypes: Tensor | None = None
    """int64 [L, W] that distances are of, where they are not minus the scores."""

    @classmethod
    def of_counting(
        cls, readout: Counting, state: Counted, sample: Sample, labels: Sequence[Label]
    ) -> Self:
        """P-values from exchanging a kept frame and the new one in the counters of a read-out."""
        deciding = readout.deciding(state)
        peers: list[Compared | None] = []
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
        peers: list[Compared | None] = []
        for c, n in enumerate(counts.tolist()):
            own = held_out.scores[held_out.rows == c, c] if n > 1 else torch.empty(0)
            peers.append(LeftOut.of(own.double().numpy()) if n else None)
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
        result = np.tile(rule.least, (len(words), 1))
        near = d <= rule.far
        for c in np.flatnonzero(near.any(0)).tolist():
            own = self.peers[c]
            assert own is not None
            rows = np.flatnonzero(near[:, c])
            of_rows = words
            if len(rows) < len(words):
                of_rows = words[torch.from_numpy(rows).to(words.device)]
            result[rows, c] = _p_values(
                d[rows, c], own.compared(of_rows), rule.pools[c]
            )
        return result

    def possible(self, words: Tensor, scores: Tensor, alpha: float) -> np.ndarray:
        """Which classes Q frames may be of, bool [Q, L]; arguments as of :meth:`p_values`.

        A set that is not empty has the class of the largest score.
        """
        found = self.p_values(words, scores, alpha) > alpha
        known = found.any(1)
        best = scores.argmax(1).numpy(force=True)
        found[known, best[known]] = True
        return found

    @functools.cached_property
    def _rules(self) -> dict[float, Rule]:
        return {}

    def _rule(self, alpha: float) -> Rule:
        """The rule for one α, made once."""
        found = self._rules.get(alpha)
        if found is None:
            found = self._rules[alpha] = self._made(alpha)
        return found

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
    """p of Q frames at distances d [Q], with d_i [Q, m] and the deviations of other classes."""
    m = d_i.shape[1]
    as_far = (d_i >= d[:, None]).sum(1)
    if pool is None:
        return (1 + as_far) / (m + 1)
    mean = (d_i.sum(1) + d) / (m + 1)
    nearer = np.searchsorted(pool, d - mean, "left")
    as_far += len(pool) - nearer
    return (1 + as_far) / (1 + m + len(pool))


def _farthest(own: Compared, pool: np.ndarray | None) -> float:
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


def _of_few(peers: Sequence[Compared | None], alpha: float) -> str:
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


def _held_out_of_others(peers: Sequence[Compared | None], c: int) -> np.ndarray:
    """Leave-one-out distances, each minus the mean of its class, of all classes but c, sorted;
    without those of fewer frames than :data:`FEWEST`."""
    found = [np.empty(0)]
    for other, peer in enumerate(peers):
        if peer is not None and other != c and len(peer.held_out) >= FEWEST:
            found.append(peer.held_out)
    return np.sort(np.concatenate(found))
