"""Estimators against scipy and closed forms."""

import math

import numpy as np
import pytest
from scipy.stats import binomtest

from experiments.records.results import Results
from experiments.reporting import estimates
from experiments.reporting.estimates import (
    crossing,
    mean_interval,
    one_ratio,
    one_sensor,
    quartiles,
)


def test_student_interval():
    # t(0.975, 2) = 4.3027
    assert mean_interval([1.0, 2.0, 3.0]) == pytest.approx((2, 2 - 2.4841, 2 + 2.4841), abs=1e-4)
    assert np.isnan(mean_interval([1.0])[1:]).all()


@pytest.mark.parametrize(
    ("n", "accuracy", "expected"),
    [
        ([5, 10, 20], [0.5, 0.8, 1.0], 15),
        ([20, 5, 10], [1.0, 0.5, 0.8], 15),
        ([5, 10], [0.95, 1.0], 5),
        ([5, 10], [0.5, 0.9], math.nan),
        ([5, 10, 20, 40], [0.5, 0.95, 0.7, 0.99], 5 + 5 * 0.4 / 0.45),  # the first time
    ],
)
def test_where_a_curve_crosses(n, accuracy, expected):
    assert crossing(n, accuracy) == pytest.approx(expected, nan_ok=True)


def test_the_interval_of_a_ratio_in_closed_form():
    value, low, high = one_ratio(2.0, [0.0, math.log(2), math.log(4)])
    # Student's t with two degrees of freedom, of one more of three.
    half = 4.302652730 * math.log(2) * math.sqrt(4 / 3)
    assert value == 2
    assert (math.log(low), math.log(high)) == pytest.approx(
        (math.log(2) - half, math.log(2) + half)
    )


@pytest.mark.parametrize("logarithms", [[1.0, 3.0], [1.0, 1.1, math.inf]])
def test_no_interval_of_too_few_or_unreached_ratios(logarithms):
    found = one_ratio(3.0, logarithms)
    assert found.value == 3
    assert np.isnan(found[1:]).all()


def test_quartiles_of_finite_times_are_numpys_and_infinite_ones_count():
    times = [3.0, 1.0, 2.0, 7.0, 5.5]
    assert quartiles(times) == pytest.approx(np.quantile(times, [0.25, 0.5, 0.75]))
    assert quartiles([1.0, math.inf]) == [math.inf] * 3
    assert quartiles([1.0, 2.0, math.inf]) == [1.5, 2.0, math.inf]


def test_one_more_sensor_lies_where_students_law_says():
    # t(0.975, 2)·√(1 + 1/3) = 4.9682; so wide that 95 of 100 further ones are in it.
    assert one_sensor([1.0, 2.0, 3.0]) == pytest.approx((2, 2 - 4.9682, 2 + 4.9682), abs=1e-4)
    assert np.isnan(one_sensor([1.0])[1:]).all()
    rng = np.random.default_rng(0)
    drawn = rng.normal(size=(2000, 6))
    inside = [low <= one[5] <= high for one in drawn for _, low, high in [one_sensor(one[:5])]]
    assert 0.93 < np.mean(inside) < 0.97


def test_accuracies_of_100_percent_have_an_interval(tmp_path, write_run):
    """Nothing spreads over seeds, and 300 of 300 is no proof of 100 %."""
    for seed in range(3):
        write_run("hdc", seed=seed)
    group = Results(tmp_path).group("touch", "hdc")
    assert estimates.share(group)[::2] == (1, 1)
    p = 302 / 304  # two right and two wrong added
    half = 4.302652730 * math.sqrt(p * (1 - p) / 100)
    assert estimates.share(group).low == pytest.approx(1 - half / math.sqrt(3))
    assert estimates.share_of_one_sensor(group).low == pytest.approx(1 - half * math.sqrt(4 / 3))


def test_seeds_are_the_units_of_an_interval(tmp_path, write_run):
    """Wilson's of all samples together was half as wide where sensors differ."""
    for seed, wrong in enumerate((0, 10, 30)):
        write_run("hdc", seed=seed, wrong=range(wrong))
    found = estimates.share(Results(tmp_path).group("touch", "hdc"))
    shares = [1.0, 0.9, 0.7]
    half = 4.302652730 * np.std(shares, ddof=1) / math.sqrt(3)
    assert found == pytest.approx((np.mean(shares), np.mean(shares) - half, 1))


def test_one_seed_has_wilsons_interval(tmp_path, write_run):
    write_run("hdc", wrong=range(3))
    wilson = binomtest(97, 100).proportion_ci(0.95, "wilson")
    found = estimates.share(Results(tmp_path).group("touch", "hdc"))
    assert found == pytest.approx((0.97, wilson.low, wilson.high))


def test_models_differ_seed_by_seed_on_the_same_samples(tmp_path, write_run):
    def found():
        results = Results(tmp_path)
        return estimates.difference(*(results.group("touch", m).runs for m in ("softmax", "hdc")))

    write_run("softmax", wrong=range(4))
    assert found() is None
    write_run("hdc", wrong=[0])
    assert found().share[:1] == pytest.approx((-0.03,))
    assert np.isnan(found().share[1:]).all()
    write_run("softmax", seed=1, wrong=range(2))
    write_run("hdc", seed=1, wrong=range(10))
    each = [-0.03, 0.08]
    half = 12.7062 * np.std(each, ddof=1) / math.sqrt(2)
    assert found().share == pytest.approx((0.025, 0.025 - half, 0.025 + half), abs=1e-4)
    assert (found().above, found().below, len(found().each)) == (1, 1, 2)
    write_run("hdc", seed=2)
    write_run(
        "softmax", seed=2, wrong=range(50), data_sha256={"train": "", "test": "of other frames"}
    )
    assert (found().above, found().below, len(found().each)) == (1, 1, 2)


def test_models_that_agree_on_every_sample_may_differ_on_others(tmp_path, write_run):
    for seed in range(3):
        for model in ("softmax", "hdc"):
            write_run(model, seed=seed)
    results = Results(tmp_path)
    runs = [results.group("touch", model).runs for model in ("softmax", "hdc")]
    share, *_ = estimates.difference(*runs)
    half = 4.302652730 * math.sqrt(1 / 302 / 100 / 3)
    assert share == pytest.approx((0, -half, half))
    assert estimates.mean_difference([0, 0, 0], 100) == share


def test_where_models_disagree_at_least_is_what_they_differ_by():
    half = 12.7062 * math.sqrt((4 + 1) / 202 / 100 / 2)  # 2 and 2 of 100 samples
    found = estimates.mean_difference([0.02, 0.02], 100)
    assert found == pytest.approx((0.02, 0.02 - half, 0.02 + half), abs=1e-4)
