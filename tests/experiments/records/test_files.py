"""Where results lie."""

from pathlib import Path

import pytest

from experiments.records import files

MINE = Path(__file__).resolve().parents[3] / "results" / "mine"


@pytest.mark.parametrize(
    ("own", "expected"),
    [(None, MINE), ("", MINE), ("~/x", "x"), ("elsewhere", "elsewhere")],
)
def test_results_lie_in_the_checkout_or_where_the_variable_says(
    tmp_path, monkeypatch, own, expected
):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.delenv("RESULTS_DIR", raising=False)
    if own is not None:
        monkeypatch.setenv("RESULTS_DIR", own)
    assert files.results_dir() == tmp_path / expected
