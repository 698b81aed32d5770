"""The performance profile, by hand."""

import pandas as pd
import pytest

from experiments.studies.recordings import profile


@pytest.fixture
def made(monkeypatch):
    """The profile of three models on two recordings, and of one that was measured on one."""
    rows = [
        # recording, n, model, error, seconds
        ("a", 50, "quick", 0.5, 1.0),
        ("a", 50, "slow", 0.1, 30.0),
        ("a", 50, "best", 0.1, 10.0),
        ("a", 5, "best", 0.9, 0.1),  # fewer frames than the most
        ("a", 50, "once", 0.0, 99.0),
        ("b", 50, "quick", 0.2, 2.0),
        ("b", 50, "slow", 0.3, 8.0),
        ("b", 50, "best", 0.2, 1.0),
        ("b", 50, "unknown", None, 0.1),
    ]
    names = ["recording", "n", "model", "error", "fit_best_s"]
    monkeypatch.setattr(profile, "costs", lambda _: pd.DataFrame(rows, columns=names))
    return profile.profile(pd.DataFrame())


def test_a_factor_is_that_to_the_fastest_model_that_errs_no_more(made):
    found = {(row.model, row.recording): row.factor for row in made.itertuples()}
    assert found == {
        ("best", "a"): 1, ("best", "b"): 1,
        ("quick", "a"): 1, ("quick", "b"): 2,  # as accurate as the best, which is faster
        ("slow", "a"): 3, ("slow", "b"): 8,
    }  # fmt: skip


def test_a_share_is_that_of_the_recordings_within_the_factor(made):
    shares = {
        model: list(zip(rows.factor, rows.share, strict=True))
        for model, rows in made.groupby("model")
    }
    assert shares == {
        "best": [(1, 1), (1, 1)],
        "quick": [(1, 0.5), (2, 1)],
        "slow": [(3, 0.5), (8, 1)],
    }
