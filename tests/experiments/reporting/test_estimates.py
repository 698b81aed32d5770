"""Estimators against scipy and closed forms."""

import math

import numpy as np
import pytest
from scipy.stats import binomtest

from experiments.records.results import Results
from experiments.reporting import estimates
from experiments.reporting.estimates import crossing, mean_interval, median_time, quartiles


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


def test_interval_of_times_in_closed_form():
    middle, low, high = median_time([1.0, 2.0, 4.0])
    half = 4.302652730 * math.log(2) / math.sqrt(3)  # Student's t with two degrees of freedom
    assert middle == 2
    assert (math.log(low), math.log(high)) == pytest.approx(
        (math.log(2) - half, math.log(2) + half)
    )


@pytest.mark.parametrize(("times", "middle"), [([1.0, 3.0], 2), ([1.0, 1.1, math.inf], 1.1)])
def test_no_interval_of_too_few_or_unreached_times(times, middle):
    found = median_time(times)
    assert found.value == middle
    assert np.isnan(found[1:]).all()


def test_quartiles_of_finite_times_are_numpys_and_infinite_ones_count():
    times = [3.0, 1.0, 2.0, 7.0, 5.5]
    assert quartiles(times) == pytest.approx(np.quantile(times, [0.25, 0.5, 0.75]))
    assert quartiles([1.0, math.inf]) == [math.inf] * 3
    assert quartiles([1.0, 2.0, math.inf]) == [1.5, 2.0, math.inf]


def test_the_share_of_all_seeds_has_wilsons_interval(tmp_path, write_run):
    for seed in range(3):
        write_run("hdc", seed=seed, wrong=range(seed))
    found = estimates.share(Results(tmp_path).group("touch", "hdc"))
    wilson = binomtest(297, 300).proportion_ci(0.95, "wilson")
    assert found == pytest.approx((297 / 300, wilson.low, wilson.high))


def test_mcnemar_is_exact_on_the_same_samples(tmp_path, write_run):
    def p_value():
        results = Results(tmp_path)
        runs = [results.group("touch", model).runs for model in ("softmax", "hdc")]
        return estimates.mcnemar(*runs)

    write_run("softmax", wrong=[0, 1, 2, 3])
    assert p_value() is None
    write_run("hdc", wrong=[0])
    write_run("softmax", seed=1, wrong=[0, 1, 2, 3])
    write_run("hdc", seed=1, wrong=[0])
    assert p_value() == pytest.approx(binomtest(0, 6).pvalue)  # 3 a seed, HDC alone right
    write_run("hdc", seed=2)
    write_run(
        "softmax", seed=2, wrong=range(50), data_sha256={"train": "", "test": "of other frames"}
    )
    assert p_value() == pytest.approx(binomtest(0, 6).pvalue)
