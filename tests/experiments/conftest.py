"""Records made up for tests of tables and figures: configurations as composed, results chosen."""

from __future__ import annotations

import multiprocessing
import os
import sys
import tempfile
from functools import partial

import numpy as np
import pytest
import torch
from omegaconf import OmegaConf

import hdc
from experiments import report, run, studies
from experiments.protocol.settings import resolved
from experiments.records.environment import environment
from experiments.records.files import REFERENCE
from experiments.records.results import Results
from experiments.reporting.answers import Answers
from experiments.reporting.study import studies as studies_of
from scenes.frames import Frames
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
        assert each.failures == []


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


@pytest.fixture
def write_run(tmp_path):
    """write_run(model, …) → id of a record in tmp_path, as the runner would have left it."""
    return partial(made_up.run, tmp_path)


@pytest.fixture
def write_measurement(tmp_path):
    """write_measurement(name, rows, …) leaves a measurement in tmp_path, as the runner would."""
    return partial(made_up.measurement, tmp_path)


@pytest.fixture
def runs_of_table1(write_run):
    """Records of the models of Table I, of seven seeds or three; runs with other settings, beside
    others, of fewer samples and pixels, and one that failed."""
    rng = np.random.default_rng(35)
    for seed in range(7):
        write_run("hdc", seed=seed, curve=[{"training_s": 0.4 + 0.01 * seed}])
        for model in ("softmax", "softmax_dual", "cnn1", "cnn3"):
            if model.startswith("cnn") and seed > 2:
                continue
            learnt = {} if model == "softmax_dual" else {"loss": 1.0}
            reports = [(0.7, 0.5), (0.95, 0.8), (0.993, 0.9)]
            curve = [
                {"training_s": 1 + place + float(rng.uniform()), "train_accuracy": train,
                 "test_accuracy": test, **learnt}
                for place, (train, test) in enumerate(reports)
            ]  # fmt: skip
            beside = {"beside.hdc_s": float(rng.uniform(0.4, 0.6))}
            wrong = range(seed)
            write_run(model, seed=seed, curve=curve, wrong=wrong, **beside)
    write_run("softmax", seed=0, change={"model.lr": 0.5}, wrong=range(50))
    write_run("cnn1", seed=3, environment={"exclusive": False}, wrong=range(50))
    for fewer in ({"split.n_train": 5}, {"split.n_train": 20}, {"data.pixels": 100}):
        write_run("hdc", wrong=range(30), change=fewer)
    write_run("cnn3", seed=9, status="failed")


# Frames -------------------------------------------------------------------------------------------


@pytest.fixture(scope="session")
def make_scene():
    """make_scene(n, classes, shape, …) → noisy frames of classes that take turns, and that look
    different in each session."""

    def make(
        n=60, classes=3, shape=(5, 7), dtype=np.uint8, sessions=1, origin="simulated"
    ):
        rng = np.random.default_rng(0)
        labels = np.tile(np.arange(classes), n // classes)
        session = np.repeat(np.arange(sessions), n // sessions)
        most = np.iinfo(dtype).max // 2
        base = rng.integers(0, most, (sessions, classes, *shape))
        frames = base[session, labels] + rng.integers(0, most, (n, *shape))
        images = torch.from_numpy(frames.astype(dtype))
        about = {"session": session}
        return Frames(images, labels, tuple("abc"[:classes]), about, origin)

    return make


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
def carry_out(results, one_thread, recording):
    """carry_out(*overrides, scene=None) → the record of that run on a small recording, carried out
    in this process, or found: carry_out.repeated tells which, carry_out.said what was printed."""

    def do(*overrides, scene=None):
        path = f"scene.path={scene or recording()}"
        words = ("scene=recorded", path, "threads=1", *overrides)
        cfg = tree(*words, with_hydra=True)
        config = resolved(
            OmegaConf.masked_copy(cfg, [key for key in cfg if key != "hydra"])
        )
        made, do.repeated, do.said = made_up.carried_out(config, run._asked(cfg.hydra))
        return made

    return do


class FakeModel:
    """Yields the reports of its class, whatever it is shown."""

    reports = ()

    def __init__(self, **_):
        pass

    def train(self, frames, labels):
        yield from self.reports

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
