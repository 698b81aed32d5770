"""Every study asks the model that it is given, whatever kind it is."""

import copy

import numpy as np
import pandas as pd
import pytest
import torch

from baselines.softmax import SoftmaxRegression
from experiments.protocol.evaluate import bank_of, evaluate, train_until
from experiments.protocol.stop import StopRule
from experiments.protocol.task import Context
from experiments.studies.drift.measure import Drift
from scenes.frames import Frames
from tests.experiments.composed import made

RANDOM = {"kind": "random", "test_fraction": 0.3, "group": None, "n_train": None}
HDC = {"_target_": "hdc.HDCClassifier"}
KINDS = {
    "ridge": HDC | {"readout": "ridge"},
    "neighbours": HDC
    | {"readout": {"_target_": "hdc.readouts.Neighbours", "n_neighbors": 3}},
    "counts": HDC | {"readout": "counts"},
    "levels and lda": HDC | {"encoder": "levels", "readout": "lda"},
    "reference": HDC | {"encoder": "reference"},
    "own": {"_target_": f"{__name__}.LastLabel"},
}


class LastLabel:
    """A model that no study knows: it answers the label of the last frame that it was given."""

    def train(self, frames, labels):
        self.label = labels[-1]
        yield {"samples_seen": len(frames)}

    def predict(self, frames):
        return np.full(len(frames), self.label)


@pytest.fixture
def scene(monkeypatch):
    """Two sessions of 3 × 20 hard frames, which a study gets whatever its config."""
    rng = np.random.default_rng(7)
    labels, session = np.tile(np.arange(60) % 3, 2), np.repeat([0, 1], 60)
    base = rng.integers(0, 60, (3, 12, 12))
    frames = (
        base[labels] + rng.integers(0, 196, (120, 12, 12)) + 3 * session[:, None, None]
    )
    samples = {"session": session, "order": np.tile(np.arange(60), 2)}
    images = torch.from_numpy(frames.clip(0, 255).astype(np.uint8))
    scene = Frames(images, labels, ("A", "B", "C"), samples, origin="simulated")
    monkeypatch.setattr(Context, "scene", lambda *_: scene)
    return scene


def test_a_bank_knows_what_frames_belong_together(scene):
    chosen = np.array([70, 3, 110])
    bank = bank_of(scene, chosen, group="session")
    assert bank.groups.tolist() == [1, 0, 1]
    assert bank.labels.tolist() == scene.labels[chosen].tolist()
    assert torch.equal(bank.frames, scene.frames(chosen))
    assert bank_of(scene, chosen).groups is None


def test_updates_that_a_read_out_refuses_have_no_row(scene):
    models = {name: {"model": part} for name, part in KINDS.items()}
    arguments = {"old_split": RANDOM, "seeds": [0], "n_test": 30, "n_new": [6]}
    task = made(Drift, scene={}, models=models, p=[0.5], **arguments)
    rows = pd.DataFrame(task.rows(Context()))
    methods = {name: set(part.method) for name, part in rows.groupby("model")}
    always = {"stored", "new", "pooled", "balanced"}
    assert methods["counts"] == methods["own"] == always
    assert methods["levels and lda"] == always
    assert methods["ridge"] == methods["neighbours"] == always | {"replace"}


def test_a_model_that_learns_by_steps_is_ended_by_the_rule(scene):
    bank, train = bank_of(scene), np.arange(40)
    model = SoftmaxRegression(lr=1e-2, max_epochs=10_000)
    predicted = evaluate(model, bank, train, np.arange(40, 60))
    assert not hasattr(model, "network_")
    alone = copy.deepcopy(model)
    reason = train_until(alone, StopRule(), scene.images[train], scene.labels[train])
    assert reason in ("trained", "steps")  # long before its last epoch
    assert (predicted == alone.predict(scene.images[40:60])).all()


class ThreeReports:
    """Loses less each time; from its second report on it has all but one of four frames right."""

    def __init__(self, learns_by_steps):
        self.learns_by_steps, self.reports = learns_by_steps, 0

    def train(self, frames, labels):
        for loss in (1.0, 0.5, 0.1):
            self.reports += 1
            of_steps = {"steps": 10 * self.reports, "loss": loss}
            yield {"samples_seen": 4} | (of_steps if self.learns_by_steps else {})

    def predict(self, frames):
        assert self.learns_by_steps
        return np.array([0, 1, 1, 1]) if self.reports > 1 else np.array([1, 0, 1, 1])


@pytest.mark.parametrize(
    ("rule", "reason", "reports"),
    [
        ({}, "finished", 3),
        ({"target": 0.7}, "finished", 3),  # that it is reached ends nothing by default
        ({"target": 0.7, "reached_after_s": 0}, "reached", 2),
        ({"target": 0.75, "reached_after_s": 0}, "finished", 3),  # not above it
        ({"loss": 0.5, "least_steps": 15}, "trained", 2),
        ({"loss": 0.5, "least_steps": 25}, "trained", 3),
        ({"least_steps": 0, "most_steps": 10}, "steps", 1),
        ({"budget_s": 1e-12}, "budget", 1),
    ],
)
def test_a_training_ends_by_what_the_training_frames_say(rule, reason, reports):
    frames, labels = torch.zeros(4, 2, 2, dtype=torch.uint8), np.array([0, 1, 1, 0])
    model = ThreeReports(learns_by_steps=True)
    assert train_until(model, StopRule(**rule), frames, labels) == reason
    assert model.reports == reports
    # What learns in one pass ends by itself, or when its time is used up.
    model = ThreeReports(learns_by_steps=False)
    ended = "budget" if reason == "budget" else "finished"
    assert train_until(model, StopRule(**rule), frames, labels) == ended
