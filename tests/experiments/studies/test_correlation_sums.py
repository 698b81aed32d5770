"""Eqs. 4 to 6: the sums of O(N·D) against the double sums, and where correlations lose digits."""

from __future__ import annotations

import mpmath
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from experiments.studies.correlation.sums import (
    CorrelationSums,
    mean_pair_correlations,
    pair_correlations_double_sum,
    standardise,
)


def samples(n, d, seed=0, dtype=np.uint8):
    """Samples with something in common."""
    rng = np.random.default_rng(seed)
    common = rng.integers(0, 60, d)
    return (common + rng.integers(0, 120, (n, d))).astype(dtype)


@given(
    n=st.integers(2, 6), d=st.integers(2, 40), seed=st.integers(0, 99),
    dtype=st.sampled_from([np.uint8, np.uint16, np.int64, np.float32, np.float64]),
)  # fmt: skip
@settings(max_examples=40, deadline=None)
def test_two_vectors_give_what_the_double_sum_gives(n, d, seed, dtype):
    a, b = samples(n, d, seed, dtype), samples(n, d, seed + 1, dtype)
    for pair in ((a, b), (b, a), (a, a)):
        fast, slow = mean_pair_correlations(*pair), pair_correlations_double_sum(*pair)
        assert fast.undefined == slow.undefined
        assert fast.value == pytest.approx(slow.value, abs=1e-12, nan_ok=True)


def test_a_matrix_is_made_of_its_pairs():
    classes = [samples(7, 30, seed) for seed in range(3)]
    sums = CorrelationSums(3, 30)
    for k in range(7):
        sums.add([members[k] for members in classes])
    expected = [[mean_pair_correlations(a, b).value for b in classes] for a in classes]
    np.testing.assert_allclose(sums.pair_means(), expected, atol=1e-14)


def test_sums_of_two_parts_are_those_of_the_whole():
    a, b = samples(6, 30, 0), samples(6, 30, 1)
    whole, first, rest = (CorrelationSums(2, 30) for _ in range(3))
    for k in range(6):
        for sums in (whole, first if k < 4 else rest):
            sums.add([a[k], b[k]])
    both = first + rest
    np.testing.assert_allclose(both.pair_means(), whole.pair_means(), atol=1e-14)
    assert (first.n, rest.n, both.n) == (4, 2, 6)


def test_prototype_means_are_means_of_correlation_coefficients():
    a, b = samples(5, 50, 0), samples(5, 50, 1)
    prototypes = [np.median(a, 0), np.median(b, 0)]
    sums = CorrelationSums(2, 50)
    for k in range(5):
        sums.add([a[k], b[k]])
    expected = [[np.mean([np.corrcoef(p, v)[0, 1] for v in c]) for c in (a, b)] for p in prototypes]
    np.testing.assert_allclose(sums.means_with(prototypes), expected, atol=1e-14)


@pytest.mark.parametrize("dtype", [np.float64, np.float32])
def test_a_mean_of_a_million_deviations_loses_no_digits(dtype):
    deviation = np.random.default_rng(0).standard_normal((3, 200))
    shifted = deviation + 1e6  # what the samples have lost by that, both see
    with mpmath.workdps(40):
        exact = _in_many_digits(shifted)
    found = mean_pair_correlations(shifted, shifted, dtype).value
    assert found == pytest.approx(exact, abs=1e-13 if dtype is np.float64 else 1e-7)
    naive = pair_correlations_double_sum(shifted, shifted, np.float32).value
    assert abs(naive - exact) > 1e-4


def _in_many_digits(rows):
    z = []
    for row in rows:
        values = [mpmath.mpf(float(v)) for v in row]
        mean = mpmath.fsum(values) / len(values)
        norm = mpmath.sqrt(mpmath.fsum((v - mean) ** 2 for v in values))
        z.append([(v - mean) / norm for v in values])
    pairs = [(i, j) for i in range(len(z)) for j in range(len(z)) if i != j]
    return float(sum(mpmath.fdot(z[i], z[j]) for i, j in pairs) / len(pairs))


@pytest.mark.parametrize("level", [0, 255, 0.1, 1e6 + 0.1])
def test_samples_without_variance_are_counted_and_never_divided_by(level):
    a = samples(4, 64, dtype=np.float64)
    b = samples(4, 64, 1, np.float64)
    b[[1, 3]] = level
    with np.errstate(all="raise"):
        found = mean_pair_correlations(a, b)
        assert np.isnan(found.value)
        assert found.undefined == 2
        assert mean_pair_correlations(b, b).undefined == 2
        assert pair_correlations_double_sum(a, b)[1] == 2
        assert np.isnan(standardise(b)[[1, 3]]).all()
    assert np.isfinite(standardise(b)[[0, 2]]).all()


@pytest.mark.parametrize("scale", [1e-200, 1e200])
def test_a_correlation_has_no_scale(scale):
    a = samples(4, 64, dtype=np.float64)
    with np.errstate(over="raise", invalid="raise"):
        found = mean_pair_correlations(a * scale, a).value
    assert found == pytest.approx(mean_pair_correlations(a, a).value, abs=1e-13)


def test_one_undefined_class_leaves_the_others_alone():
    sums = CorrelationSums(3, 16)
    for k in range(2):
        sums.add([samples(1, 16, k)[0], samples(1, 16, k + 9)[0], np.full(16, 7)])
    means = sums.pair_means()
    assert np.isfinite(means[:2, :2]).all()
    assert np.isnan(means[2]).all()
    assert sums.undefined.tolist() == [0, 0, 2]


@pytest.mark.parametrize(
    ("a", "b", "message"),
    [
        (np.ones((1, 5)), np.ones((1, 5)), r"N_s ≥ 2, found \(1, 5\)"),
        (np.ones((3, 5)), np.ones((3, 6)), r"found \(3, 5\) and \(3, 6\)"),
        (np.ones(5), np.ones(5), r"\[N_s, D\]"),
        ([[1, 2], [3, np.inf]], [[1, 2], [3, 4]], r"samples\[0\]: expected finite"),
    ],
)
def test_what_does_not_fit_is_named(a, b, message):
    with pytest.raises(ValueError, match=message):
        mean_pair_correlations(a, b)


def test_no_samples_have_no_mean():
    sums = CorrelationSums(2, 4)
    with pytest.raises(ValueError, match="at least two of each class, found 0"):
        sums.pair_means()
    with pytest.raises(ValueError, match="at least one of each class, found 0"):
        sums.means_with(np.eye(2, 4))
    with pytest.raises(ValueError, match=r"expected shape \(2, 4\)"):
        sums.add(np.ones((3, 4)))
