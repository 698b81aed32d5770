"""Frames relative to a reference: against Python's integers and fractions."""

from __future__ import annotations

from fractions import Fraction
from math import floor, isqrt

import numpy as np
import pytest
import torch

from hdc import HDCClassifier, bits
from hdc.encoders import Levels, Quantile, Reference
from hdc.encoders.relative import standardised


def as_integers(frame: np.ndarray) -> list[int]:
    """Pixels as integers; those of floats less the middle, scaled to 18 bits by the largest."""
    values = [Fraction(x) for x in frame.ravel().tolist()]
    if frame.dtype.kind in "iu" and frame.dtype.itemsize <= 2:
        return [int(value) for value in values]
    low, high = min(frame.ravel().tolist()), max(frame.ravel().tolist())
    middle = low / 2 + high / 2
    values = [Fraction(x - middle) for x in frame.ravel().tolist()]
    _, exponent = np.frexp(max(abs(float(value)) for value in values))
    scale = Fraction(2) ** (18 - int(exponent))
    return [round(value * scale) for value in values]  # halves to even, as IEEE rounds


def plainly(frame: np.ndarray) -> list[int]:
    """(x − mean)/std in steps of 2⁻¹⁶, rounded down."""
    pixels = as_integers(frame)
    n, total = len(pixels), sum(pixels)
    deviation = max(1, isqrt(n * sum(x * x for x in pixels) - total**2))
    return [floor(Fraction((n * x - total) << 16, deviation)) for x in pixels]


DTYPES = ["uint8", "int8", "uint16", "int16", "int32", "float32", "float64"]


@pytest.mark.parametrize(
    ("d", "dtype"),
    [
        (1, "uint8"),
        (4097, "uint8"),
        *((d, kind) for d in (2, 65) for kind in DTYPES),
    ],
)
def test_standardised_frames_are_those_of_integers(d, dtype, kinds_of_frames):
    frames = kinds_of_frames(d, dtype)
    found = standardised(torch.from_numpy(frames))
    assert found.dtype == torch.int32
    assert found.tolist() == [plainly(frame) for frame in frames]


@pytest.mark.parametrize("size", [1e-310, 1e-200, 1e-40, 1e45, 1e300])
def test_floats_of_any_size_are_standardised_alike(size):
    frames = np.random.default_rng(0).normal(0, 1, (3, 99)) * size
    frames[:, 0] = 0
    found = standardised(torch.from_numpy(frames))
    assert found.tolist() == [plainly(frame) for frame in frames]
    assert found.any(1).all()
    dark = np.abs(frames)
    found = standardised(torch.from_numpy(dark))
    assert found.tolist() == [plainly(frame) for frame in dark]


def test_the_largest_numbers_stay_whole():
    """16-bit frames of 500 × 500 of two values: D·x·2¹⁶ is near 2⁵³."""
    frame = np.zeros((1, 250_000), np.uint16)
    frame[0, ::3] = 65_535
    frame[0, 0] = 65_534
    found = standardised(torch.from_numpy(frame))[0]
    expected = plainly(frame[0])
    assert found.tolist() == expected
    assert min(expected) < 0 < max(expected)


def test_constant_frames_are_zero_and_named():
    frames = torch.full((3, 8), 5, dtype=torch.uint8)
    assert not standardised(frames).any()
    rng = np.random.default_rng(0)
    train = torch.from_numpy(rng.integers(0, 200, (40, 8)).astype(np.uint8))
    encoder = Reference().fit(train)
    train[37] = 9
    with pytest.warns(UserWarning, match=r"1 constant frame\(s\), at index 137:"):
        encoder.encode(train, 100)


@pytest.mark.parametrize("base", ["median", Quantile("3/4"), Levels(3)])
def test_words_are_those_of_the_differences(base, brightest):
    """More frames than are encoded at a time; the reference is rounded down."""
    rng = np.random.default_rng(1)
    frames = rng.integers(0, 256, (37, 13, 7)).astype(np.uint8)
    encoder = Reference(base).fit(frames)
    rows = [plainly(frame) for frame in frames]
    reference = [sum(column) // 37 for column in zip(*rows, strict=True)]
    assert encoder.reference_.tolist() == reference
    differences = np.array(rows) - np.array(reference)
    words = encoder.encode(torch.from_numpy(frames))
    assert torch.equal(words, encoder.base_.encode(torch.from_numpy(differences)))
    if base == "median":
        found = bits.unpack(words, 91).numpy()
        assert np.array_equal(found, brightest(differences))


def test_a_given_frame_is_the_reference(tmp_path):
    rng = np.random.default_rng(3)
    frames = rng.integers(0, 256, (20, 6, 9)).astype(np.uint8)
    labels = np.arange(20) % 2
    given = rng.integers(0, 256, (6, 9)).astype(np.uint8)
    model = HDCClassifier(Reference(frame=given)).fit(frames, labels)
    assert model.encoder_.reference_.tolist() == plainly(given)
    model.save(tmp_path / "m")
    loaded = HDCClassifier.load(tmp_path / "m")
    before = loaded.distances(frames)
    assert np.array_equal(before, model.distances(frames))
    with pytest.raises(ValueError, match="frame: expected the reference frame that"):
        loaded.fit(frames, labels)
    assert np.array_equal(loaded.distances(frames), before)
    loaded.save(tmp_path / "again")
    assert (tmp_path / "again").read_bytes() == (tmp_path / "m").read_bytes()
    merged = HDCClassifier(Reference(frame=given)).fit(frames[::-1], labels)
    assert merged.merge(loaded).counts_.tolist() == [20, 20]
    for other in (given.T, given[None, :5], given[None][:0], given[0, 0]):
        message = r"frame: expected a reference of shape \(6, 9\), or several, found \("
        with pytest.raises(ValueError, match=message):
            HDCClassifier(Reference(frame=other)).fit(frames, labels)


@pytest.mark.parametrize(
    "turned",
    [np.flipud, lambda frame: frame.astype(">f4"), np.ndarray.tolist, torch.from_numpy],
    ids=["mirrored", "of another byte order", "a list", "a tensor"],
)
def test_a_given_frame_may_be_any_that_is_predicted(turned):
    frames = np.random.default_rng(3).integers(0, 256, (4, 6, 9)).astype(np.uint8)
    given = turned(frames[0])
    plain = np.array(given, order="C")
    plain = torch.from_numpy(plain.astype(plain.dtype.newbyteorder("=")))
    expected = standardised(plain[None])[0]
    assert torch.equal(Reference(frame=given).fit(frames).reference_, expected)


def test_of_several_given_frames_the_standardised_mean_is_the_reference():
    """Frames of very different brightness and contrast count alike; one as it counts alone."""
    rng = np.random.default_rng(5)
    frames = rng.integers(0, 256, (20, 6, 9)).astype(np.uint8)
    dimmed = np.array([1, 8, 64])[:, None, None]
    given = (rng.integers(0, 256, (3, 6, 9)) // dimmed).astype(np.uint8)
    rows = [plainly(frame) for frame in given]
    for n, expected in ((3, [sum(column) // 3 for column in zip(*rows, strict=True)]),
                        (1, rows[0])):  # fmt: skip
        found = Reference(frame=given[:n]).fit(frames)
        assert found.reference_.tolist() == expected
        assert found.zero(given[:n]).reference_.tolist() == expected


def test_a_frame_that_cannot_be_a_reference_is_numbered():
    frames = np.random.default_rng(4).integers(0, 256, (20, 50)).astype(float)
    encoder = Reference().fit(frames)
    frames[17, 3] = np.nan
    with pytest.raises(ValueError, match=r"frames\[17\]: expected finite pixels"):
        encoder.zero(frames)
