"""Encode: frames to hypervectors."""

from __future__ import annotations

import numpy as np
from torch import Tensor

from experiments.studies.benchmark.cases import Case, pack_bits, packed_bytes
from experiments.studies.benchmark.route import Job, ours, route
from hdc.encode import encode


@ours("encode")
def hdc(case: Case, backend: str) -> Job:
    frames = case.frames.to(case.device)
    return lambda: encode(frames, backend=backend), lambda words: packed_bytes(words, case.d)


@route("encode", "torch.median, compare", anywhere=True, types=("uint8", "float32"))
def torch_median(case: Case) -> Job:
    frames = case.frames.to(case.device)
    return lambda: torch_threshold(frames), pack_bits


@route("encode", "numpy.median, compare", module="numpy")
def numpy_median(case: Case) -> Job:
    frames = case.frames.numpy()
    return lambda: frames > np.median(frames, axis=1, keepdims=True), pack_bits


@route("encode", "torch.kthvalue, compare", types=("uint8", "float32"))
def torch_kthvalue(case: Case) -> Job:
    frames, place = case.frames, case.d - case.d // 2
    return lambda: frames > frames.kthvalue(place, dim=1, keepdim=True).values, pack_bits


@route("encode", "numpy.partition, compare", module="numpy")
def numpy_partition(case: Case) -> Job:
    frames, place = case.frames.numpy(), case.d - case.d // 2 - 1
    return lambda: frames > np.partition(frames, place, axis=1)[:, place, None], pack_bits


@route("encode", "cv2.calcHist, compare, packbits", module="cv2", types=("uint8", "uint16"))
def opencv_histogram(case: Case) -> Job:
    import cv2

    frames, levels = case.frames.numpy(), np.iinfo(case.dtype).max + 1

    def threshold(pixels: np.ndarray) -> np.ndarray:
        counts = cv2.calcHist([pixels], [0], None, [levels], [0, levels])  # float32, exact to 2^24
        below = counts.reshape(-1).astype(np.int64).cumsum()
        return pack_bits(pixels > np.searchsorted(below, (len(pixels) + 1) // 2))

    return lambda: np.stack([threshold(pixels) for pixels in frames]), lambda packed: packed


@route("encode", "numpy.bincount, compare, packbits", module="numpy", types=("uint8", "uint16"))
def numpy_bincount(case: Case) -> Job:
    frames = case.frames.numpy()

    def call() -> np.ndarray:
        out = np.empty((case.n, -(-case.d // 8)), np.uint8)
        for row, pixels in zip(out, frames, strict=True):
            row[:] = histogram_threshold(pixels)
        return out

    return call, lambda packed: packed


def torch_threshold(frames: Tensor) -> Tensor:
    """Pixels above the median of their frame: bool [N, D]."""
    return frames > frames.median(1, keepdim=True).values


def histogram_threshold(pixels: np.ndarray) -> np.ndarray:
    """A median by counting grey levels, and packed bits: the best that plain numpy offers."""
    below = np.bincount(pixels, minlength=256).cumsum()
    return pack_bits(pixels > np.searchsorted(below, (len(pixels) + 1) // 2))
