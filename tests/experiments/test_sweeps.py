"""Sweeps killed, doubled, short of disk or spread over workers end with the same records."""

from __future__ import annotations

import csv
import json
import os
import random
import resource
import signal
import subprocess
import sys
import time
from pathlib import Path

import cloudpickle
import psutil
import pytest
from msgspec.structs import fields

from experiments import run
from experiments.protocol import machine
from experiments.records import locks, sweep
from experiments.records.record import Finished, Record, read_record, to_json

CHECKOUT = Path(__file__).resolve().parents[2]


pytestmark = pytest.mark.usefixtures("results", "one_thread")


@pytest.fixture
def scene(recording):
    """The overrides for a small recording."""
    return ("scene=recorded", f"scene.path={recording()}")


def outcome(results):
    """Every record and curve without its times, by id; and no other file may be there."""
    found = {}
    for folder in (results / "runs").iterdir():
        assert {path.name for path in folder.iterdir()} == {locks.FILE, "curve.csv", "record.json"}
        entry = json.loads((folder / "record.json").read_text())
        with (folder / "curve.csv").open(newline="") as file:
            curve = [{**row, "training_s": ""} for row in csv.DictReader(file)]
        found[folder.name] = (without_times(entry), curve)
    return found


def runs_of(results):
    return sorted((results / "runs").iterdir())


def without_times(entry):
    return {k: v for k, v in entry.items() if not k.endswith(("_s", "_per_frame"))}


def kill_after(process, folder, n, seconds):
    """SIGKILL when n runs are finished and it has computed on for so long."""
    watched, since = psutil.Process(process.pid), None
    while process.is_alive():
        computed = sum(watched.cpu_times()[:2])
        if since is None and sum(map(finished, folder.glob("*"))) >= n:
            since = computed
        if since is not None and computed >= since + seconds:
            break
        time.sleep(0.002)
    process.kill()
    process.join()
    assert process.exitcode == -signal.SIGKILL


def finished(folder):
    return isinstance(read_record(folder), Finished)


# Interruption -------------------------------------------------------------------------------------


@pytest.mark.parametrize(("runs", "kills"), [(8, 3), pytest.param(20, 10, marks=pytest.mark.slow)])
def test_a_killed_sweep_ends_with_the_records_of_one_left_alone(
    results, scene, start, tmp_path, runs, kills
):
    overrides = ("-m", *scene, f"seed.run={','.join(map(str, range(runs)))}")
    alone = start(*overrides, environment={"RESULTS_DIR": str(tmp_path / "alone")})
    alone.join(120)
    moments = random.Random(0)
    kept = {}
    for _ in range(kills):
        progress = len(kept) + moments.choice([0, 1])
        kill_after(start(*overrides), results / "runs", progress, moments.uniform(0, 0.1))
        for folder in (results / "runs").glob("*"):
            if finished(folder):  # and stays as it is, to the byte
                files = {
                    name: (folder / name).read_bytes() for name in ("record.json", "curve.csv")
                }
                assert kept.setdefault(folder.name, files) == files
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


def test_a_kill_at_any_write_leaves_whole_files_that_the_next_run_completes(
    results, carry_out, recording, start
):
    path = recording()
    carry_out(scene=path)
    words = ("scene=recorded", f"scene.path={path}", "force=true")
    for n in range(1, 100):
        process = start(*words, before=lambda n=n: die_at(n))
        process.join(60)
        if process.exitcode == 0:
            break
        assert process.exitcode == -signal.SIGKILL
        (folder,) = (results / "runs").iterdir()
        assert read_record(folder).status in ("running", "finished")
        entry = carry_out(scene=path)
        assert set(outcome(results)) == {entry.id}
    assert n > 6  # begun, curve and record written and named


def short_of_disk(limit):
    resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit))


def test_a_full_disk_is_one_line_and_finished_records_stay(results, scene, start):
    start(*scene).join(60)
    ((name, (entry, _)),) = outcome(results).items()
    content = (results / "runs" / name / "record.json").read_bytes()
    began = [f.name for f in fields(Record) if f.name in entry]
    size = len(to_json({key: entry[key] for key in began}))
    for room in (size - 300, size + 300):  # too little to begin, too little to end
        process = start(*scene, "seed.run=1", before=lambda room=room: short_of_disk(room))
        process.join(60)
        assert process.exitcode == 1
        (line,) = process.out.read_text().splitlines()
        assert line.startswith(f"error: [Errno 27] File too large: '{results}/runs/")
        (other,) = (folder for folder in (results / "runs").iterdir() if folder.name != name)
        assert not finished(other)
        assert {path.name for path in other.iterdir()} <= {locks.FILE, "record.json", "curve.csv"}
    start(*scene, "force=true", before=lambda: short_of_disk(size - 400)).join(60)
    assert (results / "runs" / name / "record.json").read_bytes() == content
    start(*scene, "seed.run=1").join(60)
    assert len(outcome(results)) == 2


def test_a_sweep_that_has_no_room_to_begin_is_one_line(results, scene, start):
    process = start("-m", *scene, "seed.run=0,1", before=lambda: short_of_disk(1000))
    process.join(60)
    assert process.exitcode == 1
    (line,) = process.out.read_text().splitlines()
    assert line == f"error: [Errno 27] File too large: '{results}'"


def test_a_sweep_goes_on_after_a_run_that_diverges(results, scene, start):
    process = start("-m", *scene, "model=softmax_raw", "model.lr=1e38,1e-4")
    process.join(60)
    assert process.exitcode == 0
    assert "(diverged)" in process.out.read_text()
    runs = {entry.config["model"]["lr"]: entry for entry in map(read_record, runs_of(results))}
    assert runs[1e38].stop == "diverged"
    assert runs[1e-4].stop != "diverged"
    assert runs[1e-4].train_accuracy_final == 1


# Several processes --------------------------------------------------------------------------------


def test_a_run_that_another_process_is_at_is_left_to_it(results, scene, start):
    seeds = ("-m", *scene, "seed.run=0,1")
    start(*seeds).join(60)
    first, second = sorted((results / "runs").iterdir())
    with locks.held(first / locks.FILE):
        process = start(*seeds, "force=true")
        process.join(60)
    text = process.out.read_text()
    assert process.exitcode == 0
    assert f"{first.name}: being run by another process" in text
    assert text.splitlines()[-1] == f"1 left to other processes: {first.name}"
    assert text.count("test accuracy") == 1
    assert finished(second)


def test_two_sweeps_at_once_run_nothing_twice(results, scene, start, tmp_path):
    overrides = ("-m", *scene, "seed.run=0,1,2,3,4,5", "exclusive=false")
    both = [start(*overrides), start(*overrides)]
    for process in both:
        process.join(120)
        assert process.exitcode == 0
    lines = [line for process in both for line in process.out.read_text().splitlines()]
    made = [line for line in lines if line.startswith("  record ") and "before" not in line]
    assert len(made) == len(set(made)) == len(outcome(results)) == 6


def test_runs_wait_for_free_cores_unless_told_not_to(results, scene, start, monkeypatch):
    monkeypatch.setattr(machine, "available", lambda: [0])
    with machine.held(1, "cpu", lambda: None):
        waiting, beside = start(*scene), start(*scene, "seed.run=1", "exclusive=false")
        beside.join(60)
        waiting.join(0.5)
        assert waiting.exitcode is None
    waiting.join(60)
    assert (waiting.exitcode, beside.exitcode) == (0, 0)
    assert "exclusive=false runs beside them" in waiting.out.read_text().splitlines()[0]
    assert "waiting" not in beside.out.read_text()
    told = {e.seed: e.environment.exclusive for e in map(read_record, runs_of(results))}
    assert told == {0: True, 1: False}


# Launchers ----------------------------------------------------------------------------------------


def test_launchers_can_send_the_job_to_their_workers():
    assert cloudpickle.loads(cloudpickle.dumps(run.main.__wrapped__)).__name__ == "main"


@pytest.mark.slow
@pytest.mark.parametrize("launcher", ["joblib", "submitit_local"])
def test_workers_of_a_launcher_run_a_sweep_and_its_failures_are_told(results, scene, launcher):
    done = subprocess.run(
        [sys.executable, "-m", "experiments.run", "-m", f"hydra/launcher={launcher}", *scene,
         "seed.run=0,-1"],
        capture_output=True, text=True, timeout=120,
        env={**os.environ, "PYTHONPATH": str(CHECKOUT)},
    )  # fmt: skip
    assert done.returncode == 1
    assert "Traceback" not in done.stderr
    assert "Warning" not in done.stderr
    *_, last = done.stderr.strip().splitlines()
    assert last.startswith("error: scene=recorded")
    assert last.endswith("seed.run=-1: ValueError: split.seed: expected an integer ≥ 0, found -1")
    entries = [read_record(folder) for folder in runs_of(results)]
    assert {e.seed: e.status for e in entries} == {0: "finished", -1: "failed"}
    for entry in entries:
        assert entry.config["threads"] == entry.environment.threads == 1


def test_notes_come_back_in_order_and_are_forgotten(results, monkeypatch):
    assert not sweep.note(sweep.LEFT, "nobody asked")
    monkeypatch.setenv(sweep._VARIABLE, "")  # for monkeypatch to remove
    sweep.begin()
    assert sweep.notes(sweep.LEFT) == []
    for text in ("b", "a"):
        assert sweep.note(sweep.LEFT, text)
    assert sweep.note(sweep.FAILED, "c")
    assert (sweep.notes(sweep.LEFT), sweep.notes(sweep.FAILED)) == (["b", "a"], ["c"])
    sweep.end()
    assert list((results / "cache" / "hydra").iterdir()) == []
    assert not sweep.note(sweep.LEFT, "over")
