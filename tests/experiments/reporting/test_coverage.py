"""docs/verdicts.md: intervals hold as often as it says, and its numbers are those of the tables."""

import re

import numpy as np
import pandas as pd
import pytest

from experiments.records.files import REFERENCE, ROOT
from experiments.reporting.estimates import mean_interval, mean_share
from experiments.reporting.text import number

REPEATS = 3000
PAGE = (ROOT / "docs" / "verdicts.md").read_text(encoding="utf-8")
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


@pytest.mark.parametrize(
    ("of", "once"),
    [
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


@pytest.mark.parametrize(
    "row", [row for row in ROWS if row[-1].endswith(".md")], ids=lambda r: r[-1]
)
def test_numbers_of_objections_are_in_the_table_named(row):
    text = (REFERENCE / "tables" / row[3]).read_text(encoding="utf-8")
    for shown in re.findall(r"\d[\d.]*", row[2]):
        assert re.search(rf"(?<![\d.]){re.escape(shown)}(?![\d.])", text), shown


def test_speeds_of_the_page_on_times_are_those_of_the_benchmark():
    page = " ".join((ROOT / "docs" / "times.md").read_text(encoding="utf-8").split())
    goals = (
        pd.read_csv(REFERENCE / "tables" / "benchmark_goals.csv")
        .set_index("Goal")
        .Measured
    )
    said = [goal for goal in goals.index if goal.startswith("train: ")]
    assert len(said) == 3
    for goal in said:
        assert f"{number(goals[goal])} times" in page, goal
    routes = pd.read_csv(REFERENCE / "tables" / "benchmark.csv")
    ms = 1e3 * routes.set_index(["operation", "route"]).median_s
    bundle, torchhd = ms["bundle", "hdc, compiled"], ms["bundle", "torchhd.multiset"]
    for time in (bundle, ms["train", "one read of the bytes"] / 8, torchhd / 200):
        assert f"{number(time)} ms" in page


def test_the_page_on_tests_counts_the_changes_that_its_list_has():
    page = (ROOT / "docs" / "tests.md").read_text(encoding="utf-8")
    reasons = pd.read_csv(ROOT / "docs" / "mutants.csv").reason.value_counts()
    every, noticed, share = re.search(
        r"Of ([\d,]+) changes ([\d,]+) were .* ([\d.]+) %", page
    ).groups()
    every, noticed = (int(text.replace(",", "")) for text in (every, noticed))
    assert every - noticed == reasons.sum()
    assert f"{100 * noticed / every:.1f}" == share
    for reason, n in reasons.items():
        assert f"| {reason} | {n} |" in page
