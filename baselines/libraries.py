"""Steps of HDC by the functions of other libraries, loaded when they are called."""

from __future__ import annotations

from collections.abc import Sequence
from importlib import import_module as load

import numpy as np
from torch import Tensor, stack


def opencv_median(frame: np.ndarray) -> int:
    """Lower median of the uint8 pixels [D] of a frame by OpenCV's histogram."""
    counts = load("cv2").calcHist([frame], [0], None, [256], [0, 256])
    return _level_of(counts.ravel().astype(np.int64))


def numpy_median(frame: np.ndarray) -> int:
    """The same by NumPy's histogram."""
    return _level_of(np.bincount(frame, minlength=256))


def _level_of(counts: np.ndarray) -> int:
    """The grey value that half of the pixels do not exceed, of a histogram [256]."""
    return int(np.searchsorted(counts.cumsum(), (counts.sum() + 1) // 2))


def multisets(classes: Sequence[Tensor]) -> Tensor:
    """Prototypes bool [L, D] by torchhd, of hypervectors bool [N_l, D] of each class."""
    torchhd = load("torchhd")
    prototypes = [torchhd.multiset(torchhd.BSCTensor(ones)) for ones in classes]
    return stack(prototypes).as_subclass(Tensor)
