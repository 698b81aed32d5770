"""For tests: bits of classes, and discriminant analysis as it is defined, in coordinates."""

import numpy as np
import torch

from hdc import bits


def bits_of_classes(n, d, n_classes, seed):
    """Bits in ±1 [n, d], packed ones, and classes of unequal size, the last of one frame."""
    rng = np.random.default_rng(seed)
    others = rng.integers(0, n_classes - 1, n - n_classes)
    rows = np.concatenate([np.arange(n_classes), others])
    share = rng.random((n_classes, d))
    x = np.where(rng.random((n, d)) < share[rows], 1.0, -1.0)
    x[:, 5] = 1  # a pixel that is the same in all frames
    return x, bits.pack(torch.from_numpy(x > 0)), rows


def discriminants(x, rows, queries, penalty):
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


def inside(x, rows):
    """Frames minus the mean of their class."""
    return x - np.stack([x[rows == c].mean(0) for c in rows])
