"""Locks: one holder, freed by any end of it."""

from __future__ import annotations

import errno
import fcntl
import multiprocessing
import os
import signal
import time

import pytest

from experiments.records import locks
from tests.experiments.helpers import until

FORK = multiprocessing.get_context("fork")


def test_a_lock_has_one_holder(tmp_path):
    path = tmp_path / "run-1" / "lock"
    for name in ("run-1", "frames"):
        with (
            locks.held(path),
            pytest.raises(locks.Held, match=f"{name}: being run by another"),
        ):
            locks.held(path, name).__enter__()


def hold_and_die(path, seconds):
    with locks.held(path):
        (path.parent / "held").touch()
        time.sleep(seconds)
        os.kill(os.getpid(), signal.SIGKILL)


@pytest.mark.parametrize("seconds", [0, 0.5])
def test_a_killed_holder_holds_no_more_and_who_waits_has_it_then(tmp_path, seconds):
    path = tmp_path / "lock"
    process = FORK.Process(target=hold_and_die, args=(path, seconds))
    process.start()
    until((tmp_path / "held").exists)
    with locks.held(path, timeout_s=30):
        process.join(30)
    assert process.exitcode == -signal.SIGKILL


def test_without_locks_on_the_file_system_nothing_goes_on(tmp_path, monkeypatch):
    def none(*_):
        raise OSError(errno.ENOLCK, "No locks")

    monkeypatch.setattr(fcntl, "flock", none)
    with pytest.raises(OSError, match="No locks"):
        locks.held(tmp_path / "lock").__enter__()
