"""Read-outs where frames are few, equal or alone; references solve the problem in another space.

The features F of N frames have the products G = F·Fᵀ of a read-out: bits in ±1, or for the kernel
those of the eigenvectors of G. With the scatter S of the frames about the means m_c of their
classes, and the penalty ℓ, discriminant analysis scores a query f for class c by

    (f − ½·(m_c + m̄))·w_c,        w_c = ℓ·(S + ℓ)⁻¹·(m_c − m̄),

where ℓ without end is the nearest mean.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
import torch

from experiments.studies.limits.stability.case import case
from hdc import bits
from hdc.hypervectors import Hypervectors
from hdc.readouts import LDA, Kernel, Readout, Ridge

Array = np.ndarray[Any, Any]
D = 100
PENALTY = 0.1
SHAPES = {
    "few frames": "24 frames of 100 bits: the scatter within classes is singular",
    "equal frames": "three equal frames of each class: no scatter within classes",
    "single frames": "one frame of each class: no scatter within classes",
}


def frames_of(shape: str) -> tuple[Array, Array, Array]:
    """Bits [N, D] of three classes, N = 24, 9 or 3, their classes, and queries [50, D]."""
    random = np.random.default_rng(0)
    n = {"few frames": 8, "equal frames": 3, "single frames": 1}[shape]
    labels = np.repeat(np.arange(3), n)
    base = random.random((3, D)) < 0.5
    drawn = base[np.concatenate([labels, random.integers(0, 3, 50)])]
    common = random.random((len(drawn), 1)) * random.random(D)
    flipped = random.random(drawn.shape) < 0.6 * common
    if shape == "equal frames":
        flipped[:9] = flipped[:9:3].repeat(3, 0)
    frames = drawn ^ flipped
    return frames[: 3 * n], labels, frames[3 * n :]


def learned(readout: Readout, frames: Array, labels: Array, queries: Array) -> Array:
    """Scores [Q, L] of a read-out."""
    words, asked = (
        Hypervectors(bits.pack(torch.from_numpy(part)), D) for part in (frames, queries)
    )
    rows = torch.from_numpy(labels)
    state = readout.fit(words, rows, int(labels.max()) + 1)
    return np.asarray(readout.scores(state, asked).double())


def unit(scores: Array) -> Array:
    """Scores [Q, L] minus the mean of the classes, in units of their deviation."""
    centred = scores - scores.mean(1, keepdims=True)
    return centred / centred.std()


def root_mean_square(found: Array, exact: Array) -> float:
    """Of the distances of scores in units of their deviation."""
    return float(np.sqrt(((unit(found) - unit(exact)) ** 2).mean()))


def discriminants(
    features: Array, labels: Array, queries: Array, penalty: float
) -> tuple[Array, Array]:
    """Scores [Q, L] and weights [L, R] of features [N, R]; a penalty of ∞ is the nearest mean."""
    means = np.stack([features[labels == c].mean(0) for c in np.unique(labels)])
    weights = means - means.mean(0)
    if np.isfinite(penalty):
        inside = features - means[labels]
        penalised = inside.T @ inside + penalty * np.eye(len(inside.T))
        weights = penalty * np.linalg.solve(penalised, weights.T).T
    halfway = (means + means.mean(0)) / 2
    return queries @ weights.T - (halfway * weights).sum(1), weights


def ledoit_wolf(signs: Array, labels: Array) -> float:
    """The penalty of the shrunken covariance (1 − α)·S/n + α·(tr S/n/D)·I, by its definition."""
    inside = signs - np.stack([signs[labels == c].mean(0) for c in labels])
    n = len(signs) - 3
    covariance = inside.T @ inside / max(n, 1)
    target = np.trace(covariance) / D * np.eye(D)
    spread = ((covariance - target) ** 2).sum()
    if not spread:
        return np.inf
    noise = ((inside**2).sum(1) ** 2).sum() / n**2 - (covariance**2).sum() / n
    alpha = min(1.0, noise / spread)
    return alpha / (1 - alpha) * n * target[0, 0]


def rounded(weights: Array, steps: int, away: Array, scores: Array) -> float:
    """Twice the error that weights [L, D] in steps of their largest size leave on average.

    Rounding errors are spread evenly over a step: of a weight δ²/12, of a score that times the
    squares of how far the query is away [Q, D] from the mean, whose score is kept. Over 50 queries
    the mean square hardly strays from its expectation.
    """
    size = np.abs(weights).max(1) / steps
    squares = (size**2).mean() / 12 * (away**2).sum(1).mean()
    centred = scores - scores.mean(1, keepdims=True)
    return float(2 * np.sqrt(squares) / centred.std())


def lda(frames: Array, labels: Array, queries: Array) -> Any:
    """Weights of four bits: −7 to 7."""
    signs, asked = 2.0 * frames - 1, 2.0 * queries - 1
    exact, weights = discriminants(signs, labels, asked, ledoit_wolf(signs, labels))
    centre = np.mean([signs[labels == c].mean(0) for c in range(3)], axis=0)
    return LDA(), exact, rounded(weights, 7, asked - centre, exact)


def kernel(frames: Array, labels: Array, queries: Array) -> Any:
    """Floating point: some digits less than the condition number takes away."""
    both = np.concatenate([frames, queries])
    apart = (both[:, None] != frames).sum(2)
    pairs = apart[: len(frames)][np.triu_indices(len(frames), 1)]
    median = np.sort(pairs)[(len(pairs) - 1) // 2]
    near = np.exp(-apart / max(median, 1))
    values, vectors = np.linalg.eigh(near[: len(frames)])
    kept = values > 1e-12 * values[-1]
    features = near @ vectors[:, kept] / np.sqrt(values[kept])
    train, asked = features[: len(frames)], features[len(frames) :]
    means = np.stack([train[labels == c].mean(0) for c in labels])
    penalty = PENALTY * ((train - means) ** 2).sum() / len(train)
    exact, _ = discriminants(
        train, labels, asked, penalty if penalty > 1e-9 else np.inf
    )
    return (
        Kernel(scales=[1], penalties=[PENALTY]),
        exact,
        2**-52 * len(frames) / PENALTY * 1e3,
    )


def ridge(frames: Array, labels: Array, queries: Array) -> Any:
    """Weights of eight bits: −127 to 127."""
    signs, asked = 2.0 * frames - 1, 2.0 * queries - 1
    targets = 2.0 * np.eye(3)[labels] - 1
    centred = signs - signs.mean(0)
    penalty = PENALTY * (centred**2).sum() / len(signs)
    gram = centred.T @ centred + penalty * np.eye(D)
    weights = np.linalg.solve(gram, centred.T @ (targets - targets.mean(0))).T
    away = asked - signs.mean(0)
    exact = away @ weights.T + targets.mean(0)
    return Ridge(PENALTY), exact, rounded(weights, 127, away, exact)


def linear(make: Callable[..., Any], shape: str) -> Any:
    """Scores by the inverse of the scatter, by the read-out, and what rounding leaves of it."""
    frames, labels, queries = frames_of(shape)
    readout, exact, tolerance = make(frames, labels, queries)

    def naive() -> Array:
        signs, asked = 2.0 * frames - 1, 2.0 * queries - 1
        means = np.stack([signs[labels == c].mean(0) for c in range(3)])
        inside = signs - means[labels]
        weights = np.linalg.inv(inside.T @ inside) @ (means - means.mean(0)).T
        return (asked - means.mean(0)) @ weights

    return naive, partial(learned, readout, frames, labels, queries), exact, tolerance


for _make in (lda, kernel, ridge):
    for _shape, _extreme in SHAPES.items():
        case(
            "read-outs", _extreme, "discriminants by the inverse of the scatter",
            f"read-out {_make.__name__}", "of the deviation",
            name=f"{_make.__name__} of {_shape}", error=root_mean_square,
        )(partial(linear, _make, _shape))  # fmt: skip
