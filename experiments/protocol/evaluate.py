"""Train a model on part of a bank of frames, and return its predictions for others."""

from __future__ import annotations

import copy

import numpy as np
import torch

from baselines import library
from baselines.bank import Bank
from experiments.protocol.clock import Clock
from experiments.protocol.model import Model
from experiments.protocol.stop import StopRule
from experiments.protocol.trial import Report, train
from hdc.accuracy import accuracy
from hdc.inputs import FrameSource
from scenes.frames import Scene

_BATCH = 64  # frames of a scene made at a time


def bank_of(
    scene: Scene,
    chosen: np.ndarray | None = None,
    group: str | None = None,
) -> Bank:
    """All frames of a scene, or the chosen ones, read once.

    Args:
        scene: where they come from.
        chosen: indices of samples.
        group: name of what samples share that belong on one side of a split, if anything.
    """
    if chosen is None:
        chosen = np.arange(len(scene.labels))
    starts = np.arange(_BATCH, len(chosen), _BATCH)
    parts = np.split(chosen, starts)
    frames = torch.cat([scene.frames(part).cpu() for part in parts])
    groups = None if group is None else scene.samples[group][chosen]
    return Bank(frames, scene.labels[chosen], len(scene.classes), groups)


def evaluate(
    model: Model,
    bank: Bank,
    train: np.ndarray,
    queries: np.ndarray,
) -> np.ndarray:
    """Labels int64 [Q] of queries by a model like this one, trained on other frames of the bank.

    A model may compute the labels from products of frames, without training: it has a method
    ``predict_from(bank, train, queries)``, which returns those that the training would give.

    Args:
        model: any; it is left as it was.
        bank: the frames.
        train, queries: indices of frames; one that occurs k times among `train` counts k times.
    """
    if library.has_predict_from(model):
        return library.predict_from(model, bank, train, queries)
    trained = copy.deepcopy(model)
    train_until(trained, StopRule(), bank.at(train), bank.labels[train])
    return np.asarray(trained.predict(bank.at(queries)))


def train_until(
    model: Model, stop: StopRule, frames: FrameSource, labels: np.ndarray
) -> str:
    """Train a model until the rule ends it, and name the reason, one of
    :data:`experiments.protocol.stop.NAMES`; test samples have no say."""

    def test(report: Report, at_end: bool) -> Report | None:
        if at_end or stop.reached_after_s is None or "loss" not in report:
            return None
        return {"train_accuracy": accuracy(model.predict(frames), labels)}

    name = type(model).__name__
    *_, trial = train(model, name, frames, labels, stop, Clock(), test)
    return trial.stop or ""
