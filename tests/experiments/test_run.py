"""The command line: what it prints, how it ends, and that an error of the user's is one line."""

import json
import os
import re
import shlex
import signal
import subprocess
import sys
import time

import cv2
import numpy as np
import pytest

import hdc
from experiments import run
from experiments.records import locks, store
from experiments.records.files import ROOT
from tests.experiments.composed import tree
from tests.experiments.helpers import until

HEAVY = (
    "cv2",
    "sklearn",
    "pandas",
    "matplotlib",
    "scipy",
    "baselines.cnn",
)
pytestmark = pytest.mark.usefixtures("results", "one_thread")


@pytest.fixture
def command_line(tmp_path):
    """command_line(*overrides) → how a process of its own ended, started in tmp_path/cwd."""
    (tmp_path / "cwd").mkdir()

    def call(*overrides, script=None, **environment):
        command = ["-c", script] if script else ["-m", "experiments.run"]
        return subprocess.run(
            [sys.executable, *command, *overrides, "threads=1"],
            cwd=tmp_path / "cwd",
            capture_output=True,
            text=True,
            timeout=120,
            env={**os.environ, "PYTHONPATH": str(ROOT), **environment},
        )

    return call


@pytest.fixture
def said(start):
    """said(*overrides) → exit code and lines of a command line in a forked process."""

    def call(*overrides, **keywords):
        process = start(*overrides, "exclusive=false", **keywords)
        process.join(60)
        return process.exitcode, process.out.read_text().splitlines()

    return call


def entries(results):
    return list(store.read(results))


# The process --------------------------------------------------------------------------------------


IMPORTED = """
import warnings
import hydra, torch, rich  # which change warnings themselves
from omegaconf import OmegaConf
before = list(warnings.filters), warnings.showwarning
from experiments.run import CommandLine
print(before == (warnings.filters, warnings.showwarning))
print(OmegaConf.has_resolver("results_dir"))
CommandLine().carry_out({})
print(before == (warnings.filters, warnings.showwarning))
"""


def test_neither_import_nor_a_run_changes_warnings_for_good(command_line):
    done = command_line(script=IMPORTED)
    assert done.stdout.split() == ["True", "False", "True"], done.stderr


@pytest.mark.parametrize(
    ("words", "keys"),
    [
        (["model.device=cpu", "~model.backend"], ["model.device", "model.backend"]),
        (["experiment=drift", "scene=touch"], ["experiment", "scene"]),
        (
            ["experiment=robustness", "+model@task.models.cnn1=cnn1"],
            ["experiment", "task.models.cnn1"],
        ),
        (["experiment=times"], ["experiment", "stop.budget_s"]),
    ],
    ids=str,
)
def test_what_was_chosen_and_set_is_known_from_the_words_and_the_experiments_file(
    words, keys
):
    asked = run._asked(tree(*words, with_hydra=True).hydra)
    assert list(asked.keys) == keys
    assert asked.choices["model"] == "hdc"


@pytest.mark.parametrize(
    ("words", "without_effect"),
    [
        (["experiment=drift", "seed.run=3", "split.n_train=9"], ["seed.run=3"]),
        (["experiment=robustness", "scene.seed=3", "model=ridge"], ["model=ridge"]),
        (["seed.run=3", "model=ridge"], []),
    ],
    ids=str,
)
def test_words_on_which_an_experiment_does_not_depend_are_known(words, without_effect):
    cfg = tree(*words, with_hydra=True)
    assert list(run._without_effect(cfg, cfg.hydra.overrides.task)) == without_effect


# Runs ---------------------------------------------------------------------------------------------


def test_a_folder_of_images_from_another_directory(
    tmp_path, results, frames_and_labels, command_line
):
    frames, labels = frames_and_labels(30, 3, 24)
    for k, (frame, label) in enumerate(zip(frames, labels, strict=True)):
        folder = tmp_path / "my frames" / "abc"[label]
        folder.mkdir(parents=True, exist_ok=True)
        cv2.imwrite(str(folder / f"{k:03}.png"), frame)
    done = command_line("scene=recorded", "scene.path='../my frames'", "model=hdc")
    assert done.returncode == 0, done.stderr
    # Files of a folder are in the order of their names.
    (warned,) = done.stderr.splitlines()
    assert warned.startswith("warning: split.kind=random: 100 % of the test frames")
    assert "\x1b" not in done.stdout  # no colours, bars or cursor movements into a pipe
    assert re.search(r"test accuracy [\d.]+ % \[.*, .*\]", done.stdout)
    (entry,) = entries(results)
    assert (entry.status, entry.environment.threads) == ("finished", 1)
    assert json.loads(entry.results["classes"]) == ["a", "b", "c"]
    words = ["scene=recorded", "scene.path='../my frames'", "model=hdc", "threads=1"]
    assert entry.command == shlex.join(["python", "-m", "experiments.run", *words])
    assert list((tmp_path / "cwd").iterdir()) == []


LOADED = f"""
import sys
from experiments.run import entry_point
try:
    entry_point()
except SystemExit as end:
    print("exit", end.code, "loaded", [name for name in {HEAVY!r} if name in sys.modules])
"""


def test_an_hdc_run_on_the_simulated_sensor_loads_nothing_heavy(results, command_line):
    done = command_line("scene=touch", "scene.samples_per_class=5", script=LOADED)
    assert done.stdout.splitlines()[-1] == "exit 0 loaded []", done.stdout + done.stderr
    assert "\x1b" not in done.stdout
    assert done.stderr == ""
    (entry,) = entries(results)
    assert entry.results["origin"] == "simulated"
    assert len(list((results / "cache").glob("*.npy"))) == 1


def test_a_finished_run_is_one_line_and_not_made_again(results, recording, said):
    words = ("scene=recorded", f"scene.path={recording()}")
    said(*words)
    code, (line,) = said(*words)
    assert code == 0
    assert "finished before (force=true runs it again)" in line


def test_a_sweep_says_each_run_and_its_end_and_repeats_no_warning(
    results, recording, said
):
    path = recording()
    with np.load(path) as held:
        frames, labels = held["frames"], held["labels"]
    order = np.argsort(labels, kind="stable")  # neighbours in time are of one class
    np.savez(path, frames=frames[order], labels=labels[order])
    code, lines = said("-m", "scene=recorded", f"scene.path={path}", "seed.run=0,1,2")
    assert code == 0
    assert lines[0] == "Launching 3 jobs locally"
    (last,) = [line for line in lines if line.strip().startswith("#2 : ")]
    assert "seed.run=2" in last
    assert sum(line.startswith("warning: split.kind=random") for line in lines) == 1
    assert lines[-1].startswith(f"records: {results}")


def test_a_task_that_another_process_is_at_is_left_to_it_and_the_exit_status_says_so(
    said,
):
    def taken(*_, **__):
        raise locks.Held("it: being run by another process")

    def before():  # in the process of the command line alone
        locks.held = taken

    code, lines = said("experiment=correlation", before=before)
    assert code == locks.LEFT
    assert lines[-1:] == ["it: being run by another process"]


# What the user did wrong --------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("overrides", "expected"),
    [
        (
            ["model=hcd"],
            r"error: model: expected one of .*hdc, .*, found hcd; did you mean hdc\?",
        ),
        (
            ["scene.path=???"],
            r"error: Missing mandatory value: path, full_key: scene\.path",
        ),
        (
            ["scene.colour=1"],
            r"error: Could not override 'scene\.colour'.*, To append .*",
        ),
        (
            ["+scene.colour=1"],
            r"error: scene: .*unexpected keyword argument 'colour'.*",
        ),
        (
            ["model._target_=nowhere.Model"],
            r"error: Error locating target 'nowhere\.Model', full_key: model",
        ),
        (
            ["+task={_target_: os.system, command: 'true'}"],
            r"error: task\._target_: expected .* a Task, found os\.system, which is none",
        ),
    ],
    ids=lambda given: given[0] if isinstance(given, list) else None,
)
def test_an_error_of_the_users_is_one_line_that_names_the_key(
    recording, said, overrides, expected
):
    code, lines = said("scene=recorded", f"scene.path={recording()}", *overrides)
    assert code == 1
    told = [line for line in lines if line.startswith("error: ")]
    assert re.fullmatch(expected, "\n".join(told)), lines
    assert len(told) == 1
    assert max(map(len, lines)) < 1000


def test_results_that_cannot_be_written_are_one_line_a_run(tmp_path, recording, said):
    place = tmp_path / "file"
    place.write_text("")
    words = ("-m", "seed.run=0,1", "scene=recorded", f"scene.path={recording()}")
    code, lines = said(*words, environment={"RESULTS_DIR": str(place)})
    assert code == 1
    assert {line.partition(" ")[0] for line in lines} == {"error:"}
    assert all(str(place) in line for line in lines)


# Ended from outside -------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("end", "code"), [(signal.SIGTERM, 143), (signal.SIGINT, 130)], ids=["term", "int"]
)
def test_a_run_that_is_ended_is_recorded_and_run_again(
    recording, tmp_path, results, start, said, end, code
):
    """A killed one leaves no record: tests/experiments/test_sweeps.py."""

    class Stuck(hdc.HDCClassifier):
        def train(self, frames, labels):
            yield {"samples_seen": len(self.fit(frames, labels).counts_)}
            if labels.max() > 1:  # not the warm-up
                (tmp_path / "stuck").touch()
                time.sleep(100)

    def before():  # in the process of the command line alone
        hdc.HDCClassifier = Stuck

    words = ("scene=recorded", f"scene.path={recording()}")
    process = start(*words, "exclusive=false", before=before)
    until((tmp_path / "stuck").exists)
    os.kill(process.pid, end)
    process.join(30)
    assert process.exitcode == code
    assert [entry.status for entry in entries(results)] == ["interrupted"]
    said(*words)
    (again,) = entries(results)
    assert again.status == "finished"
