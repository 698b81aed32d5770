"""docs/claims.md: intervals hold as often as it says, its numbers are those of the tables."""

import numpy as np
import pytest

from experiments.records.files import REFERENCE, ROOT
from experiments.reporting.estimates import (
    mean_interval,
    mean_share,
    median_interval,
)
from experiments.studies.claims.random_effects import random_effects

REPEATS = 3000
PAGE = (ROOT / "docs" / "claims.md").read_text(encoding="utf-8")
ROWS = [
    [c.strip() for c in x.strip("|").split("|")]
    for x in PAGE.splitlines()
    if x[:1] == "|"
]


def shares(rng, seeds, truth, spread):
    """Mean share of seeds whose true shares have this standard deviation."""
    size = truth * (1 - truth) / spread**2 - 1 if spread else None
    each = (
        rng.beta(truth * size, (1 - truth) * size, seeds)
        if size
        else np.full(seeds, truth)
    )
    return mean_share((rng.binomial(100, each) / 100).tolist(), 100), truth


def draws(rng, n):
    """Central 95 % of n draws, and one more draw."""
    return (0, *np.quantile(rng.normal(size=n), (0.025, 0.975))), rng.normal()


def across(rng, laboratories):
    """A mean over laboratories that vary twice as much as is known of each, and a new sensor."""
    variances = rng.uniform(0.5, 1.5, laboratories)
    truths = rng.normal(0, 2, laboratories)
    found = random_effects(rng.normal(truths, np.sqrt(variances)), variances)
    return found.mean, (0, found.predicted_low, found.predicted_high), rng.normal(0, 2)


@pytest.mark.parametrize("laboratories", [4, 6, 10])
def test_an_estimate_across_laboratories_holds_as_often_as_the_page_says(laboratories):
    rng = np.random.default_rng(laboratories)
    held = []
    for _ in range(REPEATS):
        mean, predicted, another = across(rng, laboratories)
        held.append(
            (mean.low <= 0 <= mean.high, predicted[1] <= another <= predicted[2])
        )
    for of, share in zip(("mean", "new sensor"), np.mean(held, axis=0), strict=True):
        (stated,) = (
            float(row[2])
            for row in ROWS
            if row[:2] == [f"`random_effects`, {of}", f"{laboratories} laboratories"]
        )
        assert 100 * share == pytest.approx(stated, abs=1.5), of


def runs(rng, n):
    """The median of n times, whose logarithms are normal, and their true median."""
    return median_interval(np.exp(rng.normal(size=n)).tolist()), 1


@pytest.mark.parametrize(
    ("of", "once"),
    [
        ("median of 7 times", lambda rng: runs(rng, 7)),
        ("median of 15 times", lambda rng: runs(rng, 15)),
        ("one more draw, after 5", lambda rng: draws(rng, 5)),
        (
            "mean of 5 normal numbers",
            lambda rng: (mean_interval(rng.normal(size=5).tolist()), 0),
        ),
        (
            "5 seeds of 100 frames, all with a truth of 90 %",
            lambda rng: shares(rng, 5, 0.9, 0),
        ),
        (
            "5 seeds that spread by 5 points about 90 %",
            lambda rng: shares(rng, 5, 0.9, 0.05),
        ),
        (
            "5 seeds that spread by 5 points about 95 %",
            lambda rng: shares(rng, 5, 0.95, 0.05),
        ),
        (
            "20 seeds that spread by 5 points about 95 %",
            lambda rng: shares(rng, 20, 0.95, 0.05),
        ),
        (
            "5 seeds that spread by 3 points about 98 %",
            lambda rng: shares(rng, 5, 0.98, 0.03),
        ),
        ("one more draw, after 20", lambda rng: draws(rng, 20)),
        ("one more draw, after 50", lambda rng: draws(rng, 50)),
    ],
)
def test_an_interval_holds_as_often_as_the_page_says(of, once):
    (stated,) = (float(row[2]) for row in ROWS if len(row) == 3 and row[1] == of)
    rng = np.random.default_rng(0)
    held = [
        low <= truth <= high
        for (_, low, high), truth in (once(rng) for _ in range(REPEATS))
    ]
    assert 100 * np.mean(held) == pytest.approx(stated, abs=1.5)


def test_the_goals_on_the_page_are_those_of_the_benchmark():
    page = (ROOT / "docs" / "numerics.md").read_text(encoding="utf-8")
    table = (REFERENCE / "tables" / "benchmark_goals.md").read_text(encoding="utf-8")
    rows = [line for line in table.splitlines() if line.startswith("|")]
    assert len(rows) > 2
    assert "\n".join(rows) in page
