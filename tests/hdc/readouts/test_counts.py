"""Integer prototypes against floats."""

import math

import numpy as np
import pytest
import torch

from hdc import bits
from hdc.prototypes import Counters
from hdc.readouts import Counts
from hdc.readouts.counts import cosines
from tests.hdc.own import fitted


def test_a_larger_class_is_compared_as_its_subsets_are_on_average():
    """‖sum of a random subset‖², by all subsets of the size of the smallest class."""
    rng = np.random.default_rng(0)
    x = np.where(rng.random((8, 300)) < rng.random(300), 1.0, -1.0)
    rows = torch.tensor([0] * 5 + [1] * 3)
    words = bits.pack(torch.from_numpy(x > 0))
    model = fitted(Counts(class_weight="balanced"), words, rows, 2, 300)
    subsets = [(i, j, k) for i in range(5) for j in range(i) for k in range(j)]
    squares = [(x[list(subset)].sum(0) ** 2).sum() for subset in subsets]
    means = np.stack([x[:5].mean(0) * 3, x[5:].sum(0)])
    lengths = np.sqrt([np.mean(squares), (x[5:].sum(0) ** 2).sum()])
    np.testing.assert_allclose(model.scores(words), x @ means.T / lengths / 300**0.5)


@pytest.mark.parametrize("d", [1, 64, 1000])
def test_the_largest_counts_are_exact_and_larger_ones_refused(d):
    """2⁶⁰ samples times pixels, less one sample, against Python integers."""
    least = 2**60 // d  # that are refused
    n = least - 1
    rng = np.random.default_rng(d)
    ones = rng.integers(0, n, d, endpoint=True)
    ones[0] = n
    counters = Counters(1, d)._of_counts([torch.from_numpy(ones)], torch.tensor([n]))
    signs = np.where(rng.random((5, d)) < 0.5, 1, -1)
    signs[:2] = [[1], [-1]]
    words = bits.pack(torch.from_numpy(signs > 0))
    sums = 2 * ones.astype(object) - n
    products = signs.astype(object) @ sums
    expected = [product / math.sqrt(sums @ sums) for product in products]
    found = cosines(counters, words)[:, 0]
    np.testing.assert_allclose(found, expected, rtol=1e-14)
    counters.n[0] = least
    with pytest.raises(ValueError, match=f"counters: expected .* found {least}$"):
        cosines(counters, words)
