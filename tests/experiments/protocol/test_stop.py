"""Every reason to stop, by name."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from experiments.protocol.stop import NAMES, StopRule


def stops(rule, accuracies, *, loss=1.0, seconds=1.0):
    """(index, name) of the first report that stops a run, or None."""
    for k, accuracy in enumerate(accuracies):
        if name := rule.check((k + 1) * seconds, loss, accuracy):
            return k, name
    return None


def test_reached_needs_more_than_the_target():
    assert stops(StopRule(until="reached"), [0.5, 0.9, 0.91]) == (2, "reached")


def test_reached_waits_for_at_least_s():
    rule = StopRule(until="reached", at_least_s=3.0, patience=50)
    assert stops(rule, [0.95] * 10) == (2, "reached")


def test_plateau_after_patience_reports_without_a_better_one():
    accuracies = [0.5, 0.6, 0.6, 0.55, 0.7, 0.7, 0.7, 0.7]
    assert stops(StopRule(patience=3), accuracies) == (7, "plateau")


def test_a_target_reached_does_not_end_a_run_to_the_plateau():
    assert stops(StopRule(), [0.95, 0.96, 0.97]) is None


def test_budget():
    assert stops(StopRule(budget_s=3), [0.1, 0.2, 0.3, 0.4]) == (2, "budget")


@pytest.mark.parametrize("loss", [math.nan, math.inf, -math.inf])
def test_diverged_comes_before_every_other_reason(loss):
    rule = StopRule(until="reached", patience=1, budget_s=1e-9)
    assert rule.check(1.0, loss, 0.99) == "diverged"


def test_a_model_without_a_loss_is_left_to_finish():
    rule = StopRule(until="reached", patience=1, budget_s=100)
    assert stops(rule, [0.99] * 50, loss=None) is None
    assert rule.check(100.0, None, 0.99) == "budget"


@pytest.mark.parametrize(
    ("settings", "key"),
    [
        ({"until": "never"}, "stop.until"),
        ({"target": 0}, "stop.target"),
        ({"target": 1.0}, "stop.target"),
        ({"target": math.nan}, "stop.target"),
        ({"patience": 0}, "stop.patience"),
        ({"budget_s": 0}, "stop.budget_s"),
        ({"budget_s": math.nan}, "stop.budget_s"),
        ({"at_least_s": -1}, "stop.at_least_s"),
        ({"at_least_s": 2000}, "stop.at_least_s"),
    ],
)
def test_a_setting_out_of_range_is_named(settings, key):
    with pytest.raises(ValueError, match=rf"^{key}: expected .*, found"):
        StopRule(**settings)


@given(
    st.lists(st.floats(0, 1), max_size=60),
    st.integers(1, 8),
    st.sampled_from(["reached", "plateau"]),
)
def test_laws(accuracies, patience, until):
    budget = 40.0
    stopped = stops(StopRule(patience=patience, until=until, budget_s=budget), accuracies)
    seen = accuracies if stopped is None else accuracies[: stopped[0] + 1]
    best = [max(seen[: k + 1]) for k in range(len(seen))]
    stale = len(seen) - 1 - best.index(best[-1]) if seen else 0
    if stopped is None:
        assert stale < patience
        assert len(seen) < budget
        return
    name = stopped[1]
    assert name in NAMES
    if name == "plateau":
        assert stale == patience  # stopped at the first report that made it so
    if name == "reached":
        assert until == "reached"
        assert seen[-1] > 0.9
        assert all(a <= 0.9 for a in seen[:-1])
    if name == "budget":
        assert len(seen) == budget


@given(st.lists(st.floats(0, 1), min_size=1, max_size=60), st.integers(1, 8))
def test_more_patience_never_stops_earlier(accuracies, patience):
    def at(p):
        stopped = stops(StopRule(patience=p), accuracies)
        return len(accuracies) if stopped is None else stopped[0]

    assert at(patience) <= at(patience + 1)


def test_another_patience_while_the_target_is_not_reached():
    stuck = [0.5, *[0.4] * 20]
    assert stops(StopRule(patience=3, patience_below=10), stuck) == (10, "plateau")
    risen = [*stuck[:5], 0.95, *[0.9] * 9]
    assert stops(StopRule(patience=3, patience_below=10), risen) == (8, "plateau")
    with pytest.raises(ValueError, match=r"stop\.patience_below"):
        StopRule(patience_below=0)
