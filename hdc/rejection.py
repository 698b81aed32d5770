"""How far a frame of a known class may be from its prototype, and how sure an answer is.

A training frame has a share in the prototype of its class and is nearer to it than a new frame will
be. What a new frame has to expect is the distance d to the prototype of the *other* frames
(leave one out), and counters tell it exactly: without a frame, bit j of the prototype is one if
2·c_j > n + 1 where the frame has a one, and if 2·c_j > n − 1 where it has a zero
(:meth:`hdc.prototypes.Counters.prototype`). Of these distances there are kept:

- μ_c, the mean over *all* training frames of class c, which is a sum over bits of the counters;
- σ, the root mean square of d − μ_c over the frames of a sample (:class:`Sample`) of all classes,
  but at least √(μ(1 − μ/D)), which independent bits alone would have.

A frame whose nearest prototype is that of class c is *known* if

    d ≤ μ_c + t·σ·√(1 + 1/n_c),

the prediction interval of a normal distribution, where t is the (1 − rate) quantile of Student's t:
of new frames of known classes a share of about `rate` is refused, as far as distances within a
class are normal and spread alike in all classes. Noise, a black or a white frame has d ≈ D/2.

Probabilities are softmax(−score/T). The temperature T (Guo et al., ICML 2017) is the most likely
one for the labels of the sample, by leave-one-out scores too; the sample of m frames counts as if
(m + 1)/(m + 2) of each frame were of its class and the rest of the others (Platt 1999), so that T
is finite though no frame is mistaken.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass, replace
from statistics import NormalDist

import numpy as np
import torch
from torch import Tensor

from hdc import bits, planes
from hdc.cosine import moments
from hdc.prototypes import Counters

KEPT = 64  # hypervectors of a sample: 2 MB at D = 250,000
RATE = 0.01
_COUNTED_AHEAD = 10**6

Neighbours = Callable[[int], tuple[Tensor, Tensor] | None]
"""Prototype [W] of a class without one of its frames, where that frame has ones and where it has
zeros; None for a class with no other frame."""


class Sample:
    """Up to 64 of the hypervectors that a model counted, all with the same chance.

    The k-th hypervector is kept if the hash of k is among the smallest: the same ones in whatever
    batches they come, and of two samples together the smallest are a sample of all.

    Args:
        expected: how many will come by, where it is known: none is then copied that would be
            replaced later.

    Attributes:
        seen: how many hypervectors came by.
        labels: labels of those kept.
    """

    def __init__(self, expected: int = 0) -> None:
        self.seen = 0
        self.labels: list[Hashable] = []
        self._keys = np.empty(0, np.uint64)
        self._words: Tensor | None = None
        self._limit = np.uint64(2**64 - 1)
        if KEPT < expected < _COUNTED_AHEAD:
            keys = _hash(np.arange(expected, dtype=np.uint64))
            self._limit = np.partition(keys, KEPT - 1)[KEPT - 1]

    def add(self, words: Tensor, labels: Sequence[Hashable]) -> None:
        """Let hypervectors int64 [N, W] of N labels come by; those that are kept are copied."""
        keys = _hash(np.arange(self.seen, self.seen + len(words), dtype=np.uint64))
        self.seen += len(words)
        self._take(words, keys, labels)

    def merge(self, other: Sample) -> None:
        """Make this a sample of what came by either."""
        if other._words is not None:
            self._take(other._words, other._keys, other.labels)
        self.seen += other.seen

    def words(self) -> Tensor:
        """The hypervectors, int64 [m, W], in an order that no batch changes; labels alike."""
        assert self._words is not None  # some came by
        order = np.argsort(self._keys)
        self._words[: len(order)] = self._words[order]
        self._keys, self.labels = self._keys[order], [self.labels[i] for i in order]
        return self._words[: len(order)]

    def _take(self, words: Tensor, keys: np.ndarray, labels: Sequence[Hashable]) -> None:
        if self._words is None:
            self._words = planes.zeros((KEPT, words.shape[1]), words.device)
        rows = np.flatnonzero(keys[: len(labels)] <= self._limit)
        first = len(self.labels)
        added, others = rows[: KEPT - first], rows[KEPT - first :]
        self._keys = np.append(self._keys, keys[added])
        self.labels += [labels[row] for row in added]
        _copy_rows(words, added, self._words[first : first + len(added)])
        for row in others:
            place = int(self._keys.argmax())
            if keys[row] < self._keys[place]:
                self._keys[place], self.labels[place] = keys[row], labels[row]
                _copy_rows(words, row[None], self._words[place : place + 1])
        if len(self.labels) == KEPT:
            self._limit = self._keys.max()


def _copy_rows(source: Tensor, rows: np.ndarray, into: Tensor) -> None:
    if into.device.type == "cpu":  # without torch's threads
        np.take(source.numpy(), rows, 0, out=into.numpy(), mode="clip")
    else:
        into.copy_(source[torch.from_numpy(rows).to(source.device)])


def _hash(numbers: np.ndarray) -> np.ndarray:
    """uint64 to uint64, one to one (splitmix64; Steele et al., OOPSLA 2014)."""
    z = (numbers + np.uint64(1)) * np.uint64(0x9E3779B97F4A7C15)
    z = (z ^ (z >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    z = (z ^ (z >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return z ^ (z >> np.uint64(31))


@dataclass(frozen=True)
class Calibration:
    """What is known of the distances of new frames.

    Attributes:
        means: μ_c in pixels, for each class.
        numbers: n_c, frames behind each mean; of a class of one frame the mean is what two frames
            of a class are apart.
        spread: σ in pixels.
        freedom: degrees of freedom of σ.
        temperature: T, in units of the scores.
    """

    means: tuple[float, ...]
    numbers: tuple[int, ...]
    spread: float
    freedom: int
    temperature: float

    def completed(self, before: Calibration | None) -> Calibration:
        """With the means of another one for classes that had no frames for this one."""
        if before is None:
            return self
        chosen = [self if n else before for n in self.numbers]
        return replace(
            self,
            means=tuple(x.means[c] for c, x in enumerate(chosen)),
            numbers=tuple(x.numbers[c] for c, x in enumerate(chosen)),
        )

    def limits(self, rate: float) -> np.ndarray:
        """The largest distance [L] of a known frame, if a share `rate` of them may be refused."""
        wider = np.sqrt(1 + 1 / np.maximum(1, self.numbers))
        return np.array(self.means) + student(1 - rate, self.freedom) * self.spread * wider

    def probabilities(self, scores: np.ndarray) -> np.ndarray:
        """Of each class, [Q, L], for scores [Q, L]; infinite ones have probability 0."""
        logits = -scores / self.temperature
        powers = np.exp(logits - logits.max(1, keepdims=True))
        return powers / powers.sum(1, keepdims=True)


def calibration(
    frames: Counters,
    words: Tensor,
    own: Tensor,
    neighbours: Neighbours,
    scores: np.ndarray,
    own_scores: np.ndarray | None = None,
) -> Calibration | None:
    """Calibrate by leaving out; None where there is no class of two frames.

    Args:
        frames: counters of the frames themselves, L classes.
        words: a sample of their hypervectors, int64 [m, W].
        own: rows of their classes, int64 [m].
        neighbours: prototypes that a frame of a class meets.
        scores: float64 [m, L] of the sample.
        own_scores: float64 [m], leave-one-out scores with the own class; by default the distances.
    """
    n, rows = frames.n.tolist(), own.numpy(force=True)
    means, held_out = np.full(len(n), np.nan), np.full(len(words), np.nan)
    for c in frames.n.nonzero().flatten().tolist():
        met = neighbours(c)
        if met is not None:
            means[c] = _mean_distance(frames.planes[c], n[c], *met)
            held_out[rows == c] = _distances(words[own == c], *met)
    used = np.isfinite(held_out)
    if not used.any():
        return None
    rows, d = rows[used], frames.dimension
    residuals = (held_out[used] - means[rows]) ** 2
    sizes = np.array(n, float)[rows]
    variance = np.mean(residuals * sizes / np.maximum(1, sizes - 1))
    floor = np.mean(means[rows] * (1 - means[rows] / d))
    scores = scores[used].astype(np.float64)
    scores[np.arange(len(rows)), rows] = (held_out if own_scores is None else own_scores)[used]
    if np.isnan(means).any():
        means[np.isnan(means)] = _distance_of_two(frames, np.nanmean(means))
    return Calibration(
        tuple(means.tolist()),
        tuple(n),
        math.sqrt(max(variance, floor)),
        int(used.sum()),
        temperature(scores, rows),
    )


def _mean_distance(counts: Tensor, n: int, if_one: Tensor, if_zero: Tensor) -> float:
    """Mean over n hypervectors that were counted, bit-sliced int64 [P, W], by sums over bits.

    Σ_j [c_j where a one meets a zero] + [n − c_j where a zero meets a one]
    """
    weights = [1 << p for p in range(len(counts))]
    wrong_ones = bits.count_ones(counts & ~if_one).tolist()
    right_ones = bits.count_ones(counts & if_zero).tolist()
    total = sum(w * (a - b) for w, a, b in zip(weights, wrong_ones, right_ones, strict=True))
    return (total + n * int(bits.count_ones(if_zero))) / n


def _distances(words: Tensor, if_one: Tensor, if_zero: Tensor) -> np.ndarray:
    met = (words & if_one) | (~words & if_zero)
    return bits.count_ones(words ^ met).numpy(force=True)


def _distance_of_two(frames: Counters, otherwise: float) -> float:
    """Mean distance of two frames of a class, over classes: Σ_j 2·c_j·(n − c_j) / (n·(n − 1))."""
    means = []
    for counts, n in zip(frames.planes, frames.n.tolist(), strict=True):
        if n > 1:
            first, second = moments(counts)
            means.append(2 * (n * first - second) / (n * (n - 1)))
    return float(np.mean(means)) if means else otherwise


def student(p: float, freedom: int) -> float:
    """Quantile of Student's t, by its expansion about the normal's (Abramowitz, Stegun, 26.7.5)."""
    z, f = NormalDist().inv_cdf(p), freedom
    return (
        z
        + (z**3 + z) / (4 * f)
        + (5 * z**5 + 16 * z**3 + 3 * z) / (96 * f**2)
        + (3 * z**7 + 19 * z**5 + 17 * z**3 - 15 * z) / (384 * f**3)
    )


def temperature(scores: np.ndarray, own: np.ndarray) -> float:
    """The temperature T that makes the classes int [m] of scores [m, L] most likely.

    The negative logarithm of the likelihood is convex in 1/T; its slope is
    Σ_i Σ_c (target_ic − p_ic)·score_ic, whose root is found by bisection.
    """
    finite = np.isfinite(scores).all(0)  # not so of classes without samples
    scores, own = scores[:, finite], (finite.cumsum() - 1)[own]
    m, n_classes = scores.shape
    targets = np.full((m, n_classes), 1 / (m + 2) / max(1, n_classes - 1))
    targets[np.arange(m), own] = (m + 1) / (m + 2)
    scores = scores - scores.min(1, keepdims=True)
    largest = max(float(scores.max()), 1e-9)
    low, high = math.log(1e-6 / largest), math.log(1e9 / largest)
    for _ in range(60):
        middle = (low + high) / 2
        powers = np.exp(-scores * math.exp(middle))
        powers /= powers.sum(1, keepdims=True)
        if ((targets - powers) * scores).sum() > 0:
            high = middle
        else:
            low = middle
    return math.exp(-low)
