"""A model of any kind is trained on part of a bank, until the rule ends it."""

import copy

import numpy as np
import pytest
import torch

from baselines.softmax import SoftmaxRegression
from experiments.protocol.evaluate import bank_of, evaluate, train_until
from experiments.protocol.stop import StopRule


def test_a_bank_knows_what_frames_belong_together(make_scene):
    scene = make_scene(n=120, sessions=2)
    chosen = np.array([70, 3, 110])
    bank = bank_of(scene, chosen, group="session")
    assert bank.groups.tolist() == [1, 0, 1]
    assert bank.labels.tolist() == scene.labels[chosen].tolist()
    assert torch.equal(bank.frames, scene.frames(chosen))
    assert bank_of(scene, chosen).groups is None
    assert torch.equal(bank_of(scene).frames, scene.images)  # more than a batch


def test_a_model_is_left_as_it_was_and_asked_as_if_trained_alone(make_scene):
    scene, train = make_scene(), np.arange(40)
    model = SoftmaxRegression(lr=1e-2, max_epochs=10_000)
    predicted = evaluate(model, bank_of(scene), train, np.arange(40, 60))
    assert not hasattr(model, "network_")
    alone = copy.deepcopy(model)
    reason = train_until(alone, StopRule(), scene.images[train], scene.labels[train])
    assert reason in ("trained", "steps")  # long before its last epoch
    assert (predicted == alone.predict(scene.images[40:60])).all()


class Closed:
    """Has the labels of queries in closed form."""

    def predict_from(self, bank, train, queries):
        return bank.labels[train].sum() + queries


def test_a_model_that_computes_labels_from_the_bank_is_not_trained(make_scene):
    bank = bank_of(make_scene())
    found = evaluate(Closed(), bank, np.array([1, 2, 2]), np.array([7, 9]))
    assert (found - bank.labels[[1, 2, 2]].sum()).tolist() == [7, 9]


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
        ({"target": 0.7}, "finished", 3),  # that it is reached ends nothing by default
        ({"target": 0.7, "reached_after_s": 0}, "reached", 2),
        ({"loss": 0.5, "least_steps": 15}, "trained", 2),
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
