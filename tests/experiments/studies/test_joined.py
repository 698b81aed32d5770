"""Numbers of sources joined by a hierarchical model: how sure its words are.

The integral is that of another script (test_recompute.py).
"""

import numpy as np
import pytest

from experiments.studies.claims import judge
from experiments.studies.claims.rules import Prior

PRIOR = Prior(freedom=4, mean=0.10, between=0.05)


def test_intervals_hold_the_truth_and_words_are_as_sure_as_they_say():
    rng = np.random.default_rng(2)
    held, said = [], []
    mu, between = rng.normal(0, 0.10, (250, 1)), abs(rng.normal(0, 0.05, (250, 1)))
    truths = rng.normal(mu, between, (250, 5))
    errors = rng.uniform(0.005, 0.03, truths.shape)
    seen = truths + errors * rng.standard_t(PRIOR.freedom, truths.shape)
    for truth, values, of_each in zip(mu[:, 0], seen, errors, strict=True):
        found = judge.Joined(values, of_each**2, PRIOR)
        _, low, high = found.mean()
        held.append(low <= truth <= high)
        if judge.word_of(found.above(-0.03), 0.95) != judge.OPEN:
            said.append((found.above(-0.03) > 0.5) == (truth > -0.03))
    assert np.mean(held) == pytest.approx(0.95, abs=0.04)
    assert len(said) > 100
    assert np.mean(said) > 0.95
