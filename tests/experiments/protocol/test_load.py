"""The load of the machine: what others did is seen, and what oneself did is not."""

import subprocess
import sys
import time

import pytest
import torch

from experiments.protocol import load
from experiments.protocol.load import Limits, Load, Retries, Watch


@pytest.mark.parametrize(("ticks", "steal"), [(100, 0), (60, 40)])
def test_what_others_and_other_machines_took_is_a_share_of_all_cores(
    tmp_path, monkeypatch, ticks, steal
):
    file = tmp_path / "stat"
    monkeypatch.setattr(load, "STAT", file)
    monkeypatch.setattr(load.os, "sysconf", lambda _: 100)
    monkeypatch.setattr(load.os, "cpu_count", lambda: 2)
    monkeypatch.setattr(load, "_own_seconds", iter([1.0, 1.5]).__next__)

    def write(user, steal=0):
        file.write_text(f"cpu  {user} 0 0 99999 7 0 0 {steal} 0 0\ncpu0 1 2 3\n")

    write(500)
    watch = Watch((1,))
    clock = iter([0.0, 5.0])
    monkeypatch.setattr(watch, "_yardsticks", lambda: {1: 0.02})
    monkeypatch.setattr(load.time, "perf_counter", lambda: next(clock))
    watch._least = {1: 0.01}
    with watch.watching():
        write(550 + ticks, steal)
    # Half a second was its own; 1 s of the 10 s that two cores had in 5 s was not.
    assert watch.load == Load(pytest.approx(0.1), {1: pytest.approx(2.0)})


def test_another_process_is_seen():
    watch, before = Watch((1, 2)), torch.get_num_threads()
    if load._counters() is None:
        pytest.skip("the system has no /proc/stat")
    other = subprocess.Popen([sys.executable, "-c", "while True: pass"])
    try:
        with watch.watching():
            counters = load._counters()
            while load._counters() - counters < 1.0:  # some process was busy for 1 s
                time.sleep(0.1)
    finally:
        other.kill()
        other.wait()
    assert watch.load.others > 0.05
    assert min(watch.load.yardstick.values()) >= 1
    assert torch.get_num_threads() == before


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


def test_the_budget_is_one_for_all_and_is_not_spent_by_first_attempts(monkeypatch):
    now = [0.0]
    monkeypatch.setattr(load.time, "perf_counter", lambda: now[0])

    def attempts(retries, reasons, took, **more):
        """The numbers of those that are made, each of which takes so long."""

        def measure(attempt):
            now[0] += took
            return attempt

        return list(retries.attempts(measure, reasons.__getitem__, **more))

    retries, busy = Retries(2, 60), ["busy"] * 3
    assert attempts(retries, busy, 100) == [0]
    assert attempts(retries, [load.NOT_MEASURED, "x"], 0) == [
        0
    ]  # not mended by another
    # Found finished: another takes longer.
    assert attempts(retries, busy, 0, expected_s=61) == [0]
    assert attempts(retries, busy, 25) == [0, 1, 2]
    assert attempts(retries, busy, 25) == [0]
    assert attempts(retries, busy, 10) == [0, 1]
