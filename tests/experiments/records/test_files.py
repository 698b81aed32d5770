"""Where results lie, and files that are whole on disk or absent."""

import os
from pathlib import Path

import pytest

from experiments.records import files
from hdc.io import write_atomically


def test_results_lie_in_the_checkout_or_where_the_variable_says(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("HOME", str(tmp_path))
    checkout = Path(__file__).resolve().parents[3]
    for own, expected in (
        (None, checkout / "results" / "mine"),
        ("", checkout / "results" / "mine"),
        ("~/x", tmp_path / "x"),  # made a folder named ~ once
        ("elsewhere", tmp_path / "elsewhere"),
    ):
        monkeypatch.delenv("RESULTS_DIR", raising=False)
        if own is not None:
            monkeypatch.setenv("RESULTS_DIR", own)
        assert files.results_dir() == expected


def test_text_is_on_disk_before_it_has_the_name(tmp_path, monkeypatch):
    steps = []
    fsync, replace = os.fsync, os.replace
    monkeypatch.setattr(os, "fsync", lambda h: (steps.append("fsync"), fsync(h)))
    monkeypatch.setattr(
        os, "replace", lambda a, b: (steps.append("name"), replace(a, b))
    )
    write_atomically(tmp_path / "deep" / "file", "µ\n")
    assert steps == ["fsync", "name"]
    assert (tmp_path / "deep" / "file").read_bytes() == "µ\n".encode()


@pytest.mark.parametrize(
    ("umask", "mode"), [(0o022, 0o644), (0o077, 0o600), (0o002, 0o664)]
)
def test_files_are_readable_for_whom_the_user_says(tmp_path, umask, mode):
    before = os.umask(umask)
    try:
        write_atomically(tmp_path / "file", "")
    finally:
        os.umask(before)
    assert (tmp_path / "file").stat().st_mode & 0o777 == mode
