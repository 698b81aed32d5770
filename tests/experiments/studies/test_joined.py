"""Numbers of sources joined by a hierarchical model: the integral, and how sure its words are."""

import numpy as np
import pytest

from experiments.studies.claims import judge
from experiments.studies.claims.rules import Prior

FREEDOM = 4
PRIOR = Prior(freedom=FREEDOM, mean=0.10, between=0.05)


def drawn(rng, sources, n):
    """From the prior: μ, and the truths of sources."""
    mu = rng.normal(0, 0.10, n)
    between = abs(rng.normal(0, 0.05, n))
    truths = rng.normal(mu[..., None], between[..., None], (*n, sources))
    return mu, truths


@pytest.mark.parametrize(
    ("values", "errors"),
    [
        ([0.02], [0.01]),  # one source
        ([-0.05], [0.05]),
        ([-0.04, 0.01, -0.02], [0.01, 0.02, 0.005]),
        ([0.01, 0.01, 0.01], [0.01, 0.01, 0.01]),  # equal values
        ([0.01, 0.0, -0.12], [0.02, 0.02, 0.02]),  # one far from the others
    ],
)
def test_the_posterior_is_the_integral_of_the_model(values, errors):
    """Over the truths of sources, on a grid of its own and with the density of Student's t."""
    mu = (np.arange(-100, 100) + 0.5) * 0.005
    between = (np.arange(40) + 0.5) * 0.006
    truth = np.arange(-800, 800) * 0.001
    squares = ((truth - mu[:, None, None]) / between[:, None]) ** 2
    normal = np.exp(-squares / 2) / between[:, None]
    weights = np.exp(-((mu[:, None] / 0.10) ** 2) / 2 - (between / 0.05) ** 2 / 2)
    for value, error in zip(values, errors, strict=True):
        squares = ((value - truth) / error) ** 2
        weights *= normal @ (1 + squares / FREEDOM) ** (-(FREEDOM + 1) / 2)
    of_each = weights.sum(axis=1)
    found = judge.Joined(values, np.square(errors), PRIOR)
    assert found.mean().value == pytest.approx(
        np.average(mu, weights=of_each), abs=1e-3
    )
    above = np.average(mu > -0.03, weights=of_each)
    assert found.above(-0.03) == pytest.approx(above, abs=5e-3)


def test_intervals_hold_the_truth_and_words_are_as_sure_as_they_say():
    rng = np.random.default_rng(2)
    held, said = [], []
    mu, truths = drawn(rng, 5, (250,))
    errors = rng.uniform(0.005, 0.03, truths.shape)
    seen = truths + errors * rng.standard_t(FREEDOM, truths.shape)
    for truth, values, of_each in zip(mu, seen, errors, strict=True):
        found = judge.Joined(values, of_each**2, PRIOR)
        _, low, high = found.mean()
        held.append(low <= truth <= high)
        if judge.word_of(found.above(-0.03), 0.95) != judge.OPEN:
            said.append((found.above(-0.03) > 0.5) == (truth > -0.03))
    assert np.mean(held) == pytest.approx(0.95, abs=0.04)
    assert len(said) > 100
    assert np.mean(said) > 0.95
