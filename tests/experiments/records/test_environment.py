"""A record says on which machine, with which libraries and from which checkout it was made."""

import os
import platform
import subprocess

import msgspec
import numpy as np
import pytest
import torch

from experiments.records import environment as module
from experiments.records import files
from experiments.records.environment import Environment, environment
from tests.experiments.helpers import forget


def git(folder, *words):
    who = ["-c", "user.name=t", "-c", "user.email=t@t"]
    command = ["git", "-C", str(folder), *who, *words]
    return subprocess.check_output(command, text=True).strip()


def now():
    forget(module)
    return environment("cpu", 1)


@pytest.fixture
def checkout(tmp_path, monkeypatch):
    """A small checkout in the place of this one."""
    for package in ("hdc", "baselines", "scenes", "experiments", "configs"):
        (tmp_path / package).mkdir()
        (tmp_path / package / "a.py").write_text("a = 1\n")
    git(tmp_path, "init", "-q")
    git(tmp_path, "add", ".")
    git(tmp_path, "commit", "-qm", "first")
    with monkeypatch.context() as patch:
        patch.setattr(files, "ROOT", tmp_path)
        yield tmp_path
    forget(module)


def test_a_clean_checkout_has_a_commit_and_no_changes(checkout):
    clean = now()
    assert clean.commit == git(checkout, "rev-parse", "HEAD")
    assert (clean.changes, clean.is_of_a_commit) == (None, True)
    (checkout / "results").mkdir()
    (checkout / "results" / "record.json").write_text("{}")
    assert now() == clean  # results are not code
    (checkout / ".git").rename(checkout / "no longer git")
    found = now()
    assert (found.commit, found.changes) == (None, None)
    assert not found.is_of_a_commit


def test_changes_of_code_have_a_digest(checkout):
    """A record has its config in itself."""
    (checkout / "configs" / "a.py").write_text("a = 2\n")
    assert now().changes is None
    digests = set()
    for name, text in (("a.py", "a = 2\n"), ("a.py", "a = 3\n"), ("new.py", "b = 1\n")):
        (checkout / "scenes" / name).write_text(text)
        digests.add(now().changes)
    assert None not in digests
    assert len(digests) == 3
    assert not now().is_of_a_commit
    assert module.changes("scenes") is not None
    assert module.changes("hdc") is None


def test_a_reader_of_a_time_finds_what_it_depends_on(monkeypatch):
    monkeypatch.setattr(torch.cuda, "get_device_name", {"cuda:1": "A GPU"}.get)
    known = environment("cuda:1", 3)
    assert (known.threads, known.cores) == (3, os.cpu_count())
    assert known.device == "cuda:1: A GPU"
    assert known.packages["numpy"] == np.__version__
    assert known.blas["torch"] == torch.backends.cpu.get_cpu_capability()


CORE = (
    "cpu family : 25\nmodel : {}\nmodel name : A CPU: 2 GHz\nstepping : 1\nflags : {}\n"
)
SECOND = "\ncpu family : 99\nmodel name : B\n"  # which says nothing of the first


def test_a_machine_is_its_processor_and_its_kernels_as_far_as_they_are_known(
    tmp_path, monkeypatch
):
    monkeypatch.setattr(platform, "processor", lambda: "")
    monkeypatch.setattr(platform, "machine", lambda: "generic")
    monkeypatch.setattr(module, "_CPUINFO", tmp_path / "cpuinfo")

    def found(text=None):
        if text is not None:
            module._CPUINFO.write_text(text)
        forget(module)
        return module.cpu_model(), module.processor()

    try:
        assert found() == ("generic", None)
        assert found("model name : A CPU\n") == ("A CPU", None)
        cores = [(1, "avx sse"), (17, "avx sse"), (1, "avx512 avx sse"), (1, "sse avx")]
        names = [found(CORE.format(*core) + SECOND) for core in cores]
    finally:
        forget(module)
    first, *others, again = names
    assert first[0] == "A CPU: 2 GHz"
    assert first[1].startswith("family 25 model 1 stepping 1 flags ")
    assert again == first
    assert len({first, *others}) == 3
    old = msgspec.convert({"cpu": "A CPU", "threads": 2}, Environment)
    assert old.machine == "A CPU"
    blas = {"torch": "AVX2", "openblas": "Zen"}
    new = msgspec.structs.replace(old, processor="family 25", blas=blas)
    assert new.machine == "A CPU (family 25, AVX2 by torch, Zen by openblas)"
