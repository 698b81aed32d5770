"""The read-out of HDC's bits: the bits are HDC's, the weights are scikit-learn's."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from sklearn.linear_model import RidgeClassifier

from baselines import linear_bits
from baselines.linear_bits import BitReadout, halves
from hdc import HDCClassifier
from hdc.bits import unpack
from hdc.encode import encode


@pytest.mark.parametrize("shape", [(1, 2), (1, 7), (9, 8), (5, 13), (40, 50)])
@pytest.mark.filterwarnings("ignore:.*constant frame")
@pytest.mark.parametrize("levels", [1, 2, 5, 256])
def test_the_bits_are_those_of_hdc(shape, levels):
    rng = np.random.default_rng(levels)
    frames = torch.from_numpy(rng.integers(0, levels, (6, *shape)).astype(np.uint8))
    theirs = unpack(encode(frames), shape[0] * shape[1])
    assert (halves(frames) == theirs.bool()).all()
    assert (halves(300 * frames.int()) == theirs.bool()).all()


@pytest.mark.parametrize("block", [1, 4, 4096])
def test_weights_are_those_of_scikit_learn_on_unpacked_bits(speckle, monkeypatch, block):
    monkeypatch.setattr(linear_bits, "BYTES", block)
    frames, labels = speckle(30, (9, 7), 3)
    x = 2.0 * halves(frames).numpy() - 1
    ours = BitReadout(alpha=0.3).fit(frames, labels)
    theirs = RidgeClassifier(alpha=0.3).fit(x, labels)
    np.testing.assert_allclose(ours.weight_, theirs.coef_, rtol=1e-4, atol=1e-5)
    np.testing.assert_allclose(
        ours.scores(frames), theirs.decision_function(x), rtol=1e-4, atol=1e-4
    )
    with pytest.raises(ValueError, match="alpha: expected a number above zero, found 0"):
        BitReadout(alpha=0.0).fit(frames, labels)


def test_one_bit_a_weight_is_the_nearest_such_read_out(speckle):
    frames, labels = speckle(40, (9, 7), 4)
    whole = BitReadout().fit(frames, labels)
    signs = BitReadout(one_bit=True).fit(frames, labels)
    x = 2.0 * halves(frames).numpy() - 1
    w = whole.weight_.numpy()
    nearest = np.abs(w).mean(1, keepdims=True) * np.sign(w)
    y = 2.0 * (labels[:, None] == np.arange(4)) - 1
    expected = (x - x.mean(0)) @ nearest.T + y.mean(0)
    np.testing.assert_allclose(signs.scores(frames), expected, rtol=1e-4, atol=1e-4)
    assert signs.score(frames, labels) > 0.9


def test_it_has_the_size_of_hdc_and_eight_bytes_a_class(speckle):
    frames, labels = speckle(30, (16, 16), 3)

    def size(model):
        return sum(t.nbytes for t in model.fit(frames, labels).state_tensors().values())

    assert size(BitReadout(one_bit=True)) == size(HDCClassifier()) + 8 * 3
    assert size(BitReadout()) == 4 * 3 * (256 + 1)
