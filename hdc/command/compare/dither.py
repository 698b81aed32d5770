"""Cost of one grey level of rounding, as by another camera driver or a lossy file."""

from __future__ import annotations

from typing import Any

import numpy as np
import torch

from hdc import HDCClassifier
from hdc.selection import Combination, Frames, Method

SEED = 0
FALL = 0.03
"""Fall of the accuracy, or rise of the error as a share of a guess's, that is warned of."""


def with_dither(images: np.ndarray) -> np.ndarray:
    """8-bit images of which each pixel goes down by a level, stays or goes up, at random."""
    rng = np.random.default_rng(SEED)
    steps = rng.integers(-1, 2, images.shape, dtype=np.int16)
    return np.clip(images + steps, 0, 255).astype(np.uint8)


def dithered(
    frames: Frames, method: Method, train: np.ndarray, test: np.ndarray
) -> dict[str, Any]:
    """Answers of a form when only the test frames are dithered; nothing of other than 8 bits.

    ``before`` and ``after`` are accuracies, or mean errors as shares of a guess's.
    """
    images = frames.bank.frames
    if images.dtype != torch.uint8 or not isinstance(method, Combination):
        return {}
    model: Any
    if frames.values is None:
        model = HDCClassifier(method.encoder, method.readout)
        model.fit(images[train], frames.labels[train])
    else:
        model = frames.regressor(method.encoder, method.readout)
        model.fit(images[train], frames.values[train])
    shown = images[test].numpy()
    found = {}
    for name, some in (("before", shown), ("after", with_dither(shown))):
        loss = float(frames.losses(model.predict(some), test).mean())
        found[name] = loss if frames.values is not None else 1 - loss
    fall = abs(found["after"] - found["before"])
    worse = (found["after"] < found["before"]) == (frames.values is None)
    return {**found, "seed": SEED, "warns": worse and fall > FALL}
