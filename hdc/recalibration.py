"""Prototypes for a changed environment: old and new frames together, each with its share.

Two ways, both with a share p of the new. ``replace`` is the paper's (Section III.B, Fig. 8): each
bit of a prototype is the new one's with probability p. ``merge`` counts votes: in bundles scaled so
that the new frames have the share p of all votes, however many frames there are on either side, a
bit is one if more than half of the votes are. It needs the counters besides the prototypes, and
decides by how clear a bit was on either side what ``replace`` leaves to chance.
"""

from __future__ import annotations

from fractions import Fraction
from math import gcd
from typing import Any, Self

import torch

from hdc import inputs
from hdc.prediction import CHUNK, Predictor
from hdc.prototypes import Counters, check_share, replaced_bits
from hdc.rejection import Sample

METHODS = ("replace", "merge")
_VOTE_BITS = 24  # what the votes of repeated merges are cut to
_P_STEPS = 1000


class Recalibrator(Predictor):
    """How :class:`hdc.HDCClassifier` is adapted by frames that are not counted with the others."""

    def recalibrate(
        self, frames: Any, y: Any, p: float = 0.5, seed: int = 0, method: str = "replace"
    ) -> Self:
        """Adapt to a changed environment by new frames; see :mod:`hdc.recalibration`.

        Classes without new frames keep their prototypes. What :meth:`is_known` takes for near comes
        from the new frames. A recalibrated model can be recalibrated again; ``partial_fit`` and
        ``merge`` refuse it, as a frame's weight beside the shares is not defined.

        Args:
            frames: frames of the changed environment, of the shapes that :meth:`fit` takes.
            y: their labels.
            p: share of the new: probability with which a bit is replaced, or share of the votes.
            seed: seed of the choice of bits that are replaced.
            method: ``"replace"`` as published, for binary prototypes only, or ``"merge"``, by
                votes, which recovers more (of binary and of integer prototypes).

        Raises:
            ValueError: if p is outside [0, 1], or a label is not among ``classes_``.
        """
        self._check_is_trained()
        if method not in METHODS:
            raise ValueError(f"method: expected one of {', '.join(METHODS)}, found {method!r}")
        if self.prototype != "binary" and method == "replace":
            raise ValueError(
                f"prototype: replacing bits expects 'binary', found {self.prototype!r}; "
                "method='merge' takes any"
            )
        new, rows, sample = self._counted_apart(frames, y)
        n_classes, before = len(self._index), self._majority()
        placed = Counters(n_classes, self.dimension_, self.counters_.device)
        placed.merge(new, rows)
        calibration = self._try_calibration()
        if method == "merge":
            votes, weights = merged(self.counters_, placed, p)
            after = self._prototypes_of(votes)
            self.counters_, self.counts_ = votes, votes.n.numpy().copy()

            def neighbours(c: int) -> Any:
                return self._neighbours(votes, c, weights[c])
        else:
            weights = [1] * n_classes
            mask = replaced_bits(n_classes, self.dimension_, p, seed).to(before.device)
            after = before.clone()
            after[rows] ^= (before[rows] ^ self._prototypes_of(new)) & mask[rows]

            def neighbours(c: int) -> Any:
                of_new = self._neighbours(new, rows.index(c))
                return of_new and tuple(before[c] ^ ((before[c] ^ x) & mask[c]) for x in of_new)

        self.prototypes_, self._recalibrated, self._sample = after, True, None
        found = self._calibrated_by(placed, sample, neighbours, weights)
        self._made.calibration = found.completed(calibration) if found else calibration
        return self

    def calibrate(self, frames: Any, y: Any) -> Self:
        """Set by frames it was *not* trained on what :meth:`is_known` takes for near.

        Not needed after :meth:`fit`, where training frames serve. For models of counters alone, or
        where new frames come from farther than training frames did. Learning on undoes it.

        Raises:
            ValueError: for labels that are not among ``classes_``.
        """
        self._check_is_trained()
        new, rows, sample = self._counted_apart(frames, y)
        placed = Counters(len(self._index), self.dimension_, self.counters_.device)
        placed.merge(new, rows)
        prototypes, before = self._majority(), self._try_calibration()
        found = self._calibrated_by(
            placed, sample, lambda c: (prototypes[c], prototypes[c]), [0] * len(self._index)
        )
        self._made.calibration = found.completed(before) if found else before
        return self

    def _counted_apart(self, frames: Any, y: Any) -> tuple[Counters, list[int], Sample]:
        """Counters and a sample of more frames of known classes; rows of these classes here."""
        self._check_parameters()
        frames = inputs.indexable(frames, self.frame_shape_)
        labels = inputs.label_array(y, len(frames))
        inputs.check_among(labels, list(self._index))
        if len(labels) == 0:
            raise ValueError("frames: expected at least one frame, found none")
        items = inputs.values(labels)
        rows = sorted({self._index[label] for label in items})
        places = {row: i for i, row in enumerate(rows)}
        backend = self._backend(frames)
        counters = Counters(len(rows), self.dimension_, self.device, backend)
        sample = Sample(len(items))
        for start in range(0, len(items), CHUNK):
            chunk = items[start : start + CHUNK]
            words = self._encode(frames[start : start + CHUNK], start, backend)
            counters.add(words, torch.tensor([places[self._index[label]] for label in chunk]))
            sample.add(words, chunk)
        return counters, rows, sample


def merged(old: Counters, new: Counters, p: float) -> tuple[Counters, list[int]]:
    """Votes of old and new hypervectors of the same L classes, the new with the share p.

    Where a class has hypervectors on one side only, those decide. p is taken as the nearest
    fraction with a denominator of at most 1000, and votes are integers: no rounding decides a tie.
    Votes above 2^24, after some merges, are halved until they fit.

    Returns:
        The votes, and how many a new hypervector of each class has.

    Raises:
        ValueError: if p is not in [0, 1].
    """
    check_share(p)
    share = Fraction(p).limit_denominator(_P_STEPS)
    of_old, of_new = [], []
    for n_old, n_new in zip(old.n.tolist(), new.n.tolist(), strict=True):
        a, b = (share.denominator - share.numerator) * n_new, share.numerator * n_old
        if n_old == 0 or n_new == 0:
            a = b = 1
        of_old.append(a // gcd(a, b))
        of_new.append(b // gcd(a, b))
    votes = old.scaled(of_old)
    votes.merge(new.scaled(of_new))
    while (votes.n >= 2**_VOTE_BITS).any():
        votes.n, votes.planes = votes.n >> 1, votes.planes[:, 1:].contiguous()
        of_new = [w // 2 for w in of_new]
    return votes, of_new
