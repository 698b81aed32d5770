"""Mean correlations over pairs (Eqs. 4 and 5 of the paper); the reference is exact integer sums."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np

from experiments.studies.correlation.pairs import mean_pair_correlations
from experiments.studies.limits.numerics.measure import exact_mean
from experiments.studies.limits.stability.case import case

Array = np.ndarray[Any, Any]


def one_pass(x: Array, y: Array) -> float:
    """The textbook's (⟨xy⟩ − ⟨x⟩⟨y⟩)/√(…), in the type of the samples."""
    covariance = (x * y).mean() - x.mean() * y.mean()
    variances = ((x * x).mean() - x.mean() ** 2) * ((y * y).mean() - y.mean() ** 2)
    return float(covariance / np.sqrt(variances))


def with_themselves(x: Array, y: Array) -> float:
    """The mean over a whole Gram matrix."""
    return float(np.corrcoef(x, y).mean())


def compared(frames: Array, naive: Callable[..., float], kind: str) -> tuple[Any, ...]:
    """A computation for two frames in a type, beside ours for integers."""
    ours = partial(mean_pair_correlations, *[frames.astype(np.uint16)] * 2)
    return partial(naive, *frames.astype(kind)), ours, exact_mean(frames)


_drawn = np.random.default_rng(0).integers(0, 65_536, (2, 250_000))
_drawn[1, ::2] = _drawn[0, ::2]  # half of the pixels are shared
_rare = 65_000 + (_drawn < 278)  # one pixel in 236 is brighter by one
CASES: tuple[tuple[Any, ...], ...] = (
    ("mean far above the deviation",
     "16-bit frames, mean 10^6 times the deviation: 65,000² has 10 digits, float32 seven",
     "⟨xy⟩ − ⟨x⟩⟨y⟩ in float32", _rare, one_pass, "float32"),
    ("16-bit frames", "16-bit frames up to 65,535: products in uint16 wrap",
     "⟨xy⟩ − ⟨x⟩⟨y⟩ of the camera's integers", _drawn, one_pass, "uint16"),
    ("two samples of a class",
     "one pair; the mean over a whole Gram matrix counts each frame with itself",
     "mean of numpy.corrcoef", _drawn // 256, with_themselves, "uint8"),
)  # fmt: skip
for _name, _extreme, _naive, *_given in CASES:
    case(
        "correlations", _extreme, _naive, "mean_pair_correlations", "correlation", name=_name,
        tolerance=1e-10,
    )(partial(compared, *_given))  # fmt: skip
