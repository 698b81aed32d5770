"""Every reason to stop, by name."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from experiments.protocol.stop import NAMES, StopRule


def stops(rule, losses, accuracies=None, *, seconds=1.0, steps=1):
    """(index, name) of the first report that stops a run, or None."""
    for k, loss in enumerate(losses):
        accuracy = accuracies[k] if accuracies else 0.0
        if name := rule.check((k + 1) * seconds, (k + 1) * steps, loss, accuracy):
            return k, name
    return None


@pytest.mark.parametrize("loss", [math.nan, math.inf, -math.inf])
def test_diverged_comes_before_every_other_reason(loss):
    rule = StopRule(reached_after_s=0, least_steps=0, most_steps=1, budget_s=1e-9)
    assert rule.check(1.0, 1, loss, 0.99) == "diverged"


@given(
    st.lists(st.tuples(st.floats(0, 2), st.floats(0, 1)), max_size=60),
    st.integers(0, 20),
    st.sampled_from([None, 0.0, 5.0]),
)
def test_laws(reports, least, after):
    rule = StopRule(
        loss=0.1, least_steps=least, most_steps=30, reached_after_s=after, budget_s=40.0
    )
    losses, accuracies = [r[0] for r in reports], [r[1] for r in reports]
    stopped = stops(rule, losses, accuracies)
    n = len(reports) if stopped is None else stopped[0]
    for k in range(n):  # nothing stopped it before
        assert losses[k] > 0.1 or k + 1 < least
        assert after is None or k + 1 < after or accuracies[k] <= 0.9
    assert n < 30
    if stopped is None:
        return
    name = stopped[1]
    assert name in NAMES
    if name == "trained":
        assert losses[n] <= 0.1
        assert n + 1 >= least
    if name == "reached":
        assert accuracies[n] > 0.9
        assert n + 1 >= after
    if name == "steps":
        assert n + 1 == 30
