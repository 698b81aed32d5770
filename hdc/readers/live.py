"""Frames of a camera that is connected, as they come."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from hdc.readers.files import BadFrame, require
from hdc.readers.recording import Window, is_integer


def camera(
    index: int = 0, crop: Sequence[int] | None = None, subsample: int = 1
) -> Iterator[np.ndarray]:
    """Grey frames [H, W], uint8 or uint16, of a camera until the iterator is closed.

    Args:
        index: number of the camera among those that the system has, as OpenCV counts.
        crop, subsample: see :func:`hdc.readers.open_recording`; a model that learnt from a
            recording needs the same here.

    Raises:
        ValueError: there is no such camera, or a setting is out of range.
        BadFrame: the camera stops giving frames.
    """
    from hdc.readers.images import cv2, quiet

    require(is_integer(index) and index >= 0, "camera", index, "an integer ≥ 0")
    window = Window(crop, subsample)
    with quiet():
        capture = cv2.VideoCapture(index)
    if not capture.isOpened():
        raise ValueError(
            f"camera: expected a camera that can be opened at index {index}, found none (is it "
            "connected, in use by another program, or not permitted?)"
        )
    return _frames(capture, index, window)


def _frames(capture: Any, index: int, window: Window) -> Iterator[np.ndarray]:
    from hdc.readers.images import grey

    try:
        while True:
            ok, image = capture.read()
            if not ok:
                raise BadFrame(f"camera {index}: expected a frame, found none (disconnected?)")
            yield grey(window.of(image))
    finally:
        capture.release()
