"""For tests: discriminant analysis as it is defined, in coordinates of the frames."""

from __future__ import annotations

import numpy as np


def discriminants(
    x: np.ndarray, rows: np.ndarray, queries: np.ndarray, penalty: float | None
) -> np.ndarray:
    """ℓ·(q − ½(μ_c + μ))ᵀ·(S + ℓ·I)⁻¹·(μ_c − μ), [Q, L], of frames [N, D]; ℓ is endless if None."""
    classes = np.unique(rows)
    means = np.stack([x[rows == c].mean(0) for c in classes])
    centre = means.mean(0)
    away = (means - centre).T
    if penalty is not None:
        within = x - means[np.searchsorted(classes, rows)]
        matrix = within.T @ within + penalty * np.eye(x.shape[1])
        away = penalty * np.linalg.solve(matrix, away)
    halfway = (means + centre) / 2
    return queries @ away - (halfway * away.T).sum(1)


def scatter(x: np.ndarray, rows: np.ndarray) -> float:
    """tr S: the squares of all frames minus the mean of their class."""
    return sum(((x[rows == c] - x[rows == c].mean(0)) ** 2).sum() for c in set(rows))
