"""What a set of frames says, in the paper's own terms: hypervectors, prototypes, Eqs. 4 to 6.

A few lines of numpy, on purpose independent of the package ``hdc``: the sensor is calibrated
against the published numbers, not against this project's classifier.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

Bits = NDArray[np.uint8]


def batches(scene: Any, indices: NDArray[np.int64], size: int = 50) -> Iterator[NDArray[np.uint8]]:
    """Frames uint8 [n, D], a batch at a time."""
    for start in range(0, len(indices), size):
        frames = scene.frames(indices[start : start + size])
        yield frames.numpy().reshape(len(frames), -1)


def hypervectors(frames: NDArray[np.uint8]) -> Bits:
    """Packed bits [n, ceil(D/8)]: ones above the median, pixels equal to it shared out at random
    (one fixed order) so that half of the bits are ones."""
    n, d = frames.shape
    order = np.random.default_rng(0).random((d,), dtype=np.float32)
    packed = np.empty((n, (d + 7) // 8), dtype=np.uint8)
    for i, frame in enumerate(frames):
        below = np.bincount(frame, minlength=256).cumsum()
        median = int(np.searchsorted(below, d // 2))
        ones = frame > median
        equal = np.flatnonzero(frame == median)
        missing = d // 2 - (d - int(below[median]))
        if 0 < missing < len(equal):
            equal = equal[np.argpartition(order[equal], missing)[:missing]]
        ones[equal[:missing]] = True
        packed[i] = np.packbits(ones)
    return packed


def prototypes(bits: Bits, labels: NDArray[np.int64], classes: int) -> Bits:
    """Majority of each class [L, W]; a tie gives 0."""
    majority = []
    for c in range(classes):
        mine = bits[labels == c]
        counts = sum(
            (
                np.unpackbits(part, axis=1).sum(0, dtype=np.int32)
                for part in np.array_split(mine, 8)
            ),
            start=np.zeros(bits.shape[1] * 8, dtype=np.int32),
        )
        majority.append(2 * counts > len(mine))
    return np.packbits(np.array(majority), axis=1)


def distances(queries: Bits, stored: Bits) -> NDArray[np.int64]:
    """Hamming distances [Q, L]."""
    pad = -queries.shape[1] % 8
    words = [np.pad(a, ((0, 0), (0, pad))).view(np.uint64) for a in (queries, stored)]
    columns = [np.bitwise_count(words[0] ^ row).sum(1, dtype=np.int64) for row in words[1]]
    return np.stack(columns, axis=1)


def accuracy(
    train: Bits,
    train_labels: NDArray[np.int64],
    test: Bits,
    labels: NDArray[np.int64],
    classes: int,
) -> NDArray[np.int64]:
    """Confusion matrix int64 [L, L], rows the truth."""
    predicted = distances(test, prototypes(train, train_labels, classes)).argmin(1)
    confusion = np.zeros((classes, classes), dtype=np.int64)
    np.add.at(confusion, (labels, predicted), 1)
    return confusion


def share_right(confusion: NDArray[np.int64]) -> float:
    """Accuracy of a confusion matrix."""
    return float(np.trace(confusion) / confusion.sum())


def standardised_sum(
    frames: NDArray[Any], labels: NDArray[np.int64], classes: int
) -> NDArray[np.float64]:
    """Σ over a class of (X − mean)/(σ√D) [L, D]: all that the mean correlations need."""
    x = frames.astype(np.float32)
    x -= x.mean(1, keepdims=True)
    x /= np.linalg.norm(x, axis=1, keepdims=True)
    return np.stack([x[labels == c].sum(0, dtype=np.float64) for c in range(classes)])


def mean_correlation(sums: NDArray[np.float64], counts: NDArray[np.int64]) -> NDArray[np.float64]:
    """C_ll′ of Eqs. 4 and 5 from the class sums: off the diagonal all pairs, on it all k ≠ k′."""
    gram = sums @ sums.T
    pairs = np.outer(counts, counts).astype(np.float64)
    diagonal = np.diag_indices(len(counts))
    gram[diagonal] -= counts
    pairs[diagonal] -= counts
    return gram / pairs


def contrast(correlation: NDArray[np.float64]) -> float:
    """ΔC = max_ll′ |C_ll − C_ll′|."""
    return float(np.abs(np.diag(correlation)[:, None] - correlation).max())


def folds(labels: NDArray[np.int64], train: int, seed: int) -> Iterator[tuple[Any, Any]]:
    """Stratified splits with ``train`` samples a class in training, every sample tested once."""
    rng = np.random.default_rng(seed)
    shuffled = [rng.permutation(np.flatnonzero(labels == c)) for c in range(labels.max() + 1)]
    size = min(map(len, shuffled))
    step = size - train
    for start in range(0, size - step + 1, step):
        test = np.concatenate([s[start : start + step] for s in shuffled])
        rest = np.concatenate([np.delete(s, np.s_[start : start + step]) for s in shuffled])
        yield rest, test


def prototype_correlation(
    stored: Bits, bits: Bits, labels: NDArray[np.int64], size: int
) -> NDArray[np.float64]:
    """C^p_ll′ of Eq. 6 from packed bits: the mean over class l′ of corr(prototype l, V)."""
    ones = [np.bitwise_count(a).sum(1, dtype=np.int64) / size for a in (bits, stored)]
    p, q = ones[0][:, None], ones[1]
    both = (p + q - distances(bits, stored) / size) / 2
    correlation = (both - p * q) / np.sqrt(p * (1 - p) * q * (1 - q))
    classes = range(len(stored))
    return np.stack([correlation[labels == c].mean(0) for c in classes], axis=1)
