"""Accuracy, interval, test and confusion against closed forms and independent libraries."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import binomtest
from sklearn.metrics import confusion_matrix

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


@pytest.mark.parametrize("kind", [np.uint8, np.int8, np.int64])
def test_confusion_agrees_with_scikit_learn(kind):
    """Classes of one byte were counted in another cell."""
    rng = np.random.default_rng(0)
    labels, predicted = (rng.integers(0, n, 300).astype(kind) for n in (20, 19))
    ours = accuracy.confusion(predicted, labels, 21)
    np.testing.assert_array_equal(
        ours, confusion_matrix(labels, predicted, labels=range(21))
    )
    assert accuracy.accuracy(predicted, labels) == np.trace(ours) / 300
