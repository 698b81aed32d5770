"""Numerics: the reference is exact, and every method is measured against it."""

from fractions import Fraction

import numpy as np
import pytest

from experiments.protocol.experiment import Run
from experiments.studies.limits.numerics import measure


def test_the_exact_mean_is_that_of_rational_correlations():
    # Deviations of these rows are whole numbers: no root has to be rounded.
    frames = np.array([[0, 2, 0, 2], [1, 3, 3, 1], [6, 0, 0, 6]], np.uint8)
    x = [
        [Fraction(int(v)) - Fraction(int(row.sum()), 4) for v in row] for row in frames
    ]
    deviation = [int(row.std()) for row in frames]
    pairs = [
        sum(a * b for a, b in zip(x[i], x[j], strict=True))
        / (4 * deviation[i] * deviation[j])
        for i, j in ((0, 1), (0, 2), (1, 2))
    ]
    assert measure.exact_mean(frames) == float(sum(pairs) / 3)


@pytest.fixture(scope="module")
def rows():
    return list(measure.numerics.rows(Run(), samples=6, pixels=500, repeats=1))


def test_float64_is_within_tolerance_everywhere_and_float32_is_not(rows):
    assert {row["input"] for row in rows} == {
        "phases",
        "8-bit speckle",
        "mean 10⁶ × deviation",
    }
    double = [row for row in rows if row["number"] == "float64"]
    assert all(
        row["error"] < 1e-6 * row["tolerance"] or row["input"] == "phases"
        for row in double
    )
    phases = {
        (r["method"], r["number"]): r["error"] for r in rows if r["input"] == "phases"
    }
    assert (
        phases["to 1e+07 rad", "float32"] > 0.1 > 1e-6 > phases["to 1e+07 rad", "mixed"]
    )
    assert all(row["time_s"] >= 0 for row in rows)
