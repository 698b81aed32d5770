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
    words, env = [shutil.which("bash"), "-c", command], {"PATH": str(folder)}
    done = subprocess.run(words, env=env, capture_output=True, text=True, check=False)
    return done.returncode, done.stdout


def test_the_commands_clone_nothing_where_the_variable_is_not_set(
    tmp_path, monkeypatch
):
    monkeypatch.delenv("MEASURED_DATA", raising=False)
    code, printed = run(SOURCE.command(), tmp_path)
    assert (code != 0, printed) == (True, "")
    expected = (
        "clone https://github.com/somebody/touches /my data/touches\n"
        "-C /my data/touches checkout 0123abc\n"
    )
    later = f"MEASURED_DATA='/my data'; {SOURCE.command()}"
    assert run(later, tmp_path) == (0, expected)
    monkeypatch.setenv("MEASURED_DATA", "/my data")  # a folder with a blank is one word
    assert run(SOURCE.command(), tmp_path) == (0, expected)
