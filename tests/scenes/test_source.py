"""Where public repositories are looked for, and the commands that get them."""

import shutil
import subprocess

import pytest

from scenes.source import Source

SOURCE = Source("somebody/touches", "0123abc", "Somebody, 2024")


@pytest.mark.parametrize("folder", ["touches", "somebody+touches"])
def test_a_checkout_has_one_of_two_names(tmp_path, monkeypatch, folder):
    monkeypatch.setenv("MEASURED_DATA", str(tmp_path))
    assert SOURCE.find() is None
    (tmp_path / folder).mkdir()
    assert SOURCE.folder() == tmp_path / folder


def run(command, folder):
    """Exit status and printed words of a shell in which git prints its arguments."""
    (folder / "git").write_text('#!/bin/sh\necho "$@"\n')
    (folder / "git").chmod(0o755)
    shell = shutil.which("bash")
    done = subprocess.run(
        [shell, "-c", command],
        env={"PATH": str(folder)},
        capture_output=True,
        text=True,
        check=False,
    )
    return done.returncode, done.stdout.split("\n")


def test_the_commands_clone_nothing_where_the_variable_is_not_set(
    tmp_path, monkeypatch
):
    monkeypatch.delenv("MEASURED_DATA", raising=False)
    code, printed = run(SOURCE.command(), tmp_path)
    assert code != 0
    assert printed == [""]
    code, printed = run(f"MEASURED_DATA='/my data'; {SOURCE.command()}", tmp_path)
    assert code == 0
    assert printed[0].endswith("/somebody/touches /my data/touches")


def test_a_folder_with_a_blank_is_one_word(tmp_path, monkeypatch):
    monkeypatch.setenv("MEASURED_DATA", "/my data")
    code, printed = run(SOURCE.command(), tmp_path)
    assert (code, printed[1]) == (0, "-C /my data/touches checkout 0123abc")
