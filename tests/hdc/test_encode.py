"""Frames to hypervectors with exactly half ones, whatever the frame and whatever came before."""

from __future__ import annotations

import warnings

import numpy as np
import pytest
import torch
from hdc.encode import encode

from hdc import bits
from hdc import encode as encoding

pytestmark = pytest.mark.filterwarnings("ignore:.*constant frame")


types = ["uint8", "int8", "uint16", "int16", "uint32", "int32", "uint64", "int64"]
all_types = [*types, "float16", "float32", "float64"]


@pytest.mark.parametrize("dtype", all_types)
@pytest.mark.parametrize("d", [1, 2, 63, 64, 65, 333, 4096, 4097, 4160, 4161, 70_001])
def test_any_frame_by_any_route_and_sample(
    d: int, dtype: str, kinds_of_frames, upper_half, monkeypatch
) -> None:
    """The sample says where to look first, and nothing else: it may be as wrong as can be."""
    frames = kinds_of_frames(d, dtype)
    expected = upper_half(frames)
    for small in (2**30, 1):  # many at once, and frame by frame
        monkeypatch.setattr(encoding, "_SMALL", small)
        for places in (encoding._places(d), np.zeros(1, int), np.full(5, d - 1)):
            monkeypatch.setattr(
                encoding, "_places", lambda dimension, places=places: places
            )
            words = encode(torch.from_numpy(frames))
            assert np.array_equal(bits.unpack(words, d).numpy(), expected)
    by_torch = torch.empty_like(words)
    flat = encoding._encode_torch(
        encoding._pixels(torch.from_numpy(frames), 0), by_torch
    )
    assert torch.equal(by_torch, words)
    assert flat == (frames == frames[:, :1]).all(1).tolist()


@pytest.mark.parametrize(("dtype", "most"), [("uint8", 5), ("uint16", 12)])
def test_frames_of_a_camera_take_few_passes(
    dtype: str, most: int, camera_frames, upper_half, monkeypatch
) -> None:
    frames = camera_frames(12, dtype=dtype).reshape(12, -1)
    counted = []
    count = encoding._popcount
    monkeypatch.setattr(
        encoding, "_popcount", lambda words: counted.append(1) or count(words)
    )
    words = encode(torch.from_numpy(frames))
    assert np.array_equal(bits.unpack(words, 250_000).numpy(), upper_half(frames))
    assert len(counted) <= most * len(frames)


@pytest.mark.parametrize("dtype", all_types)
def test_extreme_numbers_keep_their_order(dtype: str, upper_half, monkeypatch) -> None:
    rng = np.random.default_rng(0)
    if dtype in types:
        info = np.iinfo(dtype)
        frames = rng.integers(
            info.min, info.max, (3, 11, 13), dtype=dtype, endpoint=True
        )
        frames[1] = np.where(frames[1] % 2, info.min, info.max)
        frames[2] = info.max - frames[2] % 3
    else:
        limits = np.finfo(dtype)
        frames = rng.standard_normal((3, 130)).astype(dtype)
        extremes = np.array([limits.max, limits.min, 0, -0.0, limits.tiny], dtype)
        frames[1] = rng.choice(extremes, 130)
        frames[2] = np.nextafter(one := np.ones(130, dtype), 2 * one * (frames[0] > 0))
    for small in (2**30, 1):
        monkeypatch.setattr(encoding, "_SMALL", small)
        words = encode(torch.from_numpy(frames))
        assert np.array_equal(
            bits.unpack(words, frames[0].size).numpy(), upper_half(frames)
        )


def test_frames_with_strides_are_read_by_value() -> None:
    frames = torch.from_numpy(
        np.random.default_rng(0).integers(0, 9, (6, 8, 10)).astype(np.uint8)
    )
    for view in (
        frames[::2],
        frames[:, ::2],
        frames.transpose(1, 2),
        frames[:, :, 1:4],
    ):
        assert torch.equal(encode(view), encode(view.contiguous()))


@pytest.mark.parametrize("dtype", [torch.uint8, torch.int16])
def test_large_constant_frames_are_named_and_others_are_not(dtype: torch.dtype) -> None:
    frames = torch.from_numpy(np.random.default_rng(0).integers(0, 99, (2, 9000))).to(
        dtype
    )
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        encode(frames)
    frames[1] = 7
    with pytest.warns(
        UserWarning, match=r"1 constant frame\(s\), at index 1: every pixel is equal"
    ):
        encode(frames)


def test_constant_frames_are_numbered_from_first() -> None:
    frames = torch.zeros(2, 1, dtype=torch.uint8)
    with pytest.warns(UserWarning, match=r"2 constant frame\(s\), at index 0, 1:"):
        assert encode(frames).tolist() == [[0], [0]]
    with pytest.warns(UserWarning, match="at index 5, 6:"):
        encode(frames, first=5)
    with pytest.warns(UserWarning, match=r"12 constant frame\(s\).*8, 9, …:"):
        encode(torch.ones(12, 9, dtype=torch.uint8))
    almost = torch.zeros(1, 9, dtype=torch.uint8)
    almost[0, 3] = 1  # the pixel of the cut's other side
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        encode(almost)
        encode(1 - almost)


@pytest.mark.parametrize("dtype", [torch.float16, torch.float32, torch.float64])
@pytest.mark.parametrize("value", [float("nan"), float("inf"), float("-inf")])
def test_pixels_that_are_not_finite(dtype: torch.dtype, value: float) -> None:
    frames = torch.zeros(3, 4, 4, dtype=dtype)
    frames[1, 3, 3] = value
    found = "NaN" if value != value else value
    with pytest.raises(
        ValueError, match=rf"frames\[11\]: expected finite pixels, found {found}"
    ):
        encode(frames, first=10)


def test_other_shapes_and_types_are_refused() -> None:
    for shape in ((4,), (1, 2, 3, 4), (3, 0), (3, 0, 4)):
        with pytest.raises(ValueError, match="frames: expected shape"):
            encode(torch.zeros(shape))
    for dtype in (torch.bool, torch.complex64):
        with pytest.raises(TypeError, match="frames: expected real or integer pixels"):
            encode(torch.zeros(2, 3, dtype=dtype))
    assert encode(torch.zeros(0, 5, 5, dtype=torch.uint8)).shape == (0, 1)
    assert encode(torch.zeros(0, 5, 5)).shape == (0, 1)


@pytest.mark.skipif(not torch.cuda.is_available(), reason="no CUDA device")
@pytest.mark.parametrize("dtype", [torch.uint8, torch.int16, torch.float32])
def test_same_bits_on_cuda(dtype: torch.dtype) -> None:
    frames = torch.randint(
        0, 99, (70, 50, 51), generator=torch.Generator().manual_seed(0)
    )
    frames = frames.to(dtype)
    assert torch.equal(encode(frames.cuda()).cpu(), encode(frames))
