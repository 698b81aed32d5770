"""What once answered silently wrong, or not at all: refused, or right."""

import numpy as np
import pytest
import torch

from hdc import HDCClassifier, HDCRegressor, bits
from hdc.encoders import Levels, Median, Reference
from hdc.readouts.values import NeighbourValues

X = np.random.default_rng(0).integers(0, 255, (12, 8, 8)).astype("u1")
Y = [0, 1] * 6


@pytest.mark.parametrize("call", [bits.popcount, bits.count_ones])
def test_words_of_another_type_are_refused(call):
    with pytest.raises(TypeError, match="expected packed words of int64, found int32"):
        call(torch.zeros(2, 3, dtype=torch.int32))


def test_distances_of_words_of_another_type_are_refused():
    words = torch.zeros(2, 3, dtype=torch.int64)
    with pytest.raises(TypeError, match="hamming: expected packed words of int64"):
        bits.hamming(words, words.double())


@pytest.mark.parametrize("encoder", [Median("sprad"), Levels(3, ties="sprad")])
@pytest.mark.parametrize("dtype", [torch.uint8, torch.float32])
def test_an_unknown_rule_of_ties_is_refused_by_every_route(encoder, dtype):
    with pytest.raises(ValueError, match=r"ties: expected .*spread.*'sprad'"):
        encoder.encode(torch.from_numpy(X).to(dtype))


def test_an_encoder_says_that_it_takes_tensors():
    with pytest.raises(
        TypeError, match="frames: expected a torch tensor, found ndarray"
    ):
        Median().encode(X)


def test_a_reference_of_dark_frames_with_a_zero_is_that_of_brighter_ones():
    frames = (
        torch.rand(6, 9, 9, generator=torch.Generator().manual_seed(0)).double() / 4
    )
    frames[:, 0, 0] = 0.0
    dark = Reference().fit(frames).encode(frames)
    bright = frames * 2**6  # by a power of two: the same mantissas
    assert torch.equal(dark, Reference().fit(bright).encode(bright))


@pytest.mark.parametrize("k", [4, 5, 100])
def test_as_many_neighbours_as_frames_are_all_of_them(k):
    values = np.array([1.0, 2.0, 4.0, 9.0])
    model = HDCRegressor(readout=NeighbourValues(k)).fit(X[:4], values)
    assert model.predict(X[4:6]) == pytest.approx([4.0, 4.0])
    three = HDCRegressor(readout=NeighbourValues(3)).fit(X[:4], values)
    assert not np.allclose(three.predict(X[4:6]), 4.0)
    # Without one of the four, the mean of the other three.
    _, without = model.readout_.without(model.encoder_.encode(torch.from_numpy(X[4:5])))
    assert without[0, :, 0].tolist() == pytest.approx([5.0, 14 / 3, 4.0, 7 / 3])


def test_a_loaded_model_does_not_live_on_its_file(tmp_path):
    path = tmp_path / "model"
    HDCClassifier().fit(X, Y).save(path)
    loaded = HDCClassifier.load(path)
    before = loaded.predict(X)
    with path.open("r+b") as file:
        file.truncate(16)
    assert (loaded.predict(X) == before).all()


@pytest.mark.parametrize("metadata", [{1: "a", "1": "b"}, {"a": [{2: 0}]}])
def test_metadata_whose_keys_would_become_one_are_refused_before_writing(
    metadata, tmp_path
):
    with pytest.raises(TypeError, match=r"metadata: .*keys must be texts, not"):
        HDCClassifier().fit(X, Y).save(tmp_path / "model", metadata=metadata)
    assert not (tmp_path / "model").exists()


@pytest.mark.parametrize("readout", ["majority", "ridge", "neighbours"])
def test_a_recalibration_without_frames_of_a_class_warns(readout):
    model = HDCClassifier(readout=readout).fit(X, ["a", "b", "c"] * 4)
    with pytest.warns(
        UserWarning, match="recalibrate: no new frames of 'b', 'c'; where"
    ):
        model.recalibrate(X[::3], ["a"] * 4)
