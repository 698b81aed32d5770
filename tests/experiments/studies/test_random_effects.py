"""The estimate across laboratories: a published example, its definition, how often it holds."""

import math

import numpy as np
import pytest
from scipy import stats
from statsmodels.stats.meta_analysis import combine_effects

from experiments.studies.claims.random_effects import of_laboratory, random_effects


def log_odds_ratios():
    """Six trials of aspirin, with the low-dose CLASP: events and subjects, treated and control."""
    events = np.array([5, 5, 12, 69, 9, 313.0])
    subjects = np.array([156, 303, 565, 1570, 103, 4659.0])
    control = np.array([8, 17, 9, 94, 11, 352.0])
    controls = np.array([74, 303, 477, 1565, 105, 4650.0])
    odds = events / (subjects - events)
    of_control = control / (controls - control)
    variance = (
        1 / events + 1 / (subjects - events) + 1 / control + 1 / (controls - control)
    )
    return np.log(odds / of_control), variance


def test_a_published_example_comes_out():
    """DerSimonian and Kacker, Contemp. Clin. Trials 28, 105 (2007), Tables 3 and 4: two-sided
    Paule–Mandel, tau 0.3681, mean −0.3811, standard error 0.2060; as in metafor's tests, too."""
    found = random_effects(*log_odds_ratios())
    assert found.units == 6
    assert math.sqrt(found.between) == pytest.approx(0.3681, abs=5e-5)
    assert found.mean.value == pytest.approx(-0.3811, abs=5e-5)
    half = found.mean.high - found.mean.value
    assert half / stats.t.ppf(0.975, 5) == pytest.approx(0.2060, abs=5e-5)
    around = stats.t.ppf(0.975, 4) * math.sqrt(0.3681**2 + 0.2060**2)
    assert found.predicted_low == pytest.approx(-0.3811 - around, abs=1e-3)
    assert found.predicted_high == pytest.approx(-0.3811 + around, abs=1e-3)


@pytest.mark.parametrize("scale", [1e-4, 1.0, 1e3])
def test_the_estimate_solves_its_equation_whatever_the_unit(scale):
    y, v = log_odds_ratios()
    found = random_effects(scale * y, scale**2 * v)
    weights = 1 / (scale**2 * v + found.between)
    q = weights @ (scale * y - found.mean.value) ** 2
    assert q == pytest.approx(len(y) - 1, rel=1e-6)


@pytest.mark.parametrize("seed", range(5))
def test_statsmodels_has_the_same_mean_and_variance_between(seed):
    rng = np.random.default_rng(seed)
    variances = rng.uniform(0.5, 1.5, 7)
    values = rng.normal(0, np.sqrt(variances + 3 * seed))
    theirs = combine_effects(values, variances, method_re="iterated", use_t=True)
    found = random_effects(values, variances)
    assert found.between == pytest.approx(theirs.tau2, abs=1e-4)
    assert found.mean.value == pytest.approx(theirs.mean_effect_re, abs=1e-4)
    assert found.mean.high - found.mean.value >= (
        stats.t.ppf(0.975, 6) * theirs.sd_eff_w_re_hksj - 1e-4
    )


def test_laboratories_that_agree_by_chance_do_not_narrow_the_interval():
    """The floor: without it the interval of equal numbers would have no width."""
    found = random_effects([0.1, 0.1, 0.1, 0.1], [0.01] * 4)
    half = stats.t.ppf(0.975, 3) * math.sqrt(0.01 / 4)
    assert found.between == 0
    assert found.mean == pytest.approx((0.1, 0.1 - half, 0.1 + half))
    assert found.predicted_high - 0.1 == pytest.approx(
        stats.t.ppf(0.975, 2) * math.sqrt(0.01 / 4)
    )


def test_with_two_laboratories_nothing_is_predicted_and_with_one_nothing_is_joined():
    two = random_effects([0.1, 0.2], [0.01, 0.01])
    assert math.isnan(two.predicted_low)
    assert math.isnan(two.predicted_high)
    assert two.mean.low < two.mean.value < two.mean.high
    one = random_effects([0.1], [0.01])
    assert one.mean == pytest.approx((0.1, 0.1 - 0.196, 0.1 + 0.196), abs=1e-3)
    assert math.isnan(one.predicted_low)


@pytest.mark.parametrize("bad", [([], []), ([0.1], [0.0]), ([0.1, 0.2], [0.1])])
def test_what_has_no_variance_is_refused(bad):
    with pytest.raises(ValueError, match="variances above zero"):
        random_effects(*bad)


def test_sensors_of_a_laboratory_count_as_one():
    assert of_laboratory([0.1, 0.3], [0.01, 0.05]) == pytest.approx((0.2, 0.03 / 2))
    assert of_laboratory([0.1, 0.9], [0.01, 0.05]) == pytest.approx((0.5, 0.32 / 2))
    assert of_laboratory([0.1], [0.04]) == pytest.approx((0.1, 0.04))
