"""The load of the machine: what others did is seen, and what oneself did is not."""

import multiprocessing
import time

import numpy as np
import pytest
import torch

from experiments.protocol import load
from experiments.protocol.load import Limits, Load, Retries, Watch


def spin(seconds):
    end = time.perf_counter() + seconds
    while time.perf_counter() < end:
        np.dot(np.ones(1000), np.ones(1000))


def stat(tmp_path, monkeypatch):
    """A file of counters in place of the system's; returns what writes it."""
    file = tmp_path / "stat"
    monkeypatch.setattr(load, "STAT", file)
    monkeypatch.setattr(load.os, "sysconf", lambda _: 100)
    monkeypatch.setattr(load.os, "cpu_count", lambda: 2)

    def write(user, steal=0):
        file.write_text(f"cpu  {user} 0 0 99999 7 0 0 {steal} 0 0\ncpu0 1 2 3\n")

    return write


@pytest.mark.parametrize(("ticks", "steal"), [(100, 0), (60, 40)])
def test_what_others_and_other_machines_took_is_a_share_of_all_cores(
    tmp_path, monkeypatch, ticks, steal
):
    write = stat(tmp_path, monkeypatch)
    write(500)
    watch = Watch((1,))
    monkeypatch.setattr(load, "_own_seconds", lambda: 0.0)
    clock = iter([0.0, 5.0])
    monkeypatch.setattr(watch, "_yardsticks", lambda: {1: 0.02})
    monkeypatch.setattr(load.time, "perf_counter", lambda: next(clock))
    watch._least = {1: 0.01}
    with watch.watching():
        write(500 + ticks, steal)
    # 1 s of the 10 s that two cores had in 5 s
    assert watch.load == Load(pytest.approx(0.1), {1: pytest.approx(2.0)})


def test_ones_own_work_is_no_load_of_others_and_threads_are_as_before():
    before = torch.get_num_threads()
    watch = Watch()
    with watch.watching():
        own, end = load._own_seconds(), time.perf_counter() + 20
        while load._own_seconds() - own < 0.3 and time.perf_counter() < end:
            spin(0.1)
        assert load._own_seconds() - own >= 0.3
    assert torch.get_num_threads() == before
    assert min(watch.load.yardstick.values()) >= 1


def test_another_process_is_seen():
    watch = Watch((1,))
    if load._counters() is None:
        pytest.skip("the system has no /proc/stat")
    with watch.watching():
        time.sleep(0.2)
    quiet = watch.load.others
    other = multiprocessing.get_context("spawn").Process(target=spin, args=(6.0,))
    other.start()
    with watch.watching():
        counters = load._counters()
        while load._counters() - counters < 1.0:  # until some process was busy for 1 s
            time.sleep(0.1)
    other.kill()
    other.join()
    assert watch.load.others > 0.05 or quiet > 0.5


@pytest.mark.parametrize(
    ("found", "reason"),
    [
        (Load(0.01, {1: 1.05, 2: 1.09}), ""),
        (Load(0.03, {1: 1.0}), "others took 3% of the processor time"),
        (
            Load(0.0, {1: 1.0, 2: 1.2}),
            "a fixed piece of work took 1.20 times its least",
        ),
        (Load(None, {1: 1.0}), "load not measured"),
    ],
)
def test_a_disturbed_group_says_why(found, reason):
    assert Limits(others=0.02, yardstick=1.1).reason(found) == reason


# Measuring again ----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("reasons", "took", "budget_s", "attempts"),
    [
        (["x", "", "x"], 5, 60, 2),  # until nothing does
        (["x", "x", "x", "x"], 5, 60, 3),  # two more at most
        (["x", "x", "x"], 25, 30, 2),  # the second more would exceed the budget
        ([load.NOT_MEASURED, "x"], 5, 60, 1),  # which another attempt does not mend
    ],
)
def test_what_was_disturbed_is_measured_again_within_a_budget(
    monkeypatch, reasons, took, budget_s, attempts
):
    now = [0.0]
    monkeypatch.setattr(load.time, "perf_counter", lambda: now[0])

    def measure(attempt):
        now[0] += took
        return attempt, reasons[attempt]

    retries = Retries(2, budget_s)
    made = list(retries.attempts(measure, lambda each: each[1]))
    assert made == list(enumerate(reasons))[:attempts]


def test_the_budget_is_one_for_all_and_is_not_spent_by_first_attempts(monkeypatch):
    now = [0.0]
    monkeypatch.setattr(load.time, "perf_counter", lambda: now[0])

    def attempts(took, **more):
        def measure(attempt):
            now[0] += took
            return attempt

        return list(retries.attempts(measure, lambda _: "busy", **more))

    retries = Retries(2, 60)
    assert attempts(100) == [0]
    assert attempts(0, expected_s=61) == [0]  # found finished: another takes longer
    assert attempts(25) == [0, 1, 2]
    assert attempts(25) == [0]
    assert attempts(10) == [0, 1]
