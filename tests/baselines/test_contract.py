"""What every competitor promises, whatever it does inside."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from hydra.utils import instantiate
from omegaconf import OmegaConf

from baselines.base import Classifier
from baselines.cnn import CNN
from baselines.correlation import CorrelationClassifier
from baselines.training import IterativeClassifier

MODELS = Path(__file__).parents[2] / "configs" / "model"
CONFIGS = {path.stem: OmegaConf.load(path) for path in sorted(MODELS.glob("*.yaml"))}
# Variants of a recipe that differ in a number only.
VARIANTS = {
    "softmax_sgd",
    "softmax_zero",
    "cnn1_fast",
    "cnn1_centred",
    "cnn3",
    "cnn3_centred",
}
NAMES = [
    name
    for name, config in CONFIGS.items()
    if config.model._target_.startswith("baselines.") and name not in VARIANTS
]


def make(name: str) -> Classifier:
    """The model of a config, quick enough for small frames."""
    config = OmegaConf.create(
        {"seed": {"init": 0}, "device": "cpu", "model": CONFIGS[name].model}
    )
    model = instantiate(config.model, _convert_="all")
    if isinstance(model, IterativeClassifier) and model.optimizer != "LBFGS":
        return replace(model, lr=1e-2, max_epochs=20)
    return model


@pytest.fixture(params=NAMES)
def model(request: pytest.FixtureRequest) -> Classifier:
    return make(request.param)


def same_state(a: Classifier, b: Classifier) -> bool:
    x, y = a.state_tensors(), b.state_tensors()
    return x.keys() == y.keys() and all(torch.equal(x[name], y[name]) for name in x)


def test_two_trainings_of_one_seed_agree_to_the_last_bit(model, small, speckle):
    other = (
        replace(model).fit(*speckle(12, (8, 9), 3)).fit(*small)
    )  # the second starts anew
    torch.manual_seed(1)
    expected = torch.rand(3)
    torch.manual_seed(1)
    assert same_state(model.fit(*small), other)
    assert torch.equal(torch.rand(3), expected)  # other random numbers are left alone
    assert (model.predict(small[0]) == other.predict(small[0])).all()


def test_predictions_do_not_depend_on_the_batch(model, small, monkeypatch):
    frames, labels = small
    whole = model.fit(frames, labels).predict(frames)
    monkeypatch.setattr(type(model), "prediction_batch", 7)
    assert (model.predict(frames) == whole).all()
    assert whole.dtype == np.int64
    assert model.predict(frames[:0]).shape == (0,)


@pytest.mark.parametrize("names", [[5, 2, 11], ["left", "right", "far away"]])
def test_learns_labels_as_they_are_and_no_absent_class(model, speckle, names):
    frames, labels = speckle(30, (16, 16), 3)
    named = np.array(names)[labels]
    right = model.fit(frames, named.tolist()).predict(frames) == named
    assert right.mean() > 0.9
    assert model.score(frames, named) == right.mean()
    assert set(model.predict(speckle(30, (16, 16), 3, seed=1)[0]).tolist()) <= set(
        names
    )


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("name", ["correlation", "ridge", "knn_greys", "softmax"])
def test_frames_made_on_request_give_the_model_of_the_tensor(name, small, lazy):
    (frames, labels), model = small, make(name)
    other = replace(model).fit(lazy(frames), labels)
    assert same_state(model.fit(frames, labels), other)
    assert (model.predict(frames) == other.predict(lazy(frames))).all()


def test_flat_frames_are_frames_of_one_row(model, small):
    frames, labels = small
    flat = frames.flatten(1)
    if isinstance(model, CNN):
        return
    model.fit(flat, labels)
    other = replace(model).fit(frames, labels)
    assert (model.predict(flat) == other.predict(frames)).mean() > 0.9
    assert (other.predict(flat) == other.predict(frames)).all()


def test_can_be_asked_after_every_yield(model, small):
    frames, labels = small
    seen = 0
    for row in model.train(frames, labels):
        assert row["samples_seen"] > seen
        seen = row["samples_seen"]
        assert model.predict(frames[:3]).shape == (3,)
        assert model.state_tensors()
    assert seen >= len(frames)


def test_state_is_the_model_itself(model, small):
    frames, labels = small
    before = model.fit(frames, labels).scores(model.read(frames, slice(0, 40)))
    for name, tensor in model.state_tensors().items():
        flat = tensor.view(-1)  # no copy: a change here is a change of the model
        if name == "labels":
            flat.zero_()
        elif tensor.is_floating_point():
            flat.mul_(-1)
        elif tensor.dtype in (torch.uint8, torch.int64):
            flat[::2] ^= 255
    after = model.scores(model.read(frames, slice(0, 40)))
    assert not torch.equal(before, after)


def test_sixteen_bit_frames(model, speckle):
    frames, labels = speckle(30, (8, 8), 3)
    wide = (frames.to(torch.int32) * 257).to(torch.uint16)
    assert (model.fit(wide, labels).predict(wide) == labels).mean() > 0.9
    with pytest.raises(
        ValueError, match=r"expected torch\.uint16 as in training, found .*uint8"
    ):
        model.predict(frames)


@pytest.mark.parametrize(
    ("frames", "labels", "message"),
    [
        (
            torch.zeros(4, 6, 6),
            [0, 1, 0, 1],
            "expected uint8 or uint16, found torch.float32",
        ),
        (
            torch.zeros(4, dtype=torch.uint8),
            [0, 1, 0, 1],
            r"shape \[N, H, W\] or \[N, D\]",
        ),
        (
            np.zeros((4, 6, 6)),
            [0, 1, 0, 1],
            "expected uint8 or uint16, found torch.float64",
        ),
        (
            [np.zeros((6, 6), np.uint8), np.zeros((6, 5), np.uint8)],
            [0, 1],
            "frames: expected frames of one shape",
        ),
        (torch.zeros(4, 6, 6, dtype=torch.uint8), [0, 1], "labels: expected 4"),
        (
            torch.zeros(4, 6, 6, dtype=torch.uint8),
            [1, 1, 1, 1],
            "two classes, found one class, 1",
        ),
        (
            torch.zeros(3, 6, 6, dtype=torch.uint8),
            [0.0, np.nan, 1],
            r"labels\[1\]: .*found nan",
        ),
    ],
)
def test_bad_input_is_named(frames, labels, message):
    with pytest.raises((TypeError, ValueError), match=message):
        CorrelationClassifier().fit(frames, labels)


def test_queries_are_checked(model, small):
    with pytest.raises(RuntimeError, match="needs train or fit first"):
        model.predict(small[0])
    model.fit(*small)
    with pytest.raises(
        ValueError, match=r"expected shape \(12, 10\).*found \(10, 12\)"
    ):
        model.predict(small[0].transpose(1, 2))
    assert model.predict(small[0][0]).shape == (1,)


def test_satisfies_the_protocol_of_the_runner(model: Classifier):
    from experiments.protocol.model import Model

    assert isinstance(model, Model)
