"""A record says on which machine, and by which code, it was made."""

import json
import os
import subprocess

import numpy as np
import pytest

from experiments.records import environment as module
from experiments.records import sources
from experiments.records.environment import environment

CONFIG = {"model": {"_target_": "hdc.bits.Nothing"}}


def test_a_reader_of_a_time_finds_what_it_depends_on():
    known = environment("cpu", 3, {})
    assert (known["threads"], known["device"], known["cores"]) == (
        3,
        "cpu",
        os.cpu_count(),
    )
    assert known["packages"]["numpy"] == np.__version__
    assert json.dumps(known)


def git(folder, *words):
    who = ["-c", "user.name=t", "-c", "user.email=t@t"]
    done = subprocess.run(
        ["git", "-C", str(folder), *who, *words],
        check=True,
        capture_output=True,
        text=True,
    )
    return done.stdout.strip()


def now():
    """The environment, with nothing remembered of the checkout."""
    cached = (value for m in (module, sources) for value in vars(m).values())
    for function in cached:
        if hasattr(function, "cache_clear"):
            function.cache_clear()
    return environment("cpu", 1, CONFIG)


@pytest.fixture
def checkout(tmp_path, monkeypatch):
    """A small checkout in the place of this one."""
    (tmp_path / "hdc").mkdir()
    (tmp_path / "hdc" / "bits.py").write_text("a = 1\n")
    git(tmp_path, "init", "-q")
    git(tmp_path, "add", ".")
    git(tmp_path, "commit", "-qm", "first")
    with monkeypatch.context() as patch:
        patch.setattr(sources, "ROOT", tmp_path)
        yield tmp_path
    now()


def test_commit_and_dirt_and_code_hash(checkout):
    clean = now()
    assert clean["commit"] == git(checkout, "rev-parse", "HEAD")
    assert clean["dirty"] is False
    (checkout / "results").mkdir()
    (checkout / "results" / "record.json").write_text("{}")
    assert now() == clean  # results are not code
    (checkout / "hdc" / "bits.py").write_text("a = 2\n")
    changed = now()
    assert changed["dirty"] is True
    assert changed["commit"] == clean["commit"]
    assert changed["code"] != clean["code"]
