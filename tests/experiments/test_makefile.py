"""Which Python `make` sets up: the first that is new enough, whatever it is called."""

import shutil
import subprocess
import sys

import pytest

from experiments.records.files import ROOT


@pytest.fixture
def venv_of(tmp_path):
    """venv_of(**stubs) → how `make` would make .venv with these programs alone on its PATH.

    A stub is ``new``: this Python; ``old``: one that says that it is too old; or ``shim``: of a
    Python that is not there.
    """
    lines = {
        "new": f'exec "{sys.executable}" "$@"',
        "old": "exit 1",
        "shim": "exit 127",
    }
    path = tmp_path / "bin"
    path.mkdir()
    shutil.copy(ROOT / "Makefile", tmp_path)
    for name in ("pyproject.toml", "constraints.txt"):
        (tmp_path / name).touch()

    def call(stubs, *words):
        for name, kind in stubs.items():
            program = path / name
            program.write_text(f"#!/bin/sh\n{lines[kind]}\n")
            program.chmod(0o755)
        command = [shutil.which("make"), "-n", ".venv/.harness", *words]
        return subprocess.run(
            command, cwd=tmp_path, env={"PATH": str(path)}, capture_output=True, text=True
        )  # fmt: skip

    return call


@pytest.mark.parametrize(
    ("stubs", "words", "chosen"),
    [
        ({"python3.11": "new", "python3.13": "new"}, [], "python3.11"),
        ({"python3.12": "new", "python3": "old"}, [], "python3.12"),
        ({"python3.11": "shim", "python3.13": "new"}, [], "python3.13"),
        ({"python3": "new"}, [], "python3"),
        ({"python3.11": "new"}, ["PYTHON=another"], "another"),
    ],
    ids=str,
)
def test_the_first_python_that_is_new_enough_makes_the_environment(
    venv_of, stubs, words, chosen
):
    """A machine with Python 3.12 alone could not run `make table1`."""
    done = venv_of(stubs, *words)
    assert done.stdout.splitlines()[0] == f"{chosen} -m venv --clear .venv", done.stderr


@pytest.mark.parametrize("stubs", [{}, {"python3": "old"}], ids=str)
def test_no_python_that_is_new_enough_is_one_line_that_says_what_to_type(
    venv_of, stubs
):
    done = venv_of(stubs)
    (line,) = done.stderr.splitlines()
    assert "Python: expected 3.11 or newer" in line
    assert "make PYTHON=" in line
