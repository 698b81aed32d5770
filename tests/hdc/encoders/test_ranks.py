"""Thresholds by rank: exactly ⌊(1 − q)·D⌋ ones, whatever the frame and whatever came before."""

from __future__ import annotations

import warnings
from fractions import Fraction

import numpy as np
import pytest
import torch

from hdc import bits
from hdc.encoders import Levels, Median, Quantile, ranks, thresholds
from hdc.encoders.ties import TIES
from tests.hdc.own import by

pytestmark = [
    pytest.mark.filterwarnings("ignore:.*constant frame"),
    pytest.mark.filterwarnings("ignore:.*of the pixels of a frame equal"),
]


def encode(frames: torch.Tensor, first: int = 0, **options) -> torch.Tensor:
    return Median().encode(frames, first, **options)


def by_torch(
    frames: torch.Tensor, quantiles: list[Fraction], ties: str
) -> torch.Tensor:
    """Hypervectors by the route of other devices."""
    pixels = ranks._pixels(frames, 0)
    ones = ranks.count_ones(quantiles, pixels.shape[1])
    words = torch.empty(
        len(pixels), bits.words_for(len(ones) * pixels.shape[1]), dtype=torch.int64
    )
    levels = ranks.by_torch(pixels, ones, ties)
    ranks._encode_block(levels, pixels.shape[1], words)
    return words


types = ["uint8", "int8", "uint16", "int16", "uint32", "int32", "uint64", "int64"]
all_types = [*types, "float16", "float32", "float64"]


PAIRS = {
    *((d, kind) for d in (333, 4161) for kind in all_types),
    *((d, "uint8") for d in (1, 2, 63, 64, 65, 4096, 4097, 4160, 70_001)),
    *((d, "float32") for d in (1, 64, 65, 4096, 4097)),
}


@pytest.mark.parametrize(("d", "dtype"), sorted(PAIRS))
def test_any_frame_by_any_route_and_sample(
    d, dtype, kinds_of_frames, brightest, monkeypatch
):
    """The sample says where to look first, and nothing else: it may be as wrong as can be."""
    frames = kinds_of_frames(d, dtype)
    expected = brightest(frames)
    for small in (2**30, 1):  # many at once, and frame by frame
        monkeypatch.setattr(ranks, "_SMALL", small)
        for places in (thresholds._sampled(d), np.zeros(1, int), np.full(5, d - 1)):
            monkeypatch.setattr(thresholds, "_sampled", lambda n, places=places: places)
            words = encode(torch.from_numpy(frames))
            assert np.array_equal(bits.unpack(words, d).numpy(), expected)
    _, ties = ranks.encode_ranks(torch.from_numpy(frames), [Fraction(1, 2)])
    assert ties.constant == np.flatnonzero((frames == frames[:, :1]).all(1)).tolist()
    there = by_torch(torch.from_numpy(frames), [Fraction(1, 2)], "spread")
    assert torch.equal(there, words)


@pytest.mark.parametrize(("dtype", "most"), [("uint8", 5), ("uint16", 12)])
def test_frames_of_a_camera_take_few_passes(
    dtype, most, camera_frames, brightest, monkeypatch
):
    frames = camera_frames(12, dtype=dtype).reshape(12, -1)
    counted = []
    count = thresholds.count_ones

    def counting(words):
        counted.append(1)
        return count(words)

    monkeypatch.setattr(thresholds, "count_ones", counting)
    words = encode(torch.from_numpy(frames))
    assert np.array_equal(bits.unpack(words, 250_000).numpy(), brightest(frames))
    assert len(counted) <= most * len(frames)


@pytest.mark.parametrize("dtype", all_types)
def test_extreme_numbers_keep_their_order(dtype, brightest, monkeypatch):
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
        one = np.ones(130, dtype)
        frames[2] = np.nextafter(one, 2 * one * (frames[0] > 0))
    for small in (2**30, 1):
        monkeypatch.setattr(ranks, "_SMALL", small)
        words = encode(torch.from_numpy(frames))
        found = bits.unpack(words, frames[0].size).numpy()
        assert np.array_equal(found, brightest(frames))
    there = by_torch(torch.from_numpy(frames), [Fraction(1, 2)], "spread")
    assert torch.equal(there, words)


SIZES = {
    *((d, "uint8") for d in (1, 2, 7, 63, 64, 65, 130, 1000, 4097, 4200)),
    *((d, kind) for d in (130, 4200) for kind in ("uint16", "int16", "float32")),
}
SEVEN = [Fraction(t, 8) for t in range(1, 8)]


@pytest.mark.parametrize("ties", TIES)
@pytest.mark.parametrize(("d", "dtype"), sorted(SIZES))
def test_quantiles_and_levels_by_every_route(
    d, ties, dtype, kinds_of_frames, brightest
):
    pytest.importorskip("numba")
    frames = kinds_of_frames(d, dtype)
    images = torch.from_numpy(frames)
    for encoder, quantiles in (
        (Median(ties), [Fraction(1, 2)]),
        (Quantile("3/4", ties), [Fraction(3, 4)]),
        (Quantile(0.1, ties), [Fraction(1, 10)]),
        (Levels(2, ties=ties), [Fraction(1, 3), Fraction(2, 3)]),
        (Levels(7, ties=ties), SEVEN),
    ):
        masks = [brightest(frames, q, ties) for q in quantiles]
        words = encoder.encode(images)
        assert encoder.dimension(d) == len(quantiles) * d
        found = bits.unpack(words, len(quantiles) * d).numpy()
        assert np.array_equal(found, np.concatenate(masks, 1))
        assert torch.equal(by("compiled", encoder.encode, images), words)
        assert torch.equal(by_torch(images, quantiles, ties), words)


@pytest.mark.parametrize("ties", TIES)
def test_chunks_and_threads_change_no_bit(ties, brightest):
    pytest.importorskip("numba")
    frames = np.random.default_rng(0).integers(0, 5, (700, 1300)).astype(np.uint8)
    images, before = torch.from_numpy(frames), torch.get_num_threads()
    torch.set_num_threads(2)
    try:
        for encoder in (Median(ties), Levels(3, ties=ties)):
            words = encoder.encode(images)
            assert torch.equal(by("compiled", encoder.encode, images), words)
            assert torch.equal(encoder.encode(images[650:], 650), words[650:])
    finally:
        torch.set_num_threads(before)
    found = bits.unpack(Median(ties).encode(images[690:]), 1300).numpy()
    assert np.array_equal(found, brightest(frames[690:], "1/2", ties))


def test_quantiles_are_the_fractions_that_are_written():
    """⌊(1 − .9)·250000⌋ is 24999 in floats."""
    for at in (0.9, "0.9", "9/10", Fraction(9, 10), np.float64(0.9)):
        assert Quantile(at).ones(250_000) == [25_000]
    frame = torch.arange(250_000, dtype=torch.int32)[None]
    assert bits.count_ones(Quantile(0.9).encode(frame)).tolist() == [25_000]
    assert Levels(7).ones(250_001) == [218_750, 187_500, 156_250, 125_000, 93_750,
                                       62_500, 31_250]  # fmt: skip


@pytest.mark.parametrize("at", [0, 1, -0.5, 1.5, "x", "1/0", None, float("nan"), True])
def test_quantiles_outside_are_named(at):
    with pytest.raises(
        ValueError, match=r"^at: expected a quantile in \(0, 1\), found"
    ):
        Quantile(at).check()


def test_other_rules_of_ties_are_named():
    message = "ties: expected one of spread, raster, below, found 'half'"
    for encoder in (Median("half"), Quantile(ties="half"), Levels(ties="half")):
        for dtype in (torch.uint8, torch.float32):
            with pytest.raises(ValueError, match=message):
                encoder.encode(torch.zeros(2, 9, dtype=dtype))
        with pytest.raises(ValueError, match=message):
            encoder.check()


# Ties ---------------------------------------------------------------------------------------------


def test_frames_of_two_values_are_warned_of_once():
    two = torch.from_numpy(np.random.default_rng(0).random((3, 900)) < 0.3).to(
        torch.uint8
    )
    for encoder, backend in ((Median(), "numpy"), (Median("raster"), "numpy")):
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            for _ in range(3):
                by(backend, encoder.encode, two)
        (warning,) = caught
        assert "7" in str(warning.message).split("%")[0]  # of 70 % zeros
        assert f"(ties={encoder.ties!r})" in str(warning.message)


def test_few_ties_are_not_warned_of():
    """A tenth of the pixels may tie at the median, half of them at one of several levels."""
    frame = torch.arange(1000, dtype=torch.int32)[None]
    frame[0, 460:559] = 500
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        Median().encode(frame)
        for d in (50, 5000):  # of a value that all become ones none is split
            Median().encode((torch.arange(d) < d // 2)[None].float())
        frame[0, 300:790] = 500
        Levels().encode(frame)
    with pytest.warns(UserWarning, match="49% of the pixels of a frame equal"):
        Median().encode(frame)
    frame[0, 200:790] = 500
    with pytest.warns(UserWarning, match="59% of the pixels of a frame equal"):
        Levels().encode(frame)


def test_routes_count_the_same_ties(kinds_of_frames):
    pytest.importorskip("numba")
    frames = torch.from_numpy(kinds_of_frames(4200))
    for quantiles in ([Fraction(1, 2)], SEVEN):
        _, here = ranks.encode_ranks(frames, quantiles)
        _, there = by("compiled", ranks.encode_ranks, frames, quantiles)
        assert here == there
        levels = ranks.by_torch(frames, ranks.count_ones(quantiles, 4200), "spread")
        by_other_routes = torch.stack([level.n_equal for level in levels], 1)
        split = torch.stack([level.split for level in levels], 1)
        counted = by_other_routes.numpy(), split.numpy()
        assert ranks.ties_of(*counted, 4200) == here


def test_frames_with_strides_are_read_by_value():
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


def test_constant_frames_are_numbered_from_first():
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
        warnings.filterwarnings("error", ".*constant frame")
        encode(almost)
        encode(1 - almost)


@pytest.mark.parametrize("dtype", [torch.float16, torch.float32, torch.float64])
@pytest.mark.parametrize("value", [float("nan"), float("inf"), float("-inf")])
def test_pixels_that_are_not_finite(dtype, value):
    frames = torch.zeros(3, 4, 4, dtype=dtype)
    frames[1, 3, 3] = value
    found = "NaN" if value != value else value
    with pytest.raises(
        ValueError, match=rf"frames\[11\]: expected finite pixels, found {found}"
    ):
        encode(frames, first=10)


def test_other_shapes_and_types_are_refused():
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
def test_same_bits_on_cuda(dtype):
    frames = torch.randint(
        0, 99, (70, 50, 51), generator=torch.Generator().manual_seed(0)
    )
    frames = frames.to(dtype)
    assert torch.equal(encode(frames.cuda()).cpu(), encode(frames))
