"""Intervals over seeds and over draws."""

import math

import numpy as np
import pandas as pd
import pytest

from experiments.reporting.measured import LEAST_RESAMPLES, accuracies, over_units


def test_fewer_draws_than_ten_have_a_mean_and_no_interval():
    draws = np.linspace(0, 1, LEAST_RESAMPLES).tolist()
    enough = over_units(draws, seeds=False)
    assert (enough.value, enough.low, enough.high) == pytest.approx((0.5, 0.025, 0.975))
    few = over_units(draws[1:], seeds=False)
    assert few.value == pytest.approx(5 / 9)
    assert math.isnan(few.low)
    assert math.isnan(few.high)


def test_seeds_have_the_interval_of_student_however_few():
    found = over_units([0.4, 0.6], seeds=True)
    half = 12.7062 * math.sqrt(0.02 / 2)
    assert found.low == pytest.approx(0.5 - half, rel=1e-4)
    assert found.high == pytest.approx(0.5 + half, rel=1e-4)


@pytest.mark.parametrize(("origin", "units"), [("computed", 2), ("measured", 6)])
def test_seeds_are_units_where_each_has_another_sensor(origin, units):
    """Of a camera's recording they draw other frames, as resamples do."""
    rows = pd.DataFrame(
        {"origin": origin, "seed": seed, "draw": draw, "split": "counts", "model": "hdc",
         "n": [5], "right": [seed + draw], "n_test": 10}
        for seed in (3, 7)
        for draw in range(3)
    )  # fmt: skip
    found = accuracies(rows)
    assert found.unit.nunique() == len(found) == units
    assert found.accuracy.mean() == pytest.approx(0.6)
