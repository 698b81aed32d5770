"""Numerics: the reference is exact, and every method is measured against it."""

from fractions import Fraction
from itertools import combinations

import numpy as np

from experiments.studies.limits.numerics import measure


def test_the_exact_mean_is_that_of_rational_correlations():
    # Deviations of these rows are whole numbers: no root has to be rounded.
    frames = np.array([[0, 2, 0, 2], [1, 3, 3, 1], [6, 0, 0, 6]])
    pairs = []
    for a, b in combinations(frames, 2):
        covariance = ((a - a.mean()) * (b - b.mean())).sum()
        pairs.append(Fraction(covariance) / int(4 * a.std() * b.std()))
    assert measure.exact_mean(frames.astype(np.uint8)) == float(sum(pairs) / 3)
