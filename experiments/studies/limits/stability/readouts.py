"""Read-outs where frames are few and nearly equal; references are their definitions in 40 digits.

The features F of N frames, from a Cholesky decomposition, have the products G = F·Fᵀ of a read-out:
of bits in ±1, or of the kernel. With the scatter S of the frames about the means m_c of their
classes, and the penalty ℓ, discriminant analysis scores a query f for class c by

    (f − ½·(m_c + m̄))·w_c,        w_c = ℓ·(S + ℓ)⁻¹·(m_c − m̄),

and ridge regression by b_c + f·w_c of the penalised least squares. A frame that is left out is
scored by what is learned from the others, with the same penalty.

In double precision, a backward stable method leaves a backward error of some ε and a forward error
of some κ·ε, for the condition number κ of the system that it solves: tolerances are N times that.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable
from functools import partial
from typing import Any

import mpmath
import numpy as np
import torch

from experiments.studies.limits.stability.case import Case, differing, largest, relative
from experiments.studies.limits.stiffness.newton import solve
from hdc import bits
from hdc.hypervectors import Hypervectors
from hdc.readouts import LDA, Kernel, Readout, Ridge
from hdc.readouts.discriminant import Problem
from hdc.readouts.least_squares import Dual

Array = np.ndarray[Any, Any]
D, CLASSES = 100, 3
EPSILON = 2.0**-53
FACTOR = 1e-4  # of the penalty of ridge and kernel; LDA's has a closed form
READOUTS = ("LDA", "Ridge", "Kernel")
INPUTS = {
    "few frames": "12 frames of 100 bits: the scatter within classes is singular",
    "nearly equal frames": "frames of a class differ in one bit: its scatter is a millionth",
}
mpmath.mp.dps = 40


def frames_of(name: str, n: int = 4) -> tuple[Array, Array]:
    """Bits [N + 4, D] of frames of three classes and of four queries; classes of the first [N]."""
    random = np.random.default_rng(0)
    labels = np.repeat(np.arange(CLASSES), n)
    base = random.random((CLASSES, D)) < 0.5
    drawn = base[np.concatenate([labels, [0, 1, 2, 0]])]
    flipped = random.random(drawn.shape) < 0.3
    if name == "nearly equal frames":
        flipped[: len(labels)] = np.eye(len(labels), D) > 0
    return drawn ^ flipped, labels


def fitted(readout: Readout, frames: Array, labels: Array) -> Any:
    """What a read-out learns from the first of some frames."""
    words = words_of(frames[: len(labels)])
    return readout.fit(words, torch.from_numpy(labels), CLASSES)


def words_of(frames: Array) -> Hypervectors:
    return Hypervectors(bits.pack(torch.from_numpy(frames)), D)


def distances_of(frames: Array, n: int) -> tuple[Array, float]:
    """Hamming distances of frames, and the lower median of those of pairs of the first n."""
    apart = (frames[:, None] != frames).sum(2)
    pairs = np.sort(apart[:n, :n][np.triu_indices(n, 1)])
    return apart, float(pairs[(len(pairs) - 1) // 2])


# Definitions --------------------------------------------------------------------------------------


def exactly(values: Array) -> Array:
    """An array of numbers of 40 digits."""
    return np.vectorize(mpmath.mpf, otypes=[object])(values)


def discriminants(features: Array, labels: Array, query: Array, penalty: Any) -> Array:
    """Scores [L] by discriminant analysis."""
    means = np.stack([features[labels == c].mean(0) for c in range(CLASSES)])
    inside = features - means[labels]
    apart = means - means.mean(0)
    system = inside.T @ inside
    system.flat[:: len(system) + 1] += penalty
    weights = penalty * np.stack([solve(system, right) for right in apart])
    return ((query - (means + means.mean(0)) / 2) * weights).sum(1)


def regression(features: Array, labels: Array, query: Array, penalty: Any) -> Array:
    """Scores [L] by ridge regression of 1 for the class and −1 for the others."""
    targets = 2 * np.eye(CLASSES, dtype=int)[labels] - 1
    mean, of_targets = (
        features.mean(0),
        targets.sum(0) / features.dtype.type(len(labels)),
    )
    centred = features - mean
    system = centred.T @ centred
    system.flat[:: len(system) + 1] += penalty
    rights = centred.T @ (targets - of_targets)
    weights = np.stack([solve(system, right) for right in rights.T])
    return of_targets + weights @ (query - mean)


def ledoit_wolf(signs: Array, labels: Array) -> float:
    """The penalty of the shrunken covariance (1 − α)·S/n + α·(tr S/n/D)·I, by its definition."""
    inside = signs - np.stack([signs[labels == c].mean(0) for c in labels])
    n = len(signs) - CLASSES
    covariance = inside.T @ inside / n
    target = np.trace(covariance) / D * np.eye(D)
    spread = ((covariance - target) ** 2).sum()
    noise = ((inside**2).sum(1) ** 2).sum() / n**2 - (covariance**2).sum() / n
    alpha = min(1.0, noise / spread)
    return alpha / (1 - alpha) * n * target[0, 0]


def cholesky(products: Array) -> Array:
    """Features [N, N] with these products, of 40 digits."""
    factor = mpmath.cholesky(mpmath.matrix(products.tolist()))
    return np.array(factor.tolist(), object)


# Cases --------------------------------------------------------------------------------------------


class Problems:
    """A read-out with an input, its exact features, and its penalty.

    Attributes:
        features: of training frames and queries, [N + 4, N + 4] of 40 digits.
        matrix, right, solution: the system that it solves among frames, [N, N] and [N, …].
    """

    def __init__(self, name: str, shape: str) -> None:
        self.frames, self.labels = frames_of(shape)
        n = self.n = len(self.labels)
        apart, median = distances_of(self.frames, n)
        signs = 2.0 * self.frames - 1
        products = exactly(signs @ signs.T)
        self.learn: Callable[..., Array] = discriminants
        self.readout: Readout = LDA()
        if name == "Kernel":
            products = np.vectorize(mpmath.exp)(exactly(-apart) / median)
            self.readout = Kernel(scales=[1], penalties=[FACTOR])
        if name == "Ridge":
            self.learn, self.readout = regression, Ridge(FACTOR)
        self.features = cholesky(products)
        means = {c: self.features[:n][self.labels == c].mean(0) for c in range(CLASSES)}
        middle = [self.features[:n].mean(0)] * n
        around = middle if name == "Ridge" else [means[c] for c in self.labels]
        within = ((self.features[:n] - np.stack(around)) ** 2).sum()
        self.penalty = FACTOR * within / n
        if name == "LDA":
            self.penalty = mpmath.mpf(ledoit_wolf(signs[:n], self.labels))
        self._solve(name, products[:n, :n].astype(float))

    def _solve(self, name: str, products: Array) -> None:
        """By the library."""
        penalty = float(self.penalty)
        if name == "Ridge":
            dual = Dual.of(words_of(self.frames[: self.n]), penalty)
            centred = products - products.mean(0)
            centred -= centred.mean(1, keepdims=True)
            self.matrix = centred + penalty * np.eye(self.n)
            self.right, self.solution = np.eye(self.n), dual.inverse.numpy()
            return
        given = torch.from_numpy(products), torch.from_numpy(self.labels)
        problem = Problem.of(*given)
        self.solution = problem.solve(penalty).products.frames.numpy()
        self.matrix, self.right = problem.products.numpy(), problem.right.numpy()

    def bound(self) -> float:
        """N·κ·ε."""
        return float(self.n * EPSILON * np.linalg.cond(self.matrix))


def left_out(name: str, shape: str) -> Any:
    """Scores of training frames by what is learned from the others, in units of their size: by the
    definition in single precision, and by the read-out."""
    given = Problems(name, shape)
    labels = given.labels

    def by(dtype: Any) -> Array:
        features, penalty = given.features[: given.n].astype(dtype), given.penalty
        scores = []
        for i in range(given.n):
            rest = np.arange(given.n) != i
            known = features[rest], labels[rest], features[i]
            scores.append(given.learn(*known, dtype(penalty)))
        return in_units(np.stack(scores))

    def ours() -> Array:
        state = fitted(given.readout, given.frames, labels)
        return in_units(state.held_out.scores.numpy())

    return partial(by, np.float32), ours, by(mpmath.mpf), given.bound()


def in_units(scores: Array) -> Array:
    scores = scores.astype(float)
    return scores / np.linalg.norm(scores)


def backward(name: str, shape: str) -> Any:
    """The residual of the solution, over ‖A‖·‖x‖ + ‖b‖: by an inverse in single precision, too."""
    given = Problems(name, shape)
    matrix, right = given.matrix, given.right

    def error(solution: Array) -> float:
        residual = exactly(matrix) @ exactly(solution) - exactly(right)
        sizes = [float(np.linalg.norm(part)) for part in (matrix, solution, right)]
        size = sizes[0] * sizes[1] + sizes[2]
        return float(np.linalg.norm(residual.astype(float))) / size

    def naive() -> float:
        single = np.linalg.inv(matrix.astype(np.float32))
        return error((single @ right.astype(np.float32)).astype(float))

    return naive, lambda: error(given.solution), 0.0, given.n * EPSILON


def steps_of(name: str) -> Any:
    """Weights of the classes in whole steps [L, D], by their definition and as they are kept.

    Of LDA the unit is the 99.5 % quantile of their sizes over seven, of ridge the largest over 127.
    """
    given = Problems(name, "few frames")
    labels, signs = given.labels, 2.0 * given.frames[: given.n] - 1
    if name == "LDA":
        most, planes, share = 7, 4, 0.995
        means = np.stack([signs[labels == c].mean(0) for c in range(CLASSES)])
        inside, right = signs - means[labels], (means - means.mean(0)).T
    else:
        most, planes, share = 127, 8, 1.0
        inside = signs - signs.mean(0)
        right = inside.T @ (2.0 * np.eye(CLASSES)[labels] - 1)
    system = inside.T @ inside + float(given.penalty) * np.eye(D)
    weights = np.linalg.solve(system, right).T

    def rounded(quantile: float) -> Array:
        sizes = np.sort(np.abs(weights), 1)
        unit = sizes[:, round(quantile * D) - 1, None] / most
        return np.clip(np.round(weights / unit), -most, most)

    def ours() -> Array:
        state = fitted(given.readout, given.frames, labels)
        sliced = bits.unpack(state.weights, D).numpy()
        return np.tensordot(2 ** np.arange(planes), sliced, (0, 1)) - most - 1

    # Kept weights come from single precision: where half a step decides, they may differ by one.
    return partial(rounded, 0.5), ours, rounded(share), D / 50


def queries() -> Any:
    """Scores by the kernel; by its definition in single precision, too."""
    given = Problems("Kernel", "few frames")

    def by(dtype: Any) -> Array:
        features, penalty = given.features.astype(dtype), dtype(given.penalty)
        known = features[: given.n], given.labels
        scores = [discriminants(*known, q, penalty) for q in features[given.n :]]
        return np.stack(scores).astype(float)

    def ours() -> Array:
        state = fitted(given.readout, given.frames, given.labels)
        return given.readout.scores(state, words_of(given.frames[given.n :])).numpy()

    return partial(by, np.float32), ours, by(mpmath.mpf), given.bound()


def factors() -> Any:
    """Scale and penalty of the kernel with the fewest errors of frames that are left out."""
    frames, labels = frames_of("few frames", 6)
    scales, penalties = [0.01, 1, 4], [0.1, 3.0]

    def errors(*chosen: float) -> int:
        readout = Kernel(scales=chosen[:1], penalties=chosen[1:])
        held_out = fitted(readout, frames, labels).held_out
        return int((held_out.scores.argmax(1) != held_out.rows).sum())

    def ours() -> list[float]:
        state = fitted(Kernel(scales, penalties), frames, labels)
        return [float(state.scale), float(state.penalty)]

    every = list(itertools.product(scales, penalties))
    return lambda: every[0], ours, min(every, key=lambda one: errors(*one))


CASES = [
    *(Case("read-outs", f"{name}, frames left out, {shape}", extreme,
           "the definition in float32", f"hdc.readouts.{name}", "of the scores",
           relative, partial(left_out, name, shape))
      for shape, extreme in INPUTS.items() for name in READOUTS),
    *(Case("read-outs", f"{name}, backward error, {shape}", extreme,
           "an inverse in float32", f"hdc.readouts.{name}", "of matrix and solution",
           largest, partial(backward, name, shape))
      for shape, extreme in INPUTS.items() for name in READOUTS),
    *(Case("read-outs", f"{name}, weights", INPUTS["few frames"],
           "in units of the median", f"hdc.readouts.{name}", "weights",
           differing, partial(steps_of, name))
      for name in ("LDA", "Ridge")),
    Case("read-outs", "Kernel, queries", INPUTS["few frames"],
         "the definition in float32", "hdc.readouts.Kernel", "of the scores",
         relative, queries),
    Case("read-outs", "Kernel, its factors", "the first are not the best",
         "the first", "hdc.readouts.Kernel", "factors", differing, factors),
]  # fmt: skip
