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
    for function in vars(module).values():
        if hasattr(function, "cache_clear"):
            function.cache_clear()
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
    now()


def test_a_clean_checkout_has_a_commit_and_no_changes(checkout):
    clean = now()
    assert clean.commit == git(checkout, "rev-parse", "HEAD")
    assert (clean.dirty, clean.changes, clean.is_of_a_commit) == (False, None, True)
    (checkout / "results").mkdir()
    (checkout / "results" / "record.json").write_text("{}")
    assert now() == clean  # results are not code
    (checkout / ".git").rename(checkout / "no longer git")
    found = now()
    assert (found.commit, found.dirty, found.changes) == (None, None, None)
    assert not found.is_of_a_commit


def test_changes_of_code_have_a_digest_and_those_of_configs_make_dirt_only(checkout):
    (checkout / "configs" / "a.py").write_text("a = 2\n")
    assert (now().dirty, now().changes) == (True, None)
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
    known = environment("cpu", 3)
    assert (known.threads, known.device, known.cores) == (3, "cpu", os.cpu_count())
    assert known.packages["numpy"] == np.__version__
    assert msgspec.json.encode(known)
    assert known.other_versions == []
    other = {**known.packages, "numpy": "1.0", "numba": "0"}
    told = msgspec.structs.replace(known, packages=other).other_versions
    assert told == [f"numpy 1.0 (here {np.__version__})"]
    monkeypatch.setattr(torch.cuda, "get_device_name", {"cuda:1": "A GPU"}.get)
    assert environment("cuda:1", 1).device == "cuda:1: A GPU"


@pytest.fixture
def cpuinfo(tmp_path, monkeypatch):
    """cpuinfo(text) → what Linux says of its processors."""

    def says(text):
        file = tmp_path / "cpuinfo"
        if text is not None:
            file.write_text(text)
        monkeypatch.setattr(module, "_CPUINFO", file)
        module._cpuinfo.cache_clear()

    yield says
    module._cpuinfo.cache_clear()


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("processor : 0\nmodel name\t: A CPU: 2 GHz\n\nmodel name\t: B\n", "A CPU: 2 GHz"),
        (None, "generic"),
    ],
)  # fmt: skip
def test_the_processor_is_named_as_the_system_does(
    cpuinfo, monkeypatch, text, expected
):
    cpuinfo(text)
    monkeypatch.setattr(platform, "processor", lambda: "")
    monkeypatch.setattr(platform, "machine", lambda: "generic")
    assert module.cpu_model() == expected


NUMBERS = (
    "cpu family : 25\nmodel : {}\nmodel name : A CPU\nstepping : 1\nflags : {}\n\n"
)


def test_two_processors_of_one_name_are_told_apart_by_what_they_can(cpuinfo):
    found = []
    other = "cpu family : 99\n"  # of the second core, which says nothing of the first
    for model, flags in ((1, "avx sse"), (17, "avx sse"), (1, "avx512 avx sse")):
        cpuinfo(NUMBERS.format(model, flags) + other)
        found.append(module.processor())
    assert found[0].startswith("family 25 model 1 stepping 1 flags ")
    assert len(set(found)) == 3
    cpuinfo(NUMBERS.format(1, "sse avx"))
    assert module.processor() == found[0]
    cpuinfo("model name : A CPU\n")
    assert module.processor() is None


def test_a_machine_is_its_processor_and_its_kernels_as_far_as_they_are_known():
    old = msgspec.convert({"cpu": "A CPU", "threads": 2}, Environment)
    assert old.machine == "A CPU"
    blas = {"torch": "AVX2", "openblas": "Zen"}
    new = msgspec.structs.replace(old, processor="family 25", blas=blas)
    assert new.machine == "A CPU (family 25, AVX2 by torch, Zen by openblas)"
    kernels = now().blas
    assert kernels["torch"] == torch.backends.cpu.get_cpu_capability()
