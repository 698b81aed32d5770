"""Records made up for tests of tables and figures: configurations as composed, results chosen."""

from __future__ import annotations

import copy
import io
import multiprocessing
import os
import sys
import tempfile
from functools import partial

import numpy as np
import pytest
import torch
from rich.console import Console

import hdc
from experiments import report, run, studies
from experiments.protocol import runner
from experiments.protocol.settings import resolved
from experiments.records.environment import environment
from experiments.records.files import REFERENCE
from experiments.records.results import Results
from experiments.reporting.answers import Answers
from experiments.reporting.study import studies as studies_of
from tests.experiments import made_up
from tests.experiments.composed import tree


@pytest.fixture(autouse=True)
def cores_of_its_own(tmp_path_factory, monkeypatch):
    """No test waits for the cores that a run outside of it holds."""
    monkeypatch.setenv("TMPDIR", str(tmp_path_factory.mktemp("cores")))
    monkeypatch.setattr(tempfile, "tempdir", None)


@pytest.fixture(scope="session")
def committed_results():
    """The records of the committed reference; nobody may change them."""
    return Results(REFERENCE)


@pytest.fixture(scope="session")
def committed(committed_results):
    """Tables and figures of the committed reference, made once; nobody may change them."""
    return Answers("reference", committed_results, studies_of(studies))


@pytest.fixture
def beside_the_reference(committed, monkeypatch):
    """Reports have the tables of the committed reference without making them again."""

    def answers(name, results, questions, *only):
        return (
            committed
            if name == "reference"
            else Answers(name, results, questions, *only)
        )

    monkeypatch.setattr(report, "Answers", answers)


@pytest.fixture
def answers(tmp_path):
    """answers(*studies) → what they answer from the records in tmp_path; nothing may fail."""
    asked = []

    def ask(*questions):
        asked.append(Answers("mine", Results(tmp_path), questions))
        return asked[-1]

    yield ask
    for each in asked:
        assert [str(failure) for failure in each.failures] == []


@pytest.fixture
def start(tmp_path):
    """start(*overrides) → a process that carries out the command line; what it says is at .out.

    Forked, so that it does not import everything anew, which takes longer than a small run.

    Keyword arguments: ``environment``, set for it; ``before``, called in it first.
    """
    begun = []
    environment("cpu", 1)  # is remembered

    def launch(*overrides, environment=None, before=None):
        out = tmp_path / f"output-{len(begun)}"
        process = multiprocessing.get_context("fork").Process(
            target=_command_line, args=(out, overrides, environment or {}, before)
        )
        process.start()
        process.out = out
        begun.append(process)
        return process

    yield launch
    for process in begun:
        process.kill()
        process.join()


def _command_line(out, overrides, environment, before):
    sys.stdout = sys.stderr = out.open("w", buffering=1)
    os.environ.update(environment)
    sys.argv = ["run.py", *overrides, "threads=1"]
    torch.set_num_threads(1)
    if before:
        before()
    run.entry_point()


@pytest.fixture(scope="session")
def compose():
    """compose(*words) → the config that Hydra composes of a command line."""
    return lambda *words: copy.deepcopy(tree(*words))


@pytest.fixture
def write_run(tmp_path):
    """write_run(model, …) → id of a record in tmp_path, as the runner would have left it."""
    return partial(made_up.run, tmp_path)


@pytest.fixture
def write_measurement(tmp_path):
    """write_measurement(name, rows, …) leaves a measurement in tmp_path, as the runner would."""
    return partial(made_up.measurement, tmp_path)


@pytest.fixture(scope="session")
def epochs():
    """epochs(*training accuracies, step, test) → the curve of an iterative model.

    It has one report each `step` seconds.
    """

    def curve(*accuracies, step=10.0, test=None):
        reports = zip(accuracies, test or accuracies, strict=True)
        return [
            {"training_s": step * k, "samples_seen": 400 * k, "loss": 1.0 / k,
             "train_accuracy": train, "test_accuracy": tested}
            for k, (train, tested) in enumerate(reports, 1)
        ]  # fmt: skip

    return curve


@pytest.fixture
def a_full_set(write_run, epochs):
    """Records of several models, seeds, sizes and dimensions, one failed and some missing."""
    for seed in (0, 1):
        write_run("hdc", seed=seed)
        curve = epochs(0.5, 0.95, 0.99, step=1 + seed)
        write_run("softmax", seed=seed, wrong=range(3), curve=curve)
        for n in (5, 20):
            write_run("hdc", seed=seed, n_train=n, wrong=range(40 // n * 5))
        for pixels in (100, 1000):
            write_run("hdc", seed=seed, pixels=pixels, wrong=range(5000 // pixels))
    write_run("cnn3", status="failed")


@pytest.fixture
def small_scene():
    """Configuration of a scene of two classes on a small simulated sensor."""
    return {
        "_target_": "scenes.sensor.scene.SpeckleScene",
        "seed": 0,
        "samples_per_class": 8,
        "sensor": {
            "_target_": "scenes.sensor.sensor.Sensor",
            "seed": 0,
            "camera": {
                "_target_": "scenes.sensor.camera.Camera", "grid": 64, "crop": 60, "pupil": 24
            },
        },
        "contact": {
            "_target_": "scenes.sensor.contact.Press", "_partial_": True, "radius": 2.45e-3,
            "depth": 1.8e-3,
        },
        "classes": {"L1": {"position": [28e-3, -8e-3]}, "None": None},
    }  # fmt: skip


# Runs of small recordings -------------------------------------------------------------------------


@pytest.fixture
def results(tmp_path, monkeypatch):
    """A folder of own results that no other test has."""
    monkeypatch.setenv("RESULTS_DIR", str(tmp_path / "results"))
    return tmp_path / "results"


@pytest.fixture
def recording(tmp_path, frames_and_labels):
    """recording(n, classes, side) → an .npz of so many frames."""

    def make(*shape, **keywords):
        frames, labels = frames_and_labels(*shape, **keywords)
        np.savez(tmp_path / "frames.npz", frames=frames, labels=labels)
        return tmp_path / "frames.npz"

    return make


@pytest.fixture
def composed_run(recording, compose):
    """composed_run(*overrides, scene=None) → the resolved config of a run on a small recording."""

    def make(*overrides, scene=None):
        path = f"scene.path={scene or recording()}"
        return resolved(compose("scene=recorded", path, "threads=1", *overrides))

    return make


@pytest.fixture
def carry_out(results, one_thread, composed_run):
    """carry_out(*overrides, scene=None) → the record of that run, carried out in this process, or
    found: carry_out.repeated tells which, carry_out.said what was printed."""

    def do(*overrides, scene=None):
        words = dict(word.split("=", 1) for word in overrides)
        names = {key: words[key] for key in ("model", "stop") if key in words}
        choices = {"scene": "recorded", "model": "hdc", "stop": "paper", **names}
        keys = [word.lstrip("+") for word in words]
        config = composed_run(*overrides, scene=scene)
        console = Console(record=True, width=300, file=io.StringIO())
        made, do.repeated = runner.carry_out(
            config, runner.Asked(choices, keys), console
        )
        do.said = console.export_text()
        return made

    return do


class FakeModel:
    """Yields the reports of its class, whatever it is shown; an error among them is raised."""

    reports = ()

    def __init__(self, **_):
        pass

    def train(self, frames, labels):
        for one in self.reports:
            if isinstance(one, BaseException):
                raise one
            yield one

    def predict(self, frames):
        return np.zeros(len(frames), np.int64)

    def state_tensors(self):
        return {"w": torch.zeros(3)}


@pytest.fixture
def fake(monkeypatch):
    """fake(*reports, **methods): in the place of HDC, a model that makes these reports."""

    def put(*reports, **methods):
        made = type("Fake", (FakeModel,), {"reports": reports, **methods})
        monkeypatch.setattr(hdc, "HDCClassifier", made)
        return made

    return put
