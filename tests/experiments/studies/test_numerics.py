"""Numerics: the reference is exact, and every method is measured against it."""

from fractions import Fraction
from itertools import combinations

import numpy as np

from experiments.protocol.task import Context
from experiments.studies.limits.numerics import measure


def test_the_exact_mean_is_that_of_rational_correlations():
    # Deviations of these rows are whole numbers: no root has to be rounded.
    frames = np.array([[0, 2, 0, 2], [1, 3, 3, 1], [6, 0, 0, 6]])
    pairs = []
    for a, b in combinations(frames, 2):
        covariance = ((a - a.mean()) * (b - b.mean())).sum()
        pairs.append(Fraction(covariance) / int(4 * a.std() * b.std()))
    assert measure.exact_mean(frames.astype(np.uint8)) == float(sum(pairs) / 3)


def test_float64_is_within_tolerance_everywhere_and_float32_is_not():
    rows = list(measure.Numerics(samples=6, pixels=500, repeats=1).rows(Context()))
    errors = {}
    for row in rows:
        errors[row["input"], row["method"], row["number"]] = row["error"]
        assert row["time_s"] >= 0
        if row["number"] == "float64" and row["input"] != "phases":
            assert row["error"] < 1e-6 * row["tolerance"]
    inputs = {"phases", "8-bit speckle", "mean 10⁶ × deviation"}
    assert {row["input"] for row in rows} == inputs
    assert errors["phases", "to 1e+07 rad", "float32"] > 0.1
    assert errors["phases", "to 1e+07 rad", "mixed"] < 1e-6
