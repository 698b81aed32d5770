"""Ridge regression on packed bits, against plain floats and scikit-learn."""

import numpy as np
import pytest
import torch
from hypothesis import example, given, settings
from hypothesis import strategies as st
from sklearn.linear_model import Ridge as PlainRidge

from hdc import bits
from hdc.hypervectors import Hypervectors
from hdc.readouts import RidgeValues, among_bits, linear
from hdc.readouts.least_squares import PENALTIES, smoother_of, solve
from tests.hdc.own import fitted


@pytest.fixture(autouse=True, scope="module")
def small_parts():
    """Bits are summed, and weights rounded, some at a time."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(among_bits, "_SIGNS", 700)
        patch.setattr(linear, "_STEP", 2)
        yield


def plain(x, y, penalty):
    return PlainRidge(penalty, solver="svd").fit(x, y)


def problem(n, d, t, seed):
    """Bits in ±1 [n, d], packed ones, and targets [n, t]."""
    rng = np.random.default_rng(seed)
    x = np.where(rng.random((n, d)) < rng.random(d), 1.0, -1.0)
    return (
        x,
        bits.pack(torch.from_numpy(x > 0)),
        torch.from_numpy(rng.normal(3, 1, (n, t))),
    )


@given(st.integers(3, 30), st.integers(1, 300), st.integers(1, 3), st.integers(0, 99))
@example(30, 12, 2, 0)  # solved among the bits
@settings(max_examples=40, deadline=None)
def test_ridge_is_that_of_floats_and_its_left_out_errors_are_exact(n, d, t, seed):
    """With the penalty of the least left-out error, in units of the mean of K's diagonal."""
    x, words, y = problem(n, d, t, seed)
    queries, asked, _ = problem(5, d, t, seed + 1)
    given_words = Hypervectors(words, d)
    model, residuals = solve(given_words, y)
    penalty = float(model.penalty)
    size = (y - y.mean(0)).abs().amax(0)
    tried = [((solve(given_words, y, p)[1] / size) ** 2).sum() for p in PENALTIES]
    unit = max(1.0, ((x - x.mean(0)) ** 2).sum() / n)
    assert penalty == pytest.approx(unit * PENALTIES[int(np.argmin(tried))])
    whole = plain(x, y.numpy(), penalty)
    weights = np.atleast_2d(whole.coef_)
    rounding = np.abs(weights).max(1) / 254 * d  # half a step of 8 bits, at every pixel
    expected = whole.predict(queries).reshape(5, t)
    found = model.values(Hypervectors(asked, d)).numpy()
    assert (np.abs(found - expected) <= rounding + 1e-6).all()
    smoother = smoother_of(given_words, penalty).of_queries(Hypervectors(asked, d))
    change = (smoother[..., None] * residuals).numpy()
    errors = []
    for i in range(n):
        rest = np.arange(n) != i
        without = plain(x[rest], y.numpy()[rest], penalty)
        errors.append(y[i].numpy() - without.predict(x[i : i + 1]).reshape(t))
        np.testing.assert_allclose(
            change[:, i],
            expected - without.predict(queries).reshape(5, t),
            atol=1e-6,
        )
    np.testing.assert_allclose(residuals, errors, atol=1e-6)


def adapted_without(old, x, words, y, left_out):
    """What the old weights give [N, T] and scikit-learn's fit, without a frame, of what they
    leave."""
    rest = np.arange(len(x)) != left_out
    before = old.values(Hypervectors(words, 200)).numpy()
    change = plain(x[rest], (y - before)[rest], float(old.penalty))
    return before + change.predict(x).reshape(y.shape)


def test_recalibrated_numbers_are_held_out_as_by_retraining():
    """Residuals, predictions without each frame, and the numbers themselves.

    min Σ (y − b − w·x)² + λ‖w − w₀‖² is the fit of what the old weights leave.
    """
    _, words, y = problem(30, 200, 2, 0)
    x, new, new_y = problem(7, 200, 2, 1)
    readout = fitted(RidgeValues(0.1), words, y, 200)
    old = readout.state
    readout = readout.adapted(new, new_y)
    asked = Hypervectors(new, 200)
    centre, without = readout.readout.without(readout.state, asked)
    assert torch.equal(centre, readout.readout.values(readout.state, asked))
    assert readout.penalty_ == old.penalty
    assert without.shape == (7, 7, 2)
    whole = adapted_without(old, x, new, new_y.numpy(), -1)
    np.testing.assert_allclose(centre, whole, atol=0.05)  # weights have 8 bits
    for i in range(7):
        expected = adapted_without(old, x, new, new_y.numpy(), i)
        error = new_y.numpy()[i] - expected[i]
        np.testing.assert_allclose(readout.residuals_[i], error, atol=1e-6)
        change = (centre[:, None] - without)[:, i]
        np.testing.assert_allclose(change, whole - expected, atol=1e-6)
