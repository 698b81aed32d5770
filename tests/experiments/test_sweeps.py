"""Sweeps killed, doubled, short of disk or spread over workers end with the same records."""

from __future__ import annotations

import json
import os
import random
import signal
import subprocess
import sys
import time

import psutil
import pytest
from rich.console import Console

from experiments.protocol import machine
from experiments.records import store
from experiments.records.files import ROOT
from experiments.records.locks import LEFT
from experiments.records.record import Record

pytestmark = pytest.mark.usefixtures("results", "one_thread")


@pytest.fixture
def scene(recording):
    """The overrides for a small recording."""
    return ("scene=recorded", f"scene.path={recording()}")


def outcome(results):
    """Every finished record without its times, by id."""
    runs = [run for run in store.read(results) if isinstance(run, Record)]
    return {run.id: without_times(run) for run in runs if run.is_finished}


def without_times(run):
    entry = json.loads(store.to_line(run))
    del entry["seconds"]
    rows = [
        {k: v for k, v in row.items() if not k.endswith(("_s", "_per_frame"))}
        for row in run.rows.dicts()
    ]
    return entry | {"rows": rows}


def kill_after(process, results, n, seconds):
    """SIGKILL when n runs are finished and it has computed on for so long."""
    watched, since = psutil.Process(process.pid), None
    while process.is_alive():
        computed = sum(watched.cpu_times()[:2])
        if since is None and len(outcome(results)) >= n:
            since = computed
        if since is not None and computed >= since + seconds:
            break
        time.sleep(0.002)
    process.kill()
    process.join()
    assert process.exitcode == -signal.SIGKILL


@pytest.mark.parametrize(
    ("runs", "kills"), [(8, 3), pytest.param(20, 10, marks=pytest.mark.slow)]
)
def test_a_killed_sweep_ends_with_the_records_of_one_left_alone(
    results, scene, start, tmp_path, runs, kills
):
    overrides = ("-m", *scene, f"seed.run={','.join(map(str, range(runs)))}")
    alone = start(*overrides, environment={"RESULTS_DIR": str(tmp_path / "alone")})
    alone.join(120)
    moments, kept = random.Random(0), {}
    for _ in range(kills):
        progress = len(kept) + moments.choice([0, 1])
        kill_after(start(*overrides), results, progress, moments.uniform(0, 0.1))
        done = outcome(results)
        assert kept.items() <= done.items()
        kept = done
    assert 0 < len(kept) < runs
    last = start(*overrides)
    last.join(120)
    assert last.exitcode == 0
    assert outcome(results) == outcome(tmp_path / "alone")
    assert len(outcome(results)) == runs


def die_at(n):
    """A kill before the n-th change of a file on disk."""
    left = [n]
    for name in ("fsync", "replace", "unlink"):
        original = getattr(os, name)

        def step(*arguments, original=original, **keywords):
            left[0] -= 1
            if not left[0]:
                os.kill(os.getpid(), signal.SIGKILL)
            return original(*arguments, **keywords)

        setattr(os, name, step)


def test_a_kill_at_any_write_leaves_runs_that_the_next_call_completes(
    results, scene, start
):
    for n in range(1, 100):
        process = start(*scene, f"seed.run={n}", before=lambda n=n: die_at(n))
        process.join(60)
        if process.exitcode == 0:
            break
        assert process.exitcode == -signal.SIGKILL
        start(*scene, f"seed.run={n}").join(60)
        assert len(outcome(results)) == n
    assert n > 1  # the record written
    assert len(outcome(results)) == n


def test_two_sweeps_at_once_run_nothing_twice(results, scene, start):
    overrides = ("-m", *scene, "seed.run=0,1,2,3,4,5", "exclusive=false")
    both = [start(*overrides), start(*overrides)]
    for process in both:
        process.join(120)
        assert process.exitcode in (0, LEFT)  # it left runs to the other one
    assert (
        len((results / store.FILE).read_bytes().splitlines())
        == len(outcome(results))
        == 6
    )


def test_runs_wait_for_free_cores_unless_told_not_to(
    results, scene, start, monkeypatch
):
    monkeypatch.setattr(machine, "available", lambda: [0])
    with machine.held(1, "cpu", Console(quiet=True)):
        waiting, beside = start(*scene), start(*scene, "seed.run=1", "exclusive=false")
        beside.join(60)
        waiting.join(0.5)
        assert waiting.exitcode is None
    waiting.join(60)
    assert (waiting.exitcode, beside.exitcode) == (0, 0)
    assert "exclusive=false runs beside it" in waiting.out.read_text().replace(
        "\n", " "
    )
    assert "waiting" not in beside.out.read_text()
    exclusive = {
        entry.config["seed"]["run"]: entry.environment.exclusive
        for entry in store.read(results)
    }
    assert exclusive == {0: True, 1: False}


@pytest.mark.slow
def test_workers_of_a_launcher_run_a_sweep_and_name_its_failures(results, scene):
    done = subprocess.run(
        [sys.executable, "-m", "experiments.run", "-m", "hydra/launcher=joblib", *scene,
         "seed.run=0,-1"],
        capture_output=True, text=True, timeout=120,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
    )  # fmt: skip
    assert done.returncode == 1
    assert "Traceback" not in done.stderr
    assert "seed.run: expected an integer >= 0, found -1" in done.stderr
    (entry,) = store.read(results)
    assert (entry.config["seed"]["run"], entry.status) == (0, "finished")
    assert entry.config["threads"] == entry.environment.threads == 1
