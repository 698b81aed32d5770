"""Numbers of the nearest frames, against plain loops."""

import numpy as np
import pytest
import torch

from hdc import bits
from hdc.hypervectors import Hypervectors
from hdc.readouts import NeighbourValues
from tests.hdc.own import fitted


def plain_means(distances, values, k):
    """The mean of the k nearest rows for each query; of equal ones the first."""
    means = []
    for row in distances.tolist():
        nearest = sorted(range(len(row)), key=row.__getitem__)[:k]
        means.append(np.mean([values[i] for i in nearest], axis=0))
    return np.array(means)


@pytest.mark.parametrize("k", [1, 2, 5, 11])
def test_means_and_left_out_means_by_plain_loops(k, monkeypatch):
    monkeypatch.setattr("hdc.readouts.values._ROWS", 5)  # frames compared at a time
    rng = np.random.default_rng(k)
    words = torch.from_numpy(rng.integers(0, 2**40, (12, 1)))
    queries = torch.from_numpy(rng.integers(0, 2**40, (30, 1)))
    values = rng.normal(size=(12, 2))
    model = fitted(NeighbourValues(k), words, torch.from_numpy(values), 40)
    distances = bits.hamming(queries, words).numpy()
    expected = plain_means(distances, values, k)
    asked = Hypervectors(queries, 40)
    np.testing.assert_allclose(model.readout.values(model.state, asked), expected)
    centre, without = model.readout.without(model.state, asked)
    np.testing.assert_allclose(centre, expected)
    own = bits.hamming(words, words).numpy()
    for i in range(12):
        rest = np.arange(12) != i
        left = plain_means(distances[:, rest], values[rest], k)
        np.testing.assert_allclose(without[:, i], left)
        missed = values[i] - plain_means(own[i : i + 1, rest], values[rest], k)[0]
        np.testing.assert_allclose(model.residuals_[i], missed)


def test_as_many_neighbours_as_frames_are_refused():
    words = torch.arange(3)[:, None]
    with pytest.raises(ValueError, match="fewer than the 3 training frames, found 3"):
        fitted(NeighbourValues(3), words, torch.ones(3, 1).double(), 64)
