"""Encoders and read-outs at the sizes where counting goes wrong; references are the definitions."""

from __future__ import annotations

from fractions import Fraction
from functools import partial
from typing import Any

import numpy as np
import torch
from torch import Tensor

from experiments.studies.limits.stability.case import case
from hdc import bits
from hdc.encoders import Levels, Median
from hdc.encoders.ranks import RankEncoder
from hdc.readouts import LDA

encoder_case = partial(case, "encoders")
readout_case = partial(case, "read-outs")


def ranked(make: type[RankEncoder], steps: int, d: int) -> Any:
    """A rising frame of D pixels: those from place D − ⌊(1 − t/steps)·D⌋ on are ones."""
    frame = torch.arange(d, dtype=torch.int32)[None]
    quantiles = [Fraction(t, steps) for t in range(1, steps)]
    firsts = [d - int((1 - q) * d) for q in quantiles]
    exact = np.stack([np.arange(d) >= first for first in firsts])

    def naive() -> np.ndarray:
        shares = torch.tensor([float(q) for q in quantiles])
        limits = torch.quantile(frame[0].float(), shares)
        return (frame >= limits[:, None]).numpy()

    def ours() -> np.ndarray:
        words = make().encode(frame)
        found = bits.unpack(words, len(quantiles) * d)
        return found.view(len(quantiles), d).numpy()

    return naive, ours, exact


def wrong_bits(found: Any, exact: Any) -> float:
    """Number of bits that differ."""
    return float((np.asarray(found, bool) != exact).sum())


for _make, _steps, _d in (
    (Median, 2, 1),
    (Median, 2, 65),
    (Median, 2, 2**24 + 1),
    (Levels, 8, 1),
    (Levels, 8, 65),
):
    encoder_case(
        f"D = {_d:,} is odd: which of two halves has the pixel in the middle",
        "pixel ≥ torch.quantile",
        f"hdc.encoders.{_make.__name__}",
        "bits",
        name=f"{_make.__name__.lower()} of {_d:,} pixels",
        error=wrong_bits,
    )(partial(ranked, _make, _steps, _d))


def few_frames(d: int = 100, n: int = 8) -> tuple[Tensor, np.ndarray, np.ndarray]:
    """Bits of 3 classes of n frames, fewer than pixels: [3n, D], classes, and queries [50, D]."""
    random = np.random.default_rng(0)
    labels = np.repeat(np.arange(3), n)
    base = random.random((3, d)) < 0.5
    common = random.random((3 * n + 50, 1)) * random.random(d)
    flipped = random.random((3 * n + 50, d)) < 0.6 * common
    of_queries = random.integers(0, 3, 50)
    true = base[np.concatenate([labels, of_queries])]
    frames = torch.from_numpy(true ^ flipped)
    return frames, labels, of_queries


def scatter(frames: np.ndarray, labels: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Frames [N, D] minus their class's mean, and the means [L, D]."""
    means = np.stack([frames[labels == c].mean(0) for c in range(3)])
    return frames - means[labels], means


def root_mean_square(found: np.ndarray, exact: np.ndarray) -> float:
    """Of the distances from the exact scores."""
    return float(np.sqrt(((found - exact) ** 2).mean()))


@readout_case(
    "24 frames of 100 bits: the scatter within classes is singular",
    "discriminants by the inverse of the scatter",
    "hdc.readouts.LDA",
    "of the deviation",
    error=root_mean_square,
    tolerance=0.04,  # weights have 15 steps
)
def lda_of_a_singular_scatter() -> Any:
    frames, labels, _ = few_frames()
    n, d = len(labels), frames.shape[1]
    signs = 2.0 * frames.numpy() - 1
    inside, means = scatter(signs[:n], labels)
    degrees = n - 3
    covariance = inside.T @ inside / degrees
    queries = signs[n:] - means.mean(0)

    def discriminants(inverse: np.ndarray) -> np.ndarray:
        return unit(queries @ inverse @ (means - means.mean(0)).T)

    def naive() -> np.ndarray:
        return discriminants(np.linalg.inv(covariance))

    def ours() -> np.ndarray:
        rows = torch.from_numpy(labels)
        model = LDA().fit(bits.pack(frames[:n]), rows, 3, d)
        return unit(model.scores(bits.pack(frames[n:])).double().numpy())

    # Ledoit and Wolf's share, by its definition.
    target = np.trace(covariance) / d * np.eye(d)
    fourth = ((inside**2).sum(1) ** 2).sum() / degrees**2
    noise = fourth - (covariance**2).sum() / degrees
    alpha = min(1.0, noise / ((covariance - target) ** 2).sum())
    shrunken = (1 - alpha) * covariance + alpha * target
    return naive, ours, discriminants(np.linalg.inv(shrunken))


def unit(scores: np.ndarray) -> np.ndarray:
    """Scores [Q, L] relative to the mean class and query, in units of their deviation."""
    centred = scores - scores.mean(1, keepdims=True)
    centred -= centred.mean(0)
    return centred / centred.std()
