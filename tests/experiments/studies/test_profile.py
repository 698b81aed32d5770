"""The performance profile, by hand."""

import pandas as pd
import pytest

from experiments.studies.recordings import profile, tables


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
    monkeypatch.setattr(tables, "costs", lambda _: pd.DataFrame(rows, columns=names))
    return profile.profile(pd.DataFrame())


def test_a_factor_is_to_the_fastest_that_errs_no_more_and_a_share_is_of_recordings(
    made,
):
    found = {
        model: list(zip(rows.factor, rows.share, strict=True))
        for model, rows in made.groupby("model")
    }
    assert found == {
        "best": [(1, 1), (1, 1)],
        "quick": [(1, 0.5), (2, 1)],  # on b the best is as accurate, and faster
        "slow": [(3, 0.5), (8, 1)],
    }
