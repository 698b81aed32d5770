"""What every competitor promises, whatever it does inside."""

from __future__ import annotations

import dataclasses
import pathlib
import subprocess
import sys
from collections.abc import Callable

import numpy as np
import pytest
import torch
from hydra.utils import instantiate
from omegaconf import OmegaConf
from sklearn.base import clone
from sklearn.linear_model import RidgeClassifier
from torch import Tensor

from baselines.base import Classifier
from baselines.cnn import CNN
from baselines.correlation import CorrelationClassifier
from baselines.nearest_neighbour import NearestNeighbour
from baselines.record_hdc import RecordHDC
from baselines.ridge import RidgeReadout
from baselines.sklearn_classifier import SklearnClassifier
from baselines.softmax import SoftmaxRegression
from baselines.softmax_dual import DualSoftmaxRegression

CONFIGS = pathlib.Path(__file__).parents[2] / "configs" / "model"
MAKERS: dict[str, Callable[[], Classifier]] = {
    "softmax": lambda: SoftmaxRegression(lr=1e-2, max_epochs=10),
    "softmax_bfloat16": lambda: SoftmaxRegression(lr=1e-2, max_epochs=10, dtype="bfloat16"),
    "lbfgs": lambda: SoftmaxRegression(optimizer="LBFGS", lr=1.0, batch_size=None, C=1.0),
    "dual": DualSoftmaxRegression,
    "cnn": lambda: CNN(filters=[4], lr=1e-2, max_epochs=5),
    "cnn_fast": lambda: CNN(
        filters=[4, 8],
        lr=1e-2,
        max_epochs=10,
        dtype="bfloat16",
        memory_format="channels_last",
        micro_batch=7,
    ),
    "ridge": RidgeReadout,
    "correlation": CorrelationClassifier,
    "nearest": NearestNeighbour,
    "record_hdc": lambda: RecordHDC(dimension=512),
    "sklearn": lambda: SklearnClassifier(estimator=RidgeClassifier()),
}


@pytest.fixture(params=MAKERS)
def model(request: pytest.FixtureRequest) -> Classifier:
    return MAKERS[request.param]()


def same_state(a: Classifier, b: Classifier) -> bool:
    x, y = a.state_tensors(), b.state_tensors()
    return x.keys() == y.keys() and all(torch.equal(x[name], y[name]) for name in x)


def test_two_trainings_of_one_seed_agree_to_the_last_bit(model, small):
    other = clone(model)
    assert same_state(model.fit(*small), other.fit(*small))
    assert (model.predict(small[0]) == other.predict(small[0])).all()


def test_training_starts_anew(model, small, speckle):
    again = clone(model).fit(*speckle(12, (5, 9), 3)).fit(*small)
    assert same_state(model.fit(*small), again)


def test_lazy_frames_give_the_model_of_the_tensor(model, small, lazy):
    frames, labels = small
    made_lazily = clone(model).fit(lazy(frames), labels)
    assert same_state(model.fit(frames, labels), made_lazily)
    assert (model.predict(frames) == made_lazily.predict(lazy(frames))).all()


def test_predictions_do_not_depend_on_the_batch(model, small, monkeypatch):
    frames, labels = small
    whole = model.fit(frames, labels).predict(frames)
    monkeypatch.setattr(type(model), "prediction_batch", 7)
    assert (model.predict(frames) == whole).all()
    assert whole.dtype == np.int64
    assert model.predict(frames[:0]).shape == (0,)


def test_learns_labels_as_they_are_and_no_absent_class(model, speckle):
    frames, labels = speckle(30, (16, 16), 3)
    names = np.array([2, 5, 11])  # classes 0, 1, 3, ... never occur
    model.fit(frames, names[labels])
    assert (model.predict(frames) == names[labels]).mean() > 0.9
    assert set(model.predict(speckle(30, (16, 16), 3, seed=1)[0])) <= set(names)


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
    before = model.fit(frames, labels).scores(model.load(frames, slice(0, 40)))
    for tensor in model.state_tensors().values():
        flat = tensor.view(-1)  # no copy: what is changed here is changed in the model
        if tensor.is_floating_point():
            flat.mul_(-1)
        elif tensor.dtype == torch.uint8:
            flat[::2] ^= 255
    after = model.scores(model.load(frames, slice(0, 40)))
    assert not torch.equal(before, after)


def test_sixteen_bit_frames(model, speckle):
    frames, labels = speckle(30, (8, 8), 3)
    wide = (frames.to(torch.int32) * 257).to(torch.uint16)
    assert (model.fit(wide, labels).predict(wide) == labels).mean() > 0.9
    with pytest.raises(ValueError, match=r"expected torch\.uint16 as in training, found .*uint8"):
        model.predict(frames)


@pytest.mark.parametrize(
    ("frames", "labels", "message"),
    [
        (torch.zeros(4, 6, 6), [0, 1, 0, 1], "expected uint8 or uint16, found torch.float32"),
        (torch.full((4, 6, 6), torch.nan), [0, 1, 0, 1], "with NaN or infinite pixels"),
        (torch.zeros(0, 6, 6, dtype=torch.uint8), [], "at least one, found none"),
        (torch.zeros(4, 36, dtype=torch.uint8), [0, 1, 0, 1], r"shape \[N, H, W\]"),
        (torch.zeros(4, 6, 6, dtype=torch.uint8), [0, 1], r"expected 4 \(one a frame\)"),
        (torch.zeros(4, 6, 6, dtype=torch.uint8), [1, 1, 1, 1], "two classes, found only 1"),
        (torch.zeros(4, 6, 6, dtype=torch.uint8), [0.0, 1, 0, 1], "integers, found float64"),
    ],
)
def test_bad_input_is_named(model, frames, labels, message):
    with pytest.raises(ValueError, match=message):
        model.fit(frames, np.asarray(labels))


def test_queries_are_checked(model, small):
    with pytest.raises(RuntimeError, match="needs train or fit first"):
        model.predict(small[0])
    model.fit(*small)
    with pytest.raises(ValueError, match=r"expected shape \[Q, 12, 10\].*found \[40, 10, 12\]"):
        model.predict(small[0].transpose(1, 2))


def test_constructor_only_assigns(model):
    given = {field.name: getattr(model, field.name) for field in dataclasses.fields(model)}
    assert vars(model) == given
    with pytest.raises(ValueError, match="unknown \\['depth'\\], expected some of"):
        model.set_params(depth=3)


def test_other_random_numbers_are_left_alone(model, small):
    torch.manual_seed(1)
    expected = torch.rand(3)
    torch.manual_seed(1)
    model.fit(*small)
    assert torch.equal(torch.rand(3), expected)


@pytest.mark.parametrize("path", sorted(CONFIGS.glob("*.yaml")), ids=lambda path: path.stem)
def test_configuration_builds_a_model(path):
    config = OmegaConf.create({"seed": {"init": 5}, "device": "cpu", "model": OmegaConf.load(path)})
    if not config.model._target_.startswith("baselines."):
        pytest.skip("another package's model")
    model = instantiate(config.model, _convert_="all")
    assert isinstance(model, Classifier)
    assert model.device == "cpu"
    assert model.get_params().get("seed", 5) == 5


def loaded_by(module: str) -> list[str]:
    code = f"import sys, {module}; print(*sorted(sys.modules))"
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    return run.stdout.split()


@pytest.mark.parametrize(
    "module", ["softmax", "softmax_dual", "cnn", "sklearn_classifier", "record_hdc"]
)
def test_imports_only_what_it_uses(module):
    modules = loaded_by(f"baselines.{module}")
    for other in (
        "sklearn",
        "cv2",
        "pandas",
        "matplotlib",
        "hydra",
        "scenes",
        "hdc",
        "experiments",
    ):
        assert other not in modules
    assert ("baselines.cnn" in modules) == (module == "cnn")


def test_satisfies_the_protocol_of_the_runner(model: Classifier):
    from experiments.protocol import Model

    assert isinstance(model, Model)


def test_frames_may_be_a_slice_or_a_tensor(small, lazy):
    frames: Tensor = small[0]
    assert torch.equal(lazy(frames)[2:4], lazy(frames)[torch.tensor([2, 3])])
