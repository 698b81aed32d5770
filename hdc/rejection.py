"""Which classes a frame may be of, with a guarantee: conformal prediction from the counters.

A model keeps up to 19 training frames of each class, chosen at random (:class:`Sample`). To ask
whether a frame x is of class c, with n training frames and their prototype P, compare

- d, the distance of x to P, with
- d_i, the distance of a kept frame x_i to the prototype of the n frames with x in place of x_i.

The counters give each d_i exactly: a prototype bit changes only where one count more or less
decides. The p-value is the share of frames that are as far out as x, x included:

    p_c(x) = (1 + #{i: d_i ≥ d}) / (m + 1)        m frames kept.

If x and the training frames of class c are exchangeable, then P(p_c(x) ≤ α) ≤ α for every α, n and
D, whatever the distribution of frames: full conformal prediction (Vovk, Gammerman, Shafer,
Algorithmic Learning in a Random World, 2005, Prop. 2.3), class by class. It holds on average over
training sets; after drift it does not hold at all.

A p-value is at least 1/(m + 1). Where that is above α, a class of at least 4 kept frames is
compared with those of all such classes: their leave-one-out distances less the mean of their class,
and those of class c less the mean of all m + 1. Coverage is then that of all classes together, not
of each, and holds as far as their distances spread alike. Distances of fewer frames less their mean
are too near to zero (those of two frames are zero), so such a class is in every set, and nothing is
refused.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
from torch import Tensor

from hdc import bits
from hdc.estimator import Estimator
from hdc.inputs import Label, check_share
from hdc.readouts.majority import Counting

KEPT = 19
"""Hypervectors kept of a class: p-values in steps of 5 %; 0.6 MB a class at D = 250,000."""
RATE = 0.05
"""Share of known frames that are refused unless another is given."""
FEWEST = 4
"""Frames of a class from which its distances are compared with those of other classes."""
_SEED = 0  # of the choice among training frames
_WORD = 2**64 - 1


class Rejecting(Estimator):
    """A classifier that says which classes a frame may be of, or that it is of none.

    It compares with the prototypes of a read-out that counts, whatever read-out decides.
    """

    classes_: np.ndarray
    _majority: Counting  # prototypes for distances and rejection: the read-out's own, if it counts
    _sample: Sample
    _peers: list[Peers | None] | None  # of sample and prototypes, made when asked for

    def predict_set(self, frames: Any, alpha: float = 0.1) -> list[np.ndarray]:
        """The classes that each of Q frames may be of: Q arrays of labels.

        For fresh frames exchangeable with the training frames of their class, the set has the right
        label with probability 1 − alpha at least (:mod:`hdc.rejection`): of each class with
        1/alpha − 1 training frames or more, of all together with fewer. A class with fewer than
        that and than 4 is in every set. The set is empty for a frame that is like none of the
        classes.

        Raises:
            ValueError: as :meth:`is_known`.
        """
        share = check_share(alpha)
        possible = self._p_values(frames, share) > share
        return [self.classes_[row] for row in possible]

    def is_known(self, frames: Any, reject: float = RATE) -> np.ndarray:
        """Whether frames are as near to a prototype as frames of its class are: bool [Q].

        False where :meth:`predict_set` is empty: for a share `reject` of fresh frames of known
        classes at most, if they come as the training frames did, and for noise, a black frame or an
        object that was not trained, as long as there are 1/reject training frames, and 4 of each
        class (or as many of it as 1/reject − 1).

        Raises:
            ValueError: for a share outside (0, 1).
        """
        share = check_share(reject)
        return self._p_values(frames, share).max(1) > share

    def _p_values(self, frames: Any, alpha: float) -> np.ndarray:
        self._check_is_trained()
        parts = [
            p_values(self._known_peers(), words, alpha)
            for words in self._encoded(frames)
        ]
        return np.concatenate(parts)

    def _known_peers(self) -> list[Peers | None]:
        peers = self._peers  # another thread may be making them, too, and of the same
        if peers is None:
            peers = self._make_peers()
            self._peers = peers
        return peers

    def _make_peers(self) -> list[Peers | None]:
        prototypes = self._majority.deciding()
        peers: list[Peers | None] = []
        for row, label in enumerate(self.classes_.tolist()):
            if self._sample.seen.get(label):
                peers.append(Peers.of(self._sample.of(label), prototypes[row]))
            else:
                peers.append(None)
        return peers


class Sample:
    """Up to 19 hypervectors of each class, every one with the same chance, in any batches.

    A reservoir (Vitter, ACM Trans. Math. Softw. 11, 37 (1985), algorithm R): frame k takes a random
    one of k + 1 places, and is kept where that is one of the 19. Random numbers follow from the
    seed and from k alone, so batches, files and machines change nothing.

    Args:
        seed: of the random numbers, a whole number that is not negative.
    """

    def __init__(self, seed: int = _SEED) -> None:
        self.seed = seed
        self.seen: dict[Label, int] = {}  # how many of each class came by
        self._kept: dict[Label, list[Tensor]] = {}

    def choose(self, labels: Sequence[Label]) -> dict[int, tuple[Label, int]]:
        """Let frames of these labels come by: which of them take a place, and which place."""
        chosen: dict[tuple[Label, int], int] = {}
        for i, label in enumerate(labels):
            k = self.seen.get(label, 0)
            self.seen[label] = k + 1
            place = k if k < KEPT else random_place(self.seed, k)
            if place < KEPT:
                chosen[label, place] = i
        return {i: place for place, i in chosen.items()}

    def add(self, words: Tensor, labels: Sequence[Label]) -> None:
        """Let hypervectors int64 [N, W] of N labels come by; those that are kept are copied."""
        chosen = self.choose(labels)
        self.keep(chosen, (words[i].clone() for i in chosen))

    def keep(
        self, chosen: Mapping[int, tuple[Label, int]], words: Iterable[Tensor]
    ) -> None:
        """Give the chosen their places, by hypervectors int64 [W] that nobody overwrites."""
        for (label, place), row in zip(chosen.values(), words, strict=True):
            kept = self._kept.setdefault(label, [])
            kept[place : place + 1] = [row]

    def of(self, label: Label) -> Tensor:
        """The hypervectors of a class, int64 [m, W]."""
        return torch.stack(self._kept[label])

    def put(self, label: Label, words: Tensor, seen: int) -> None:
        """Keep these hypervectors, of so many, for a class."""
        self._kept[label] = list(words)
        self.seen[label] = seen

    def merge(self, other: Sample) -> None:
        """Make this a sample of all that came by either.

        How many places the frames of the other take is what drawing 19 of all frames would give
        (hypergeometric).
        """
        for label, n_other in other.seen.items():
            words = other.of(label)
            n = self.seen.get(label, 0)
            if n:
                mine = self.of(label)
                drawn = np.random.default_rng((self.seed, n, n_other))
                n_kept = min(KEPT, n + n_other)
                share = int(drawn.hypergeometric(n_other, n, n_kept))
                words = torch.cat(
                    (
                        _some(mine, n_kept - share, drawn),
                        _some(words, share, drawn),
                    )
                )
            self.put(label, words, n + n_other)


def _some(words: Tensor, n: int, drawn: np.random.Generator) -> Tensor:
    """Any n of the hypervectors, in their order."""
    places = np.sort(drawn.permutation(len(words))[:n])
    return words[torch.from_numpy(places)]


def random_place(seed: int, k: int) -> int:
    """A random place of frame k among k + 1, by SplitMix64 of the seed and k.

    Steele, Lea, Flood, Fast splittable pseudorandom number generators, OOPSLA 2014.
    """
    mixed = _mix(_mix(seed + 1) + k)
    return mixed * (k + 1) >> 64


def _mix(z: int) -> int:
    """One number of SplitMix64 from its state."""
    z = (z * 0x9E3779B97F4A7C15) & _WORD
    z = ((z ^ z >> 30) * 0xBF58476D1CE4E5B9) & _WORD
    z = ((z ^ z >> 27) * 0x94D049BB133111EB) & _WORD
    return z ^ z >> 31


@dataclass(frozen=True)
class Peers:
    """The kept frames of one class, and what a new frame changes for them."""

    prototype: Tensor
    """int64 [W]."""
    constant: np.ndarray
    """[m], distances d_i for a black frame x."""
    gained: Tensor
    """[W], bits of the prototype that become one if x has a one where x_i has none."""
    shared: Tensor
    """[m, W], bits of x_i that are not lost, or not gained, where x has a one, too."""
    held_out: np.ndarray
    """[m], leave-one-out distances less their mean; none of a single frame."""
    mean: float
    """Of the leave-one-out distances; NaN of a single frame."""

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
        return cls(
            prototype=prototype,
            constant=constant.numpy(force=True),
            gained=gained,
            shared=words & (lost | gained),
            held_out=held_out,
            mean=mean,
        )

    def compare(self, words: Tensor) -> tuple[np.ndarray, np.ndarray]:
        """Distances d [Q] of hypervectors [Q, W] as if of this class, and d_i [Q, m]."""
        ones = bits.count_ones(words)[:, None]
        differing = bits.hamming(words, self.shared)
        overlap = (ones + bits.count_ones(self.shared) - differing) // 2
        gained = bits.count_ones(words & self.gained)[:, None]
        distances = bits.count_ones(words ^ self.prototype)
        moved = (gained - overlap).numpy(force=True)
        d_i = self.constant + moved
        return distances.numpy(force=True), d_i


def p_values(peers: Sequence[Peers | None], words: Tensor, alpha: float) -> np.ndarray:
    """p_c(x) for hypervectors [Q, W] and L classes, [Q, L], to be compared with α.

    A class without kept frames has p = 0.
    """
    result = np.zeros((len(words), len(peers)))
    _warn_of_few(peers, alpha)
    for c, own in enumerate(peers):
        if own is None:
            continue
        d, d_i = own.compare(words)
        m = d_i.shape[1]
        as_far = (d_i >= d[:, None]).sum(1)
        if (m + 1) * alpha >= 1 or m < FEWEST:
            result[:, c] = (1 + as_far) / (m + 1)
            continue
        others = _held_out_of_others(peers, c)
        mean = (d_i.sum(1) + d) / (m + 1)
        nearer = np.searchsorted(others, d - mean, "left")
        as_far += len(others) - nearer
        result[:, c] = (1 + as_far) / (1 + m + len(others))
    return result


def _warn_of_few(peers: Sequence[Peers | None], alpha: float) -> None:
    """Warn where some class is in every set, so that no frame is refused."""
    kept = [len(peer.constant) for peer in peers if peer is not None]
    n, least = sum(kept), min(kept, default=0)
    if (n + 1) * alpha < 1:
        expected = f"expected at least {1 / (n + 1):.2g} with {n} frames kept"
    elif least < FEWEST and (least + 1) * alpha < 1:
        expected = f"expected at least {FEWEST} frames of each class, found {least}"
    else:
        return
    warnings.warn(
        f"{alpha:g} of known frames: {expected}; no frame is refused", stacklevel=3
    )


def _held_out_of_others(peers: Sequence[Peers | None], c: int) -> np.ndarray:
    """Leave-one-out distances, each less the mean of its class, of all classes but c, sorted;
    without those of fewer frames than :data:`FEWEST`."""
    found = [np.empty(0)]
    for other, peer in enumerate(peers):
        if peer is not None and other != c and len(peer.held_out) >= FEWEST:
            found.append(peer.held_out)
    return np.sort(np.concatenate(found))
