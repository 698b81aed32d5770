"""Pixels as models see them, by NumPy and scikit-learn: an oracle of baselines.pixels."""

import torch
from sklearn.preprocessing import StandardScaler


def scaled(frames, pixels="unit"):
    """Scaled pixels of frames, float64 [N, D]."""
    x = frames.flatten(1).numpy().astype(float)
    if pixels == "standardised":
        return StandardScaler().fit_transform(x.T).T
    white = 255 if frames.dtype == torch.uint8 else 65535
    return x / (1 if pixels == "raw" else white)
