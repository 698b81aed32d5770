"""Locks: one holder, freed by any end of it; cores are shared out and never shared."""

from __future__ import annotations

import errno
import multiprocessing
import os
import signal
import threading
import time

import pytest

from experiments import cores, locks

FORK = multiprocessing.get_context("fork")


def test_a_lock_has_one_holder_who_is_named(tmp_path):
    path = tmp_path / "run-1" / locks.FILE
    with locks.held(path):
        with pytest.raises(locks.Held, match="run-1: being run by another process") as caught:
            locks.held(path).__enter__()
        assert f"process {os.getpid()} on " in str(caught.value)
        assert caught.value.what == "run-1"
    assert list(path.parent.iterdir()) == []
    with locks.held(path):
        pass


def hold_and_die(path):
    with locks.held(path):
        os.kill(os.getpid(), signal.SIGKILL)


def test_a_killed_holder_holds_no_more(tmp_path):
    path = tmp_path / locks.FILE
    process = FORK.Process(target=hold_and_die, args=(path,))
    process.start()
    process.join(30)
    assert process.exitcode == -signal.SIGKILL
    assert path.exists()
    with locks.held(path):
        pass
    assert not path.exists()


def come_and_go(folder, n):
    """Take the lock n times; whoever finds another's mark inside fails."""
    for _ in range(n):
        while True:
            try:
                with locks.held(folder / locks.FILE):
                    os.close(os.open(folder / "inside", os.O_CREAT | os.O_EXCL))
                    (folder / "inside").unlink()
                break
            except locks.Held:
                pass


def test_never_two_at_once_although_the_file_comes_and_goes(tmp_path):
    processes = [FORK.Process(target=come_and_go, args=(tmp_path, 300)) for _ in range(4)]
    for process in processes:
        process.start()
    for process in processes:
        process.join(60)
    assert [process.exitcode for process in processes] == [0] * 4


def test_without_locks_on_the_file_system_nothing_goes_on(tmp_path, monkeypatch):
    def none(*_):
        raise OSError(errno.ENOLCK, "No locks available")

    monkeypatch.setattr(locks.fcntl, "flock", none)
    with pytest.raises(
        OSError, match=r"expected a file system with locks, found No locks"
    ) as caught:
        locks.held(tmp_path / locks.FILE).__enter__()
    assert str(tmp_path / locks.FILE) in str(caught.value)


def test_who_comes_first_is_alone_and_who_comes_later_is_not(tmp_path):
    path, calls = tmp_path / locks.FILE, []
    with locks.shared(path, lambda: calls.append("first")):
        with locks.shared(path, lambda: calls.append("second")):
            pass
        assert calls == ["first"]
    with locks.shared(path, lambda: calls.append("third")):
        assert calls == ["first", "third"]


# Cores --------------------------------------------------------------------------------------------


@pytest.fixture
def four_cores(monkeypatch):
    monkeypatch.setattr(cores, "available", lambda: [0, 1, 2, 3])
    monkeypatch.setattr(cores, "_POLL_S", 0.01)


def use(n, log, ends, device="cpu"):
    """A run on n cores in a thread; ends when told."""

    def run():
        with cores.held(n, device, lambda: log.append(f"{n} waits")):
            log.append(f"{n} runs")
            ends.wait(20)
            log.append(f"{n} ends")

    thread = threading.Thread(target=run, daemon=True)
    thread.start()
    return thread


def until(condition):
    limit = time.monotonic() + 20
    while not condition():
        assert time.monotonic() < limit
        time.sleep(0.005)


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


def test_more_threads_than_cores_are_all_cores(four_cores):
    log, end = [], threading.Event()
    thread = use(9, log, end)
    until(lambda: log == ["9 runs"])
    other = use(1, log, end)
    until(lambda: "1 waits" in log)
    end.set()
    thread.join(20)
    other.join(20)
    assert log == ["9 runs", "1 waits", "9 ends", "1 runs", "1 ends"]


def test_a_gpu_has_one_run_at_a_time(four_cores, monkeypatch):
    monkeypatch.setattr(cores, "_gpu", lambda device: f"gpu-{device}")
    log, end = [], threading.Event()
    threads = [use(1, log, end, "cuda:0")]
    until(lambda: log == ["1 runs"])
    threads.append(use(2, log, end, "cuda:0"))
    until(lambda: "2 waits" in log)
    threads.append(use(2, log, end, "cuda:1"))
    until(lambda: "2 runs" in log)
    end.set()
    for thread in threads:
        thread.join(20)
