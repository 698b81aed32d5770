"""Where results lie, and files that are whole on disk or absent."""

import os
from pathlib import Path

import pytest

from experiments.records import files
from hdc.io import write_atomically

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


@pytest.mark.parametrize(
    ("umask", "mode"), [(0o022, 0o644), (0o077, 0o600), (0o002, 0o664)]
)
def test_text_is_on_disk_before_it_has_the_name_and_is_readable_as_the_user_says(
    tmp_path, monkeypatch, umask, mode
):
    steps, path = [], tmp_path / "deep" / "file"
    fsync, replace = os.fsync, os.replace
    monkeypatch.setattr(os, "fsync", lambda h: (steps.append("fsync"), fsync(h)))
    monkeypatch.setattr(
        os, "replace", lambda a, b: (steps.append("name"), replace(a, b))
    )
    before = os.umask(umask)
    try:
        write_atomically(path, "µ\n")
    finally:
        os.umask(before)
    assert steps == ["fsync", "name"]
    assert path.read_bytes() == "µ\n".encode()
    assert path.stat().st_mode & 0o777 == mode
