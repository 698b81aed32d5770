"""docs/claims.md: intervals hold as often as it says."""

import numpy as np
import pytest

from experiments.records.files import ROOT
from experiments.reporting.estimates import mean_interval, mean_share, median_interval

REPEATS = 3000
PAGE = (ROOT / "docs" / "claims.md").read_text(encoding="utf-8")


def shares(rng, seeds, truth, spread):
    """Mean share of seeds whose true shares have this standard deviation, and the truth."""
    each = np.full(seeds, truth)
    if spread:
        size = truth * (1 - truth) / spread**2 - 1
        each = rng.beta(truth * size, (1 - truth) * size, seeds)
    return mean_share((rng.binomial(100, each) / 100).tolist(), 100), truth


def draws(rng, n):
    """Central 95 % of n draws, and one more draw."""
    return (0, *np.quantile(rng.normal(size=n), (0.025, 0.975))), rng.normal()


def times(rng, n):
    """The median of n times, whose logarithms are normal, and their true median."""
    return median_interval(np.exp(rng.normal(size=n)).tolist()), 1


def numbers(rng, n):
    """The mean of n normal numbers, and the true mean."""
    return mean_interval(rng.normal(size=n).tolist()), 0


@pytest.mark.parametrize(
    ("of", "once", "case"),
    [
        ("mean of 5 normal numbers", numbers, (5,)),
        ("median of 7 times", times, (7,)),
        ("median of 15 times", times, (15,)),
        ("one more draw, after 5", draws, (5,)),
        ("one more draw, after 20", draws, (20,)),
        ("one more draw, after 50", draws, (50,)),
        ("5 seeds of 100 frames, all with a truth of 90 %", shares, (5, 0.9, 0)),
        ("5 seeds that spread by 5 points about 90 %", shares, (5, 0.9, 0.05)),
        ("5 seeds that spread by 5 points about 95 %", shares, (5, 0.95, 0.05)),
        ("20 seeds that spread by 5 points about 95 %", shares, (20, 0.95, 0.05)),
        ("5 seeds that spread by 3 points about 98 %", shares, (5, 0.98, 0.03)),
    ],
)
def test_an_interval_holds_as_often_as_the_page_says(of, once, case):
    (row,) = (line for line in PAGE.splitlines() if f"| {of} |" in line)
    rng = np.random.default_rng(0)
    made = (once(rng, *case) for _ in range(REPEATS))
    held = [low <= truth <= high for (_, low, high), truth in made]
    stated = float(row.split("|")[3])
    assert 100 * np.mean(held) == pytest.approx(stated, abs=1.5)
