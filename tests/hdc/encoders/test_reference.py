"""Frames relative to a reference: against Python's integers and fractions."""

from fractions import Fraction
from math import floor, isqrt

import numpy as np
import pytest
import torch

from hdc import HDCClassifier
from hdc.encoders import Levels, Reference
from hdc.encoders.relative import standardised
from tests.hdc.own import BACKENDS, by


def as_integers(frame):
    """Pixels as integers; those of floats less the middle, scaled to 18 bits by the largest."""
    if frame.dtype.kind in "iu" and frame.dtype.itemsize <= 2:
        return frame.ravel().tolist()
    pixels = frame.ravel().tolist()
    middle = min(pixels) / 2 + max(pixels) / 2
    values = [x - middle for x in pixels]
    _, exponent = np.frexp(max(abs(float(value)) for value in values))
    scale = Fraction(2) ** (18 - int(exponent))
    # Halves to even, as IEEE rounds.
    return [round(Fraction(value) * scale) for value in values]


def plainly(frame):
    """(x − mean)/std in steps of 2⁻¹⁶, rounded down."""
    pixels = as_integers(frame)
    n, total = len(pixels), sum(pixels)
    deviation = max(1, isqrt(n * sum(x * x for x in pixels) - total**2))
    return [floor(Fraction((n * x - total) << 16, deviation)) for x in pixels]


def mean_of(frames):
    """The mean of standardised frames, rounded down."""
    rows = [plainly(frame) for frame in frames]
    return [sum(column) // len(rows) for column in zip(*rows, strict=True)]


DTYPES = ["uint8", "int8", "uint16", "int16", "int32", "float32", "float64"]


@pytest.mark.parametrize(
    ("d", "dtype"),
    [
        (1, "uint8"),
        (4097, "uint8"),
        *((d, kind) for d in (2, 65) for kind in DTYPES),
    ],
)
@pytest.mark.parametrize("backend", BACKENDS)
def test_standardised_frames_are_those_of_integers(backend, d, dtype, kinds_of_frames):
    frames = kinds_of_frames(d, dtype)
    found = by(backend, standardised, torch.from_numpy(frames))
    assert found.dtype == torch.int32
    assert found.tolist() == [plainly(frame) for frame in frames]


@pytest.mark.parametrize("size", [1e-310, 1e-200, 1e-40, 1e45, 1e300])
def test_floats_of_any_size_are_standardised_alike(size):
    frames = np.random.default_rng(0).normal(0, 1, (3, 99)) * size
    frames[:, 0] = 0
    for given in (frames, np.abs(frames)):
        found = standardised(torch.from_numpy(given))
        assert found.tolist() == [plainly(frame) for frame in given]
        assert found.any(1).all()


def test_the_largest_numbers_stay_whole():
    """16-bit frames of 500 × 500 of two values: D·x·2¹⁶ is near 2⁵³."""
    frame = np.zeros((1, 250_000), np.uint16)
    frame[0, ::3] = 65_535
    frame[0, 0] = 65_534
    found = standardised(torch.from_numpy(frame))[0]
    assert found.tolist() == plainly(frame[0])


def test_constant_frames_are_numbered():
    rng = np.random.default_rng(0)
    train = torch.from_numpy(rng.integers(0, 200, (40, 8)).astype(np.uint8))
    encoder = Reference().fit(train)
    train[37] = 9
    with pytest.warns(UserWarning, match=r"1 constant frame\(s\), at index 137:"):
        encoder.encode(train, 100)


@pytest.mark.parametrize("base", ["median", Levels(3)])
def test_words_are_those_of_the_differences(base):
    frames = np.random.default_rng(1).integers(0, 256, (37, 13, 7)).astype(np.uint8)
    encoder = Reference(base).fit(frames)
    reference = mean_of(frames)
    assert encoder.reference_.tolist() == reference
    differences = np.array([plainly(frame) for frame in frames]) - np.array(reference)
    words = encoder.encode(torch.from_numpy(frames))
    assert torch.equal(words, encoder.base_.encode(torch.from_numpy(differences)))


def test_a_given_frame_is_the_reference(tmp_path):
    """A file does not keep it; of several it is the mean, however bright they are."""
    rng = np.random.default_rng(3)
    frames = rng.integers(0, 256, (20, 6, 9)).astype(np.uint8)
    labels = np.arange(20) % 2
    dimmed = np.array([1, 8, 64])[:, None, None]
    several = (rng.integers(0, 256, (3, 6, 9)) // dimmed).astype(np.uint8)
    for given in (several[0], several[:1], several):
        model = HDCClassifier(Reference(frame=given)).fit(frames, labels)
        expected = mean_of(given.reshape(-1, 6, 9))
        assert model.encoder_.reference_.tolist() == expected
    model.save(tmp_path / "m")
    loaded = HDCClassifier.load(tmp_path / "m")
    before = loaded.distances(frames)
    assert np.array_equal(before, model.distances(frames))
    with pytest.raises(ValueError, match="frame: expected the reference frame that"):
        loaded.fit(frames, labels)
    assert np.array_equal(loaded.distances(frames), before)
    for other in (given[0].T, given[:, :5], given[:0], given[0, 0]):
        message = r"frame: expected a reference of shape \(6, 9\), or several, found \("
        with pytest.raises(ValueError, match=message):
            HDCClassifier(Reference(frame=other)).fit(frames, labels)
