"""Every reason to stop, by name; the limits themselves are golden numbers."""

import math

from hypothesis import given
from hypothesis import strategies as st

from experiments.protocol.stop import NAMES, StopRule

LOSSES = st.floats(0, 2) | st.sampled_from([math.nan, math.inf, -math.inf])


@given(
    st.integers(0, 40),
    LOSSES,
    st.floats(0, 1),
    st.integers(0, 20),
    st.sampled_from([None, 0.0, 5.0]),
)
def test_the_first_reason_that_holds_is_named(n, loss, accuracy, least, after):
    """After n seconds and n steps."""
    rule = StopRule(
        loss=0.1, least_steps=least, most_steps=30, reached_after_s=after, budget_s=25.0
    )
    reasons = {
        "diverged": not math.isfinite(loss),
        "reached": after is not None and n >= after and accuracy > 0.9,
        "trained": n >= max(1, least) and loss <= 0.1,
        "steps": n >= 30,
        "budget": n >= 25,
    }
    assert {*reasons, "finished"} == set(NAMES)
    first = next((name for name, holds in reasons.items() if holds), None)
    assert rule.check(n, n, loss, accuracy) == first
    # What reports no loss learns in one pass.
    assert rule.check(n, n, None, accuracy) == ("budget" if n >= 25 else None)
