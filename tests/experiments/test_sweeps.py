"""Sweeps killed, doubled, short of disk or spread over workers end with the same records."""

from __future__ import annotations

import csv
import json
import multiprocessing
import os
import random
import resource
import signal
import subprocess
import sys
import time
from pathlib import Path

import cloudpickle
import hydra
import numpy as np
import psutil
import pytest
import torch

from experiments import locks, measurement, record, run, sweep

CHECKOUT = Path(__file__).resolve().parents[2]


CHOICES = {"scene": "recorded", "model": "hdc", "stop": "paper"}


@pytest.fixture(autouse=True)
def results(tmp_path, monkeypatch):
    monkeypatch.setenv("RESULTS_DIR", str(tmp_path / "results"))
    return tmp_path / "results"


@pytest.fixture(autouse=True)
def one_thread():
    before = torch.get_num_threads()
    torch.set_num_threads(1)  # none to be missed in a forked process
    yield
    torch.set_num_threads(before)


@pytest.fixture
def scene(tmp_path):
    rng = np.random.default_rng(0)
    labels = np.arange(50) % 5
    base = rng.integers(0, 150, (5, 16, 16))
    frames = (base[labels] + rng.integers(0, 90, (50, 16, 16))).astype(np.uint8)
    np.savez(tmp_path / "frames.npz", frames=frames, labels=labels)
    return ("scene=recorded", f"scene.path={tmp_path}/frames.npz")


def outcome(results):
    """Every record and curve without its times, by id; and no other file may be there."""
    found = {}
    for folder in (results / "runs").iterdir():
        assert sorted(path.name for path in folder.iterdir()) == ["curve.csv", "record.json"]
        entry = json.loads((folder / "record.json").read_text())
        with (folder / "curve.csv").open(newline="") as file:
            curve = [{**row, "training_s": ""} for row in csv.DictReader(file)]
        found[folder.name] = (without_times(entry), curve)
    return found


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
    return (record.read_record(folder) or {}).get("status") == "finished"


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


def carry_out_and_die(cfg, n):
    """A run that is killed before its n-th change of a file on disk."""
    left = [n]
    for name in ("fsync", "replace", "unlink"):
        original = getattr(os, name)

        def step(*arguments, original=original, **keywords):
            left[0] -= 1
            if not left[0]:
                os.kill(os.getpid(), signal.SIGKILL)
            return original(*arguments, **keywords)

        setattr(os, name, step)
    run.run(cfg, dict(CHOICES))


def test_a_kill_at_any_write_leaves_whole_files_that_the_next_run_completes(results, scene):
    with hydra.initialize_config_dir(str(CHECKOUT / "configs"), version_base="1.3"):
        forced, cfg = (hydra.compose("config", [*scene, f"force={f}"]) for f in ("true", "false"))
    ids = set()
    for n in range(1, 100):
        process = multiprocessing.get_context("fork").Process(
            target=carry_out_and_die, args=(forced, n)
        )
        process.start()
        process.join(60)
        if process.exitcode == 0:
            break
        assert process.exitcode == -signal.SIGKILL
        (folder,) = (results / "runs").iterdir()
        assert (record.read_record(folder) or {}).get("status") in (None, "running", "finished")
        ids.add(run.run(cfg, dict(CHOICES))["id"])
        assert set(outcome(results)) == ids
    assert n > 8  # begun, curve and record written and named, the lock removed
    assert len(ids) == 1


def test_frames_left_half_made_go_when_nobody_makes_any(results, scene, start):
    (results / "cache").mkdir(parents=True)
    partial = results / "cache" / "tmp123.partial"
    partial.write_bytes(b"half")
    with locks.shared(results / "cache" / locks.FILE, lambda: None):
        process = start(*scene)
        process.join(60)
        assert partial.exists()
    process = start(*scene)
    process.join(60)
    assert not partial.exists()


def short_of_disk(limit):
    resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit))


def test_a_full_disk_is_one_line_and_finished_records_stay(results, scene, start):
    start(*scene).join(60)
    ((name, (entry, _)),) = outcome(results).items()
    content = (results / "runs" / name / "record.json").read_bytes()
    came_out = ("stop", "confusion", "data_sha256", "predicted", "test_indices", "test_labels")
    begun = {key: value for key, value in entry.items() if key not in came_out}
    size = len(json.dumps(begun, indent=1))
    for room in (size - 400, size + 400):  # too little to begin, too little to end
        process = start(*scene, "seed.run=1", before=lambda room=room: short_of_disk(room))
        process.join(60)
        assert process.exitcode == 1
        (line,) = process.out.read_text().splitlines()
        assert line.startswith(f"error: [Errno 27] File too large: '{results}/runs/")
        (other,) = (folder for folder in (results / "runs").iterdir() if folder.name != name)
        assert not finished(other)
        assert {path.name for path in other.iterdir()} <= {"record.json", "curve.csv"}
    start(*scene, "force=true", before=lambda: short_of_disk(size - 400)).join(60)
    assert (results / "runs" / name / "record.json").read_bytes() == content
    start(*scene, "seed.run=1").join(60)
    assert len(outcome(results)) == 2


def test_a_file_in_the_place_of_the_results_is_named(results, scene, start, tmp_path):
    results.write_text("")
    first = start(*scene)
    first.join(60)
    results.unlink()
    results.mkdir()
    (results / "runs").write_text("")
    second = start(*scene)
    second.join(60)
    for process, place in ((first, results / "cache"), (second, results / "runs")):
        assert process.exitcode == 1
        (line,) = process.out.read_text().splitlines()
        assert line.startswith("error: ")
        assert str(place) in line


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
    assert f"{first.name}: being run by another process (process {os.getpid()} on " in text
    assert text.splitlines()[-1] == f"1 left to other processes: {first.name}"
    assert text.count("test accuracy") == 1
    assert record.read_record(second)["status"] == "finished"


def test_two_sweeps_at_once_run_nothing_twice(results, scene, start, tmp_path):
    overrides = ("-m", *scene, "seed.run=0,1,2,3,4,5", "exclusive=false")
    both = [start(*overrides), start(*overrides)]
    for process in both:
        process.join(120)
        assert process.exitcode == 0
    lines = [line for process in both for line in process.out.read_text().splitlines()]
    made = [line for line in lines if line.startswith("  record ") and "before" not in line]
    assert len(made) == len(set(made)) == len(outcome(results)) == 6


def test_a_measurement_that_another_process_is_at_is_left_to_it(results):
    folder = results / "measured" / "some"
    with (
        locks.held(folder / locks.FILE),
        pytest.raises(locks.Held, match="measured/some: being run by another process"),
    ):
        measurement.measure("some", {}, lambda: pytest.fail("measured"))


def test_a_killed_measurement_leaves_rows_that_nothing_vouches_for(results, monkeypatch):
    measurement.measure("some", {"n": 1}, lambda: [{"n": 1}])
    folder = results / "measured" / "some"
    (folder / ".rows.csv.abcdefgh").write_text("half")

    def die(path, text):
        real(path, text)
        if path.name == "rows.csv":
            raise KeyboardInterrupt

    real = record.write_atomically
    with monkeypatch.context() as patch:
        patch.setattr(record, "write_atomically", die)
        with pytest.raises(KeyboardInterrupt):
            measurement.measure("some", {"n": 2}, lambda: [{"n": 2}])
    found = measurement.read(results, "some")
    assert (found.record["status"], found.rows) == ("running", [{"n": "2"}])
    assert sorted(path.name for path in folder.iterdir()) == ["record.json", "rows.csv"]


def test_runs_wait_for_free_cores_unless_told_not_to(scene, start, monkeypatch):
    monkeypatch.setattr("experiments.cores.available", lambda: [0])
    with run.cores.held(1, "cpu", lambda: None):
        waiting, beside = start(*scene), start(*scene, "seed.run=1", "exclusive=false")
        beside.join(60)
        waiting.join(0.5)
        assert waiting.exitcode is None
    waiting.join(60)
    assert (waiting.exitcode, beside.exitcode) == (0, 0)
    assert "exclusive=false runs beside them" in waiting.out.read_text().splitlines()[0]
    assert "waiting" not in beside.out.read_text()
    entries = map(record.read_record, (record.results_dir() / "runs").iterdir())
    told = {e["config"]["seed"]["run"]: e["environment"]["exclusive"] for e in entries}
    assert told == {0: True, 1: False}


# Launchers ----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("launcher", "threads"),
    [
        ({"_target_": "basic"}, 8),
        ({"n_jobs": -1}, 1),
        ({"n_jobs": 4}, 2),
        ({"n_jobs": 100}, 1),
        ({"cpus_per_task": 3}, 3),
        ({"cpus_per_task": 99}, 8),
        ({"cpus_per_task": None}, 8),
    ],
)
def test_a_worker_has_its_share_of_the_cores(monkeypatch, launcher, threads):
    monkeypatch.setattr("experiments.cores.available", lambda: list(range(8)))
    assert run._threads(None, launcher) == threads
    assert run._threads(5, launcher) == 5


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
    entries = [record.read_record(folder) for folder in (results / "runs").iterdir()]
    assert {e["config"]["seed"]["run"]: e["status"] for e in entries} == {
        0: "finished",
        -1: "failed",
    }
    for entry in entries:
        assert entry["config"]["threads"] == entry["environment"]["threads"] == 1


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
