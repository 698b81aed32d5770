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


def test_confusion_agrees_with_scikit_learn():
    rng = np.random.default_rng(0)
    labels, predicted = (
        rng.integers(0, 4, 300),
        rng.integers(0, 5, 300),
    )  # nothing is of class 4
    ours = accuracy.confusion(predicted, labels, 5)
    np.testing.assert_array_equal(
        ours, confusion_matrix(labels, predicted, labels=range(5))
    )
    assert accuracy.accuracy(predicted, labels) == np.trace(ours) / 300
