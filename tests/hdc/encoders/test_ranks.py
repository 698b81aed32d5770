"""Thresholds by rank: exactly ⌊(1 − q)·D⌋ ones, whatever the frame and whatever came before."""

import warnings
from fractions import Fraction

import numpy as np
import pytest
import torch

from hdc import bits
from hdc.encoders import Levels, Median, Quantile, ranks
from tests.hdc.own import KERNELS, by

pytestmark = [
    pytest.mark.filterwarnings("ignore:.*constant frame"),
    pytest.mark.filterwarnings("ignore:.*of the pixels of a frame equal"),
]
INTEGERS = [f"{sign}int{n}" for sign in ("", "u") for n in (8, 16, 32, 64)]
FLOATS = ["float16", "float32", "float64"]
ENCODERS = [
    Quantile("3/4"),
    Quantile(0.1),
    Levels(2),
    Levels(7),
]
CASES = [
    *((Median(), d, "uint8") for d in (1, 2, 63, 64, 65, 4096, 4097, 70_001)),
    *((Median(), d, kind) for d in (333, 4161) for kind in INTEGERS + FLOATS),
    *((encoder, 130, "uint16") for encoder in ENCODERS),
    *((encoder, 4200, "uint8") for encoder in ENCODERS),
]


def order_of_pixels(d):
    """The place of each pixel [D] among equal ones: that of place 0 is the first to be a one."""
    keys = []
    for j in range(d):
        word, bit = divmod(j, 64)
        rotation = (word * 0x9E3779B1 % 2**32) >> 26
        keys.append(((bit + rotation) % 64, word))
    places = np.empty(d, int)
    for place, j in enumerate(sorted(range(d), key=keys.__getitem__)):
        places[j] = place
    return places


def brightest(frames, quantile="1/2"):
    """Mask [N, D] of the ⌊(1 − q)·D⌋ largest pixels of each frame, by sorting all of them.

    Of equal pixels the first in the order of ties comes first.
    """
    frames = frames.reshape(len(frames), -1)
    d = frames.shape[1]
    n_ones = int((1 - Fraction(quantile)) * d)
    places = order_of_pixels(d)
    mask = np.zeros(frames.shape, bool)
    for row, frame in zip(mask, frames, strict=True):
        falling = np.lexsort((-places, frame))[::-1]
        row[falling[:n_ones]] = True
    return mask


def by_every_route(monkeypatch, frames, encoder):
    """Words, and numbers of ties: by kernels, many frames at once, one after another."""
    images = torch.from_numpy(frames)
    ones = encoder.ones(images.shape[1:].numel())
    if KERNELS and images.dtype in ranks.COMPILED:
        yield by("compiled", ranks.encode_ranks, images, ones)
    for route in ((5, ranks.at_once), (16, ranks.one_by_one)):
        monkeypatch.setattr(ranks, "route_of", lambda *_, route=route: route)
        yield ranks.encode_ranks(images, ones)


def assert_brightest(encoder, frames, monkeypatch):
    flat = frames.reshape(len(frames), -1)
    masks = [brightest(flat, q) for q in encoder.quantiles]
    expected = np.concatenate(masks, 1)
    constant = (flat == flat[:, :1]).all(1)
    ties = []
    for words, n_equal, split in by_every_route(monkeypatch, frames, encoder):
        assert np.array_equal(bits.unpack(words, expected.shape[1]).numpy(), expected)
        assert np.array_equal(n_equal[:, 0] == flat.shape[1], constant)
        ties.append((n_equal * split).tolist())
    assert all(found == ties[0] for found in ties)


@pytest.mark.parametrize(("encoder", "d", "dtype"), CASES, ids=repr)
def test_the_brightest_are_ones_by_any_route(
    encoder, d, dtype, kinds_of_frames, monkeypatch
):
    assert encoder.dimension(d) == len(encoder.quantiles) * d
    assert_brightest(encoder, kinds_of_frames(d, dtype), monkeypatch)


@pytest.mark.parametrize("dtype", INTEGERS + FLOATS)
def test_extreme_numbers_keep_their_order(dtype, monkeypatch):
    rng = np.random.default_rng(0)
    if dtype in FLOATS:
        limits, one = np.finfo(dtype), np.ones(1, dtype)
        above = np.nextafter(one, 2 * one)[0]
        extremes = [limits.max, limits.min, 0, -0.0, limits.tiny, 1, above]
        wide = rng.standard_normal(130)
    else:
        limits = np.iinfo(dtype)
        extremes = [limits.max, limits.max - 1, limits.min, limits.min + 1]
        wide = rng.integers(limits.min, limits.max, 130, dtype, endpoint=True)
    frames = rng.choice(np.array(extremes, dtype), (3, 130))
    frames[0] = wide
    assert_brightest(Median(), frames, monkeypatch)


def test_quantiles_are_the_fractions_that_are_written():
    """⌊(1 − .9)·250000⌋ is 24999 in floats."""
    for at in (0.9, "0.9", "9/10", Fraction(9, 10), np.float64(0.9)):
        assert Quantile(at).ones(250_000) == [25_000]
    assert Levels(7).ones(250_001) == [218_750, 187_500, 156_250, 125_000, 93_750,
                                       62_500, 31_250]  # fmt: skip


def test_few_ties_are_not_warned_of():
    """A tenth of the pixels may tie at the median, half of them at one of several levels."""
    frame = torch.arange(1000, dtype=torch.int32)[None]
    frame[0, 460:559] = 500
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        Median().encode(frame)
        for d in (50, 5000):  # of a value that all become ones none is split
            Median().encode((torch.arange(d) < d // 2)[None].int())
        frame[0, 300:790] = 500
        Levels().encode(frame)
    for share, encoder in ((49, Median()), (59, Levels())):
        frame[0, 790 - 10 * share : 790] = 500
        with pytest.warns(UserWarning, match=f"^{share} % of .*by the order of pixels"):
            encoder.encode(frame)
        with warnings.catch_warnings():  # once
            warnings.simplefilter("error")
            encoder.encode(frame)


def test_constant_frames_are_numbered_from_first():
    frames = torch.zeros(12, 9, dtype=torch.uint8)
    with pytest.warns(UserWarning, match=r"12 constant frame\(s\).* 5, .*13, 14, …:"):
        Median().encode(frames, 5)
    almost = torch.zeros(1, 9, dtype=torch.uint8)
    almost[0, 3] = 1  # the pixel of the cut's other side
    with warnings.catch_warnings():
        warnings.filterwarnings("error", ".*constant frame")
        Median().encode(almost)
        Median().encode(1 - almost)


Z = torch.zeros
REFUSED = [
    *((Z(shape), "frames: expected shape") for shape in ((4,), (1, 2, 3, 4), (3, 0))),
    (np.zeros((2, 3)), "frames: expected a torch tensor, found ndarr"),
    *((Z(2, 3).to(kind), "frames: expected real or integer pixels")
      for kind in (torch.bool, torch.complex64)),
    *((torch.full((1, 4), value, dtype=kind),
       rf"frames\[10\]: expected finite pixels, found {found}")
      for value, found in ((torch.nan, "NaN"), (torch.inf, "inf"), (-torch.inf, "-inf"))
      for kind in (torch.float16, torch.float64)),
]  # fmt: skip


@pytest.mark.parametrize(("frames", "message"), REFUSED)
def test_what_has_no_ranks_is_refused(frames, message):
    with pytest.raises((ValueError, TypeError), match=message):
        Median().encode(frames, 10)
