"""Intervals over seeds and over draws."""

import math

import numpy as np
import pytest

from experiments.reporting.measured import LEAST_RESAMPLES, over_units


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
