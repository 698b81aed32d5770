"""The interval of an accuracy against an independent library."""

import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import binomtest

from hdc import accuracy

counts = st.integers(1, 5000).flatmap(
    lambda n: st.tuples(st.integers(0, n), st.just(n))
)


@given(counts)
def test_wilson_agrees_with_scipy(drawn):
    expected = binomtest(*drawn).proportion_ci(0.95, method="wilson")
    assert accuracy.wilson(*drawn) == pytest.approx(
        (expected.low, expected.high), abs=1e-12
    )
