"""Steps of HDC by the functions of other libraries, loaded when they are called."""

from __future__ import annotations

from collections.abc import Sequence
from importlib import import_module as load

import numpy as np
from torch import Tensor, stack


def opencv_median(frame: np.ndarray) -> int:
    """Lower median of the uint8 pixels [D] of a frame by OpenCV's histogram."""
    counts = load("cv2").calcHist([frame], [0], None, [256], [0, 256])
    below = counts.ravel().astype(np.int64).cumsum()
    return int(np.searchsorted(below, (frame.size + 1) // 2))


def multisets(classes: Sequence[Tensor]) -> Tensor:
    """Prototypes bool [L, D] by torchhd, of hypervectors bool [N_l, D] of each class."""
    torchhd = load("torchhd")
    prototypes = [torchhd.multiset(torchhd.BSCTensor(ones)) for ones in classes]
    return stack(prototypes).as_subclass(Tensor)
