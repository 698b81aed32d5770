"""Pixels as models see them, by NumPy and scikit-learn: an oracle of baselines.pixels."""

import torch
from sklearn.preprocessing import StandardScaler

from baselines.pixels import signs


def scaled(frames, pixels="unit", n_train=None):
    """Scaled pixels of frames, float64 [N, D]; a mean over frames is over the first n_train."""
    if pixels == "bits":
        return signs(frames).flatten(1).double().numpy()
    x = frames.flatten(1).numpy().astype(float)
    if pixels == "standardised":
        return StandardScaler().fit_transform(x.T).T
    offset = x[:n_train].mean() if pixels == "unit_centred" else 0.0
    white = 255 if frames.dtype == torch.uint8 else 65535
    return (x - offset) / (1 if pixels == "raw" else white)
