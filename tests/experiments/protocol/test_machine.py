"""Cores are shared out and never shared; each worker has its share of the threads."""

from __future__ import annotations

import platform
import resource
import subprocess
import sys
import threading
from types import SimpleNamespace

import pytest

from experiments.protocol import machine
from tests.experiments.helpers import until


@pytest.fixture
def four_cores(monkeypatch):
    monkeypatch.setattr(machine, "available", lambda: [0, 1, 2, 3])


def use(n, log, ends, device="cpu"):
    """A run on n cores in a thread; ends when told."""

    def run():
        console = SimpleNamespace(print=lambda text, **_: log.append(f"{n} waits"))
        with machine.held(n, device, console):
            log.append(f"{n} runs")
            ends.wait(20)
            log.append(f"{n} ends")

    thread = threading.Thread(target=run, daemon=True)
    thread.start()
    return thread


def test_runs_that_fit_run_side_by_side_and_others_wait(four_cores):
    log, first, last = [], threading.Event(), threading.Event()
    threads = [use(2, log, first), use(1, log, first)]
    until(lambda: len(log) == 2)
    threads.append(use(3, log, last))  # one core is free
    until(lambda: "3 waits" in log)
    threads.append(use(1, log, first))
    until(lambda: log.count("1 runs") == 2)
    assert "3 runs" not in log
    first.set()
    until(lambda: "3 runs" in log)
    assert log.index("3 runs") > log.index("2 ends")
    last.set()
    for thread in threads:
        thread.join(20)
    assert log.count("3 waits") == 1


@pytest.mark.parametrize(
    ("launcher", "threads"),
    [
        ({"_target_": "basic"}, 8),
        ({"n_jobs": -1}, 1),
        ({"n_jobs": 4}, 2),
        ({"cpus_per_task": 3}, 3),
        ({"cpus_per_task": 9}, 8),
        ({"n_jobs": None}, 8),
    ],
)
def test_a_worker_has_its_share_of_the_cores(monkeypatch, launcher, threads):
    monkeypatch.setattr(machine, "available", lambda: list(range(8)))
    assert machine.threads(None, launcher) == threads
    assert [machine.threads(n, launcher) for n in (1, 5, 8)] == [1, 5, 8]


@pytest.mark.parametrize("wanted", [0, 5, 10**20, True, "two"])
def test_a_wrong_number_of_threads_is_named(four_cores, wanted):
    """100,000 threads ended in a segmentation fault, and took all that the machine has."""
    with pytest.raises(
        ValueError, match=r"^threads: expected an integer from 1 to .* 4 cores, or"
    ):
        machine.threads(wanted, {})


KEEP = """
import resource
from experiments.protocol import machine
import torch
kept = machine.keep_memory()
for k in range(20):
    torch.ones(4_000_000)
before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt
for k in range(20):
    torch.ones(4_000_000)
print(kept, resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before)
"""


def test_kept_memory_is_not_cleared_again():
    """In a process of its own, since it cannot be undone."""
    run = subprocess.run(
        [sys.executable, "-c", KEEP], capture_output=True, text=True, check=True
    )
    kept, faults = run.stdout.split()
    assert kept == str(platform.libc_ver()[0] == "glibc")
    if kept == "False":
        pytest.skip("the C library is not glibc")
    assert int(faults) < 10_000  # 20 × 16 MB are 78,000 pages


STATUS = "Name:\tpython\nVmPeak:\t  900 kB\nVmHWM:\t  300 kB\nVmRSS:\t  200 kB\n"


@pytest.mark.parametrize(
    ("status", "system", "expected"),
    [
        (STATUS, "linux", 300 * 1024),
        (None, "linux", 7 * 1024),  # getrusage counts in kilobytes there
        (None, "darwin", 7),
    ],
)
def test_the_peak_of_memory_is_the_processs_own_where_the_system_says_it(
    tmp_path, monkeypatch, status, system, expected
):
    file = tmp_path / "status"
    if status is not None:
        file.write_text(status)
    places = {"/proc/self/status": file}
    usage = {resource.RUSAGE_SELF: SimpleNamespace(ru_maxrss=7)}
    monkeypatch.setattr(machine, "Path", places.__getitem__)
    monkeypatch.setattr(resource, "getrusage", usage.__getitem__)
    monkeypatch.setattr(sys, "platform", system)
    assert machine.peak_bytes() == expected


def test_libraries_get_the_threads_of_the_run():
    from threadpoolctl import threadpool_info

    estimator = {"estimator": {"_target_": "sklearn.linear_model.RidgeClassifier"}}
    with machine.limited(estimator, 1):
        used = {each["internal_api"]: each["num_threads"] for each in threadpool_info()}
    assert {"openblas", "openmp"} <= set(used)
    assert set(used.values()) == {1}
