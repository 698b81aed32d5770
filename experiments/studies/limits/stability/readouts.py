"""Read-outs of few and nearly equal frames; the references are their definitions in 40 digits.

The features F of N frames, from a Cholesky decomposition, have the products G = F·Fᵀ of a read-out:
of bits in ±1, or of the kernel. With the scatter S of the frames about the means m_c of their
classes, and the penalty ℓ, discriminant analysis scores a query f for class c by

    (f − ½·(m_c + m̄))·w_c,        w_c = ℓ·(S + ℓ)⁻¹·(m_c − m̄).

Ridge regression of 1 for a class and −1 for the others takes the scatter T about the mean m of all
frames, and with n_c frames of a class scores

    2·n_c/N − 1 + (f − m)·w_c,     w_c = 2·n_c·(T + ℓ)⁻¹·(m_c − m).

A frame that is left out is scored by what is learned from the others, with the same penalty.

In double precision, a backward stable method leaves a backward error of some ε and a forward error
of some κ·ε, for the condition number κ of the system that it solves: tolerances are N times that.
"""

from __future__ import annotations

import itertools
from functools import cached_property, partial
from typing import Any

import mpmath
import numpy as np
import torch

from experiments.studies.limits.stability.case import Case, differing, relative
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
READOUTS: dict[str, Readout] = {
    "LDA": LDA(),
    "Ridge": Ridge(FACTOR),
    "Kernel": Kernel(scales=[1], penalties=[FACTOR]),
}
FEW, NEAR = "few frames", "nearly equal frames"
INPUTS = {
    FEW: "12 frames of 100 bits: the scatter within classes is singular",
    NEAR: "frames of a class differ in one bit: its scatter is a millionth",
}
mpmath.mp.dps = 40


def frames_of(name: str, n: int = 4) -> tuple[Array, Array]:
    """Bits [N, D] of n frames of each of three classes, and their classes [N]."""
    random = np.random.default_rng(0)
    labels = np.repeat(np.arange(CLASSES), n)
    drawn = (random.random((CLASSES, D)) < 0.5)[labels]
    flipped = random.random(drawn.shape) < 0.3
    if name == NEAR:
        flipped = np.eye(*drawn.shape) > 0
    return drawn ^ flipped, labels


def fitted(readout: Readout, frames: Array, labels: Array) -> Any:
    """The state of a read-out that has learned frames."""
    return readout.fit(words_of(frames), torch.from_numpy(labels), CLASSES)


def words_of(frames: Array) -> Hypervectors:
    return Hypervectors(bits.pack(torch.from_numpy(frames)), D)


# Definitions --------------------------------------------------------------------------------------


def exactly(values: Array) -> Array:
    """An array of numbers of 40 digits."""
    return np.vectorize(mpmath.mpf, otypes=[object])(values)


def means_of(features: Array, labels: Array) -> Array:
    """Means of the classes [L, R]."""
    return np.stack([features[labels == c].mean(0) for c in range(CLASSES)])


def around(name: str, features: Array, labels: Array) -> Array:
    """Frames minus the mean of their class, for ridge minus the mean of all: [N, R]."""
    means = means_of(features, labels)[labels]
    return features - (features.mean(0) if name == "Ridge" else means)


def weights_of(
    name: str, features: Array, labels: Array, penalty: Any
) -> tuple[Array, Array, Any]:
    """Weights [L, R] of a read-out, where they score zero, and its constants [L]."""
    inside, means = around(name, features, labels), means_of(features, labels)
    middle = features.mean(0) if name == "Ridge" else means.mean(0)
    system = inside.T @ inside
    system.flat[:: len(system) + 1] += penalty
    solved = np.stack([solve(system, right) for right in means - middle])
    if name == "Ridge":
        twice = 2 * np.bincount(labels)
        return twice[:, None] * solved, middle, twice / len(labels) - 1
    return penalty * solved, (means + middle) / 2, 0


def ledoit_wolf(signs: Array, labels: Array) -> float:
    """The penalty of the shrunken covariance (1 − α)·S/n + α·(tr S/n/D)·I, by its definition."""
    inside = around("LDA", signs, labels)
    n = len(signs) - CLASSES
    covariance = inside.T @ inside / n
    target = np.trace(covariance) / D * np.eye(D)
    spread = ((covariance - target) ** 2).sum()
    noise = ((inside**2).sum(1) ** 2).sum() / n**2 - (covariance**2).sum() / n
    alpha = min(1.0, noise / spread)
    return alpha / (1 - alpha) * n * target[0, 0]


class Given:
    """An input for a read-out, with its exact features and its penalty.

    Attributes:
        frames, labels: as :func:`frames_of` makes them.
        products: of the frames, [N, N] of 40 digits.
        features: with these products, [N, N] of 40 digits.
        penalty: ℓ.
    """

    def __init__(self, name: str, shape: str) -> None:
        self.readout = READOUTS[name]
        self.frames, self.labels = frames_of(shape)
        n = self.n = len(self.labels)
        self.signs = 2.0 * self.frames - 1
        self.products = exactly(self.signs @ self.signs.T)
        if name == "Kernel":
            apart = (self.frames[:, None] != self.frames).sum(2)
            pairs = apart[np.triu_indices(n, 1)]
            median = float(np.quantile(pairs, 0.5, method="lower"))
            self.products = np.vectorize(mpmath.exp)(exactly(-apart) / median)
        factor = mpmath.cholesky(mpmath.matrix(self.products.tolist()))
        self.features = np.array(factor.tolist(), object)
        self.inside = around(name, self.features, self.labels)
        self.penalty = FACTOR * (self.inside**2).sum() / n
        if name == "LDA":
            self.penalty = mpmath.mpf(ledoit_wolf(self.signs, self.labels))

    @cached_property
    def matrix(self) -> Array:
        """The matrix of the system among frames, [N, N] of 40 digits."""
        return self.inside @ self.inside.T + self.penalty * np.eye(self.n, dtype=int)

    @property
    def bound(self) -> float:
        """N·κ·ε."""
        return float(self.n * EPSILON * np.linalg.cond(self.matrix.astype(float)))


# Cases --------------------------------------------------------------------------------------------


def forward(name: str, shape: str) -> Any:
    """Scores of frames that are left out, in units of their size: by the definition in single
    precision, and by the read-out."""
    given = Given(name, shape)
    n, labels = given.n, given.labels

    def in_units(scores: Array) -> Array:
        return scores.astype(float) / np.linalg.norm(scores.astype(float))

    def by(dtype: Any) -> Array:
        features, penalty = given.features.astype(dtype), dtype(given.penalty)
        scores = []
        for i in range(n):
            known = np.arange(n) != i
            weights, zero, constants = weights_of(
                name, features[known], labels[known], penalty
            )
            scores.append(constants + ((features[i] - zero) * weights).sum(1))
        return in_units(np.stack(scores))

    def ours() -> Array:
        state = fitted(given.readout, given.frames, labels)
        return in_units(state.held_out.scores.numpy())

    return partial(by, np.float32), ours, by(mpmath.mpf), given.bound


def backward(name: str, shape: str) -> Any:
    """Solutions by an inverse in single precision and by the library; in place of an exact one, the
    system that they should solve."""
    given = Given(name, shape)
    n, penalty = given.n, float(given.penalty)
    right = np.eye(n)
    if name != "Ridge":
        means = means_of(given.features, given.labels)
        right = given.inside @ (means - means.mean(0)).T
    words, labels = words_of(given.frames), torch.from_numpy(given.labels)
    products = torch.from_numpy(given.products.astype(float))

    def naive() -> Array:
        single = np.linalg.inv(given.matrix.astype(np.float32))
        return single @ right.astype(np.float32)

    def ours() -> Array:
        if name == "Ridge":
            return Dual.of(words, penalty).inverse.numpy()
        return Problem.of(products, labels).solve(penalty).products.frames.numpy()

    return naive, ours, (given, right), n * EPSILON


def residual(solution: Array, system: tuple[Given, Array]) -> float:
    """A·x − b relative to ‖G‖·‖x‖ + ‖b‖, as the products G are given."""
    given, right = system
    apart = given.matrix @ exactly(solution) - right
    of_apart, products, x, b = (
        np.linalg.norm(part.astype(float))
        for part in (apart, given.products, solution, right)
    )
    return float(of_apart / (products * x + b))


def kept_weights(most: int = 7, share: float = 0.995) -> Any:
    """Weights of LDA in whole steps [L, D]: by their definition, and as they are kept.

    The unit is this quantile of their sizes over the most steps; the naive one is the median.
    """
    given = Given("LDA", FEW)
    weights, _, _ = weights_of("LDA", given.signs, given.labels, float(given.penalty))

    def rounded(quantile: float) -> Array:
        sizes = np.sort(np.abs(weights), 1)
        unit = sizes[:, round(quantile * D) - 1, None] / most
        return np.clip(np.round(weights / unit), -most, most)

    def ours() -> Array:
        state = fitted(given.readout, given.frames, given.labels)
        sliced = bits.unpack(state.weights, D).numpy()
        planes = 2 ** np.arange(sliced.shape[1])
        return np.tensordot(planes, sliced, (0, 1)) - most - 1

    # Kept weights come from single precision: where half a step decides, they may differ by one.
    return partial(rounded, 0.5), ours, rounded(share), D / 50


def factors() -> Any:
    """Scale and penalty of the kernel with the fewest errors of frames that are left out."""
    frames, labels = frames_of(FEW, 6)
    scales, penalties = [0.01, 1, 4], [0.1, 3.0]
    every = list(itertools.product(scales, penalties))

    def errors(chosen: tuple[float, float]) -> int:
        readout = Kernel(scales=chosen[:1], penalties=chosen[1:])
        held_out = fitted(readout, frames, labels).held_out
        return int((held_out.scores.argmax(1) != held_out.rows).sum())

    def ours() -> list[float]:
        state = fitted(Kernel(scales, penalties), frames, labels)
        return [float(state.scale), float(state.penalty)]

    return lambda: every[0], ours, min(every, key=errors)


CASES = [
    *(Case("read-outs", f"{name}, {what}, {shape}", INPUTS[shape],
           naive, f"hdc.readouts.{name}", unit, error, partial(prepare, name, shape))
      for what, naive, unit, error, prepare in (
          ("frames left out", "the definition in float32", "of the scores", relative, forward),
          ("backward error", "an inverse in float32", "of products and solution",
           residual, backward))
      for shape in INPUTS for name in READOUTS),
    Case("read-outs", "LDA, weights", INPUTS[FEW], "in units of the median",
         "hdc.readouts.LDA", "weights", differing, kept_weights),
    Case("read-outs", "Kernel, its factors", "the first are not the best", "the first",
         "hdc.readouts.Kernel", "factors", differing, factors),
]  # fmt: skip
