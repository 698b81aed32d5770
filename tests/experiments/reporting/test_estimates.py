"""Estimators against scipy, closed forms, and simulations where the truth is known."""

import math
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.stats import binomtest

from experiments.records.groups import Groups
from experiments.records.results import Results
from experiments.reporting import estimates
from experiments.reporting.estimates import mean_difference, mean_interval, mean_share

T2 = 4.302652730  # Student's t(0.975) with two degrees of freedom


def test_student_intervals_of_the_mean_and_of_one_more_sensor():
    half = T2 / math.sqrt(3)
    assert mean_interval([1.0, 2.0, 3.0]) == pytest.approx((2, 2 - half, 2 + half))
    half = T2 * math.sqrt(4 / 3)
    assert estimates.one_sensor([1.0, 2.0, 3.0]) == pytest.approx(
        (2, 2 - half, 2 + half)
    )
    assert np.isnan(mean_interval([1.0])[1:]).all()


def test_100_percent_of_all_samples_has_an_interval(tmp_path, write_run):
    for seed in range(3):
        write_run("hdc", seed=seed)
    group = Groups(Results(tmp_path).runs).group("touch", "hdc")
    assert estimates.share(group)[::2] == (1, 1)
    p = 302 / 304  # two right and two wrong added
    half = T2 * math.sqrt(p * (1 - p) / 100)
    assert estimates.share(group).low == pytest.approx(1 - half / math.sqrt(3))
    assert estimates.share_of_one_sensor(group).low == pytest.approx(
        1 - half * math.sqrt(4 / 3)
    )


def test_one_seed_has_wilsons_interval():
    wilson = binomtest(97, 100).proportion_ci(0.95, "wilson")
    assert mean_share([0.97], 100) == pytest.approx((0.97, wilson.low, wilson.high))


def test_seeds_of_one_recording_are_no_repetitions(tmp_path, write_run):
    """The same frames test whatever the seed: five seeds know no more than one."""
    for seed in range(5):
        write_run("hdc", seed=seed, origin="measured", wrong=range(10))
        write_run("softmax", seed=seed, origin="measured", wrong=range(5, 10))
    groups = Groups(Results(tmp_path).runs)
    hdc, softmax = (groups.group("touch", model) for model in ("hdc", "softmax"))
    wilson = binomtest(90, 100).proportion_ci(0.95, "wilson")
    assert estimates.share(hdc) == pytest.approx((0.9, wilson.low, wilson.high))
    difference = estimates.difference(softmax.runs, hdc.runs)
    assert difference.value == pytest.approx(0.05)
    assert np.isnan(difference[1:]).all()


def test_differences_of_accuracies_lie_between_minus_one_and_one():
    low = mean_difference([-1.0, -0.2, -0.9], 100)
    high = mean_difference([1.0, 0.2, 0.9], 100)
    assert (low.low, high.high) == (-1, 1)


def test_a_training_lasts_until_90_percent_or_until_it_is_done():
    def run(reached, iterative=True):
        times = {"training_s": 7.0, "time_to_target_train_s": reached}
        return SimpleNamespace(iterative=iterative, solved=False, **times)

    times = [
        estimates.training_time(r) for r in (run(2.0), run(None), run(None, False))
    ]
    assert times == [2.0, math.inf, 7.0]


def test_a_solved_model_below_90_percent_took_the_time_of_its_solution(
    tmp_path, write_run
):
    solved = {"training_s": 7.0, "epoch": 1.0, "loss": 0.1, "train_accuracy": 0.8}
    write_run("ridge", curve=[solved])
    write_run("softmax", curve=[solved | {"steps": 20}])
    ridge, softmax = Results(tmp_path).runs
    for run, ended, seconds in (
        (ridge, "finished", 7.0),
        (ridge, "budget", math.inf),
        (softmax, "finished", math.inf),
    ):
        run.stop = ended
        assert estimates.training_time(run) == seconds


def test_models_differ_seed_by_seed_on_the_same_samples(tmp_path, write_run):
    def difference():
        results = Results(tmp_path)
        return estimates.difference(
            *(Groups(results.runs).group("touch", m).runs for m in ("softmax", "hdc"))
        )

    write_run("softmax", wrong=range(4))
    assert difference() is None
    write_run("hdc", wrong=[0])
    assert difference().value == pytest.approx(-0.03)
    write_run("softmax", seed=1, wrong=range(2))
    write_run("hdc", seed=1, wrong=range(10))
    half = 12.7062 * np.std([-0.03, 0.08], ddof=1) / math.sqrt(2)
    # A seed whose test frames were others is no pair.
    write_run("hdc", seed=2)
    write_run(
        "softmax",
        seed=2,
        wrong=range(50),
        data_sha256={"train": "", "test": "of others"},
    )
    assert difference() == pytest.approx((0.025, 0.025 - half, 0.025 + half), abs=1e-4)


def test_opposite_disagreements_widen_the_interval_of_a_difference(tmp_path, write_run):
    for seed in range(3):
        write_run("softmax", seed=seed, wrong=range(30))
        write_run("hdc", seed=seed, wrong=range(30, 60))
    results = Results(tmp_path)
    found = estimates.difference(
        *(Groups(results.runs).group("touch", m).runs for m in ("softmax", "hdc"))
    )
    half = T2 * math.sqrt(181 / 302 / 100 / 3)  # 60 samples of each seed, and one more
    assert found == pytest.approx((0, -half, half))


def test_differences_spread_at_least_as_much_as_the_samples_disagree():
    half = T2 * math.sqrt(1 / 302 / 100 / 3)
    assert mean_difference([0, 0, 0], 100) == pytest.approx((0, -half, half))
    half = 12.7062 * math.sqrt((4 + 1) / 202 / 100 / 2)  # 2 and 2 of 100 samples
    found = mean_difference([0.02, 0.02], 100)
    assert found == pytest.approx((0.02, 0.02 - half, 0.02 + half), abs=1e-4)


def test_where_a_curve_crosses():
    assert estimates.crossing([20, 5, 10], [1.0, 0.5, 0.8]) == pytest.approx(15)
    assert estimates.crossing([5, 10], [0.95, 1.0]) == 5
    assert math.isnan(estimates.crossing([5, 10], [0.5, 0.9]))


@pytest.mark.parametrize(
    ("n", "place"), [(6, 1), (8, 1), (9, 2), (11, 2), (12, 3), (15, 4), (25, 8)]
)
def test_a_median_lies_between_two_of_its_values(n, place):
    """Places as in tables of the sign test at 5 %, two-sided."""
    values = np.random.default_rng(0).permutation(np.arange(1.0, n + 1))
    found = estimates.median_interval(values.tolist())
    assert found == (np.median(values), place, n + 1 - place)
    missed = binomtest(place - 1, n, 0.5, alternative="less").pvalue
    assert missed <= 0.025 < binomtest(place, n, 0.5, alternative="less").pvalue


def test_five_values_have_no_such_interval_and_an_infinite_one_is_the_largest():
    few = estimates.median_interval([3, 1, 2, 5, 4])
    assert few.value == 3
    assert math.isnan(few.low)
    assert math.isnan(few.high)
    never = estimates.median_interval([1.0, 2.0, 3.0, math.inf, math.inf, math.inf])
    assert never == (math.inf, 1.0, math.inf)


def test_few_values_have_the_coverage_that_their_lowest_and_highest_have():
    found, coverage = estimates.median_range([2.0])
    assert (found.value, math.isnan(found.low), math.isnan(coverage)) == (2, True, True)
    for n in range(2, 6):
        found, coverage = estimates.median_range(list(range(n)))
        assert (found.low, found.high) == (0, n - 1)
        assert coverage == pytest.approx(1 - 2 ** (1 - n))
    assert estimates.median_range([1.0, math.inf, 3.0])[0] == (3, 1, math.inf)


def test_an_interval_of_a_median_holds_as_often_as_it_says_and_narrows_with_more_values():
    rng = np.random.default_rng(0)
    widths = []
    for n in (7, 15, 40):
        drawn = [estimates.median_range(rng.exponential(size=n)) for _ in range(4000)]
        held = np.mean([one.low <= math.log(2) <= one.high for one, _ in drawn])
        coverage = drawn[0][1]
        assert coverage >= 0.95
        assert held == pytest.approx(coverage, abs=0.012)
        widths.append(np.median([one.high - one.low for one, _ in drawn]))
    assert widths[0] > widths[1] > widths[2]
