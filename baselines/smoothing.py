"""Frames smoothed by a Gaussian before a baseline sees them, as hdc's encoder ``smoothed`` does.

The weights along an axis follow :func:`hdc.encoders.smoothed.gaussian`, and beyond an edge the
image is mirrored at its outermost pixels. OpenCV computes the means; they are rounded to 16
bits, in which a grey level of 8 bits has 256 steps.
"""

from __future__ import annotations

import numpy as np
import torch
from torch import Tensor

from hdc.encoders.smoothed import gaussian
from hdc.parameters import check_integer

_MOST = 16  # pixels of deviation


def smoothed(frames: Tensor, deviation: int) -> Tensor:
    """Smoothed frames uint16 [N, H, W] of frames uint8 or uint16; for a deviation of 0 the frames.

    Args:
        frames: of the shape above (CPU or any device).
        deviation: of the Gaussian in pixels; 0 for none.

    Raises:
        ValueError: for a deviation that is no integer from 0 to 16.
    """
    check_integer("smooth", deviation, 0, _MOST)
    if deviation == 0 or not len(frames):
        return frames
    import cv2  # late: 20 MB that few models need

    unit = 256 if frames.dtype == torch.uint8 else 1
    weights = np.array(gaussian(deviation), np.float64)
    weights /= weights.sum()
    found = np.empty(frames.shape, np.uint16)
    for k, frame in enumerate(frames):
        image = frame.numpy(force=True).astype(np.float32) * unit
        mean = cv2.sepFilter2D(
            image, cv2.CV_32F, weights, weights, borderType=cv2.BORDER_REFLECT_101
        )
        found[k] = np.rint(mean).clip(0, 65535)
    return torch.from_numpy(found).to(frames.device)
