"""Estimators against scipy, closed forms, and simulations where the truth is known."""

import math

import numpy as np
import pytest
from scipy.stats import binomtest

from experiments.records.results import RUNS, Results
from experiments.reporting import estimates
from experiments.reporting.estimates import mean_difference, mean_interval

T1, T2 = 12.70620474, 4.302652730  # Student's t(0.975) with 1 and 2 degrees of freedom


def approx(*values):
    return pytest.approx(values, abs=1e-6, nan_ok=True)


def test_student_intervals_of_the_mean_and_of_one_more_sensor():
    for estimate, half in (
        (mean_interval, T2 / math.sqrt(3)),
        (estimates.one_sensor, T2 * math.sqrt(4 / 3)),
    ):
        assert estimate([1.0, 2.0, 3.0]) == approx(2, 2 - half, 2 + half)
        assert estimate([1.0]) == approx(1, math.nan, math.nan)


def wilson(right):
    found = binomtest(right, 100).proportion_ci(0.95, "wilson")
    return right / 100, found.low, found.high


@pytest.mark.parametrize("differences", [[-1.0, -0.2, -0.9], [1.0, 0.2, 0.9]])
def test_an_interval_of_differences_ends_where_differences_of_shares_do(differences):
    found = mean_difference(differences, 100, 100 * sum(map(abs, differences)))
    assert -1 in found[1:] or 1 in found[1:]


# Of runs ------------------------------------------------------------------------------------------


@pytest.fixture
def of_model(tmp_path):
    """of_model(name) → the lines of its runs in tmp_path."""

    def lines(model):
        runs = Results(tmp_path).frame(RUNS)
        return runs[runs.model == model]

    return lines


def test_100_percent_of_all_samples_has_an_interval(of_model, write_run):
    for seed in range(3):
        write_run("hdc", seed=seed)
    p = 302 / 304  # two right and two wrong added
    half = T2 * math.sqrt(p * (1 - p) / 100)
    runs = of_model("hdc")
    assert estimates.share(runs) == approx(1, 1 - half / math.sqrt(3), 1)
    sensor = estimates.share_of_one_sensor(runs)
    assert sensor.low == pytest.approx(1 - half * math.sqrt(4 / 3))


def test_seeds_of_one_recording_are_no_repetitions(of_model, write_run):
    """The same frames test whatever the seed: five seeds know no more than one."""
    for seed in range(5):
        write_run("hdc", seed=seed, origin="measured", wrong=range(10))
        write_run("softmax", seed=seed, origin="measured", wrong=range(5, 10))
    assert estimates.share(of_model("hdc")) == approx(*wilson(90))
    difference = estimates.difference(of_model("softmax"), of_model("hdc"))
    assert difference == approx(0.05, math.nan, math.nan)


def test_models_differ_seed_by_seed_on_the_same_samples(of_model, write_run):
    def difference():
        return estimates.difference(of_model("softmax"), of_model("hdc"))

    write_run("softmax", wrong=range(4))
    assert difference() is None
    write_run("hdc", wrong=[0])
    assert difference().value == pytest.approx(-0.03)
    write_run("softmax", seed=1, wrong=range(2))
    write_run("hdc", seed=1, wrong=range(10))
    # A seed whose test frames were others is no pair.
    write_run("hdc", seed=2)
    write_run("softmax", seed=2, wrong=range(50), test_set="of others")
    half = T1 * np.std([-0.03, 0.08], ddof=1) / math.sqrt(2)
    assert difference() == approx(0.025, 0.025 - half, 0.025 + half)


def test_opposite_disagreements_widen_the_interval_of_a_difference(of_model, write_run):
    for seed in range(3):
        write_run("softmax", seed=seed, wrong=range(30))
        write_run("hdc", seed=seed, wrong=range(30, 60))
    half = T2 * math.sqrt(181 / 302 / 100 / 3)  # 60 samples of each seed, and one more
    found = estimates.difference(of_model("softmax"), of_model("hdc"))
    assert found == approx(0, -half, half)


# Curves and medians -------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("n", "accuracy", "expected"),
    [
        ([20, 5, 10], [1.0, 0.5, 0.8], 15),
        ([5, 10], [0.95, 1.0], 5),
        ([5, 10], [0.5, 0.9], math.nan),
    ],
)
def test_where_a_curve_crosses(n, accuracy, expected):
    assert estimates.crossing(n, accuracy) == pytest.approx(expected, nan_ok=True)


@pytest.mark.parametrize("n", [6, 8, 9, 11, 12, 15, 25])
def test_a_median_lies_between_two_of_its_values(n):
    """In places of the sign test at 5 %, two-sided."""
    values = np.random.default_rng(0).permutation(np.arange(1.0, n + 1))
    median, low, high = estimates.median_interval(values.tolist())
    place = int(low)
    assert (median, low, high) == (np.median(values), place, n + 1 - place)
    missed = binomtest(place - 1, n, 0.5, alternative="less").pvalue
    assert missed <= 0.025 < binomtest(place, n, 0.5, alternative="less").pvalue


@pytest.mark.parametrize(
    ("values", "interval", "ends"),
    [
        ([2.0], (2, math.nan, math.nan), (math.nan, math.nan)),
        ([3, 1, 2, 5, 4], (3, math.nan, math.nan), (1, 5)),
        # An infinite value is the largest.
        ([1.0, math.inf, 3.0], (3, math.nan, math.nan), (1, math.inf)),
        ([1, 2, 3, *[math.inf] * 3], (math.inf, 1, math.inf), (1, math.inf)),
    ],
)
def test_few_values_have_their_lowest_and_highest(values, interval, ends):
    assert estimates.median_interval(values) == approx(*interval)
    assert estimates.median_range(values) == approx(interval[0], *ends)
