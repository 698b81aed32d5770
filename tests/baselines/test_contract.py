"""What every competitor promises, whatever it does inside."""

from __future__ import annotations

import dataclasses
import datetime
import subprocess
import sys
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
import torch
from sklearn.base import clone
from sklearn.linear_model import RidgeClassifier
from sklearn.model_selection import cross_val_score
from torch import Tensor

from baselines.base import Classifier
from baselines.cnn import CNN
from baselines.correlation import CorrelationClassifier
from baselines.linear_bits import BitReadout
from baselines.nearest_neighbour import NearestNeighbour
from baselines.record_hdc import RecordHDC
from baselines.ridge import RidgeReadout
from baselines.sklearn_classifier import SklearnClassifier
from baselines.softmax import SoftmaxRegression
from baselines.softmax_dual import DualSoftmaxRegression

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
    "bits": BitReadout,
    "bits_signs": lambda: BitReadout(one_bit=True),
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


def test_predictions_do_not_depend_on_the_batch(model, small, monkeypatch):
    frames, labels = small
    whole = model.fit(frames, labels).predict(frames)
    monkeypatch.setattr(type(model), "prediction_batch", 7)
    assert (model.predict(frames) == whole).all()
    assert whole.dtype == np.int64
    assert model.predict(frames[:0]).shape == (0,)


# Three labels of each kind, not in sorted order.
KINDS: dict[str, list[Any]] = {
    "int": [5, 2, 11],
    "text": ["left", "right", "far away"],
    "float": [0.5, -1.0, 2.5],
    "mixed": [True, "a", 3],
    "tuple": [(0, 1), (0, 0), (1, 0)],
    "date": [datetime.date(2024, 1, 2), datetime.date(2024, 1, 1), datetime.date(2025, 1, 1)],
}


def named(kind: str, labels: np.ndarray) -> list[Any]:
    return [KINDS[kind][k] for k in labels]


@pytest.mark.parametrize("kind", ["int", "text"])
def test_learns_labels_as_they_are_and_no_absent_class(model, speckle, kind):
    frames, labels = speckle(30, (16, 16), 3)
    names = named(kind, labels)
    right = np.array(model.fit(frames, names).predict(frames)) == np.array(names)
    assert right.mean() > 0.9
    assert model.score(frames, names) == right.mean()
    assert set(model.predict(speckle(30, (16, 16), 3, seed=1)[0]).tolist()) <= set(names)


@pytest.mark.parametrize("kind", KINDS)
def test_labels_of_any_kind(small, kind):
    frames, labels = small[0], small[1] % 3
    names = named(kind, labels)
    model = CorrelationClassifier().fit(frames, names)
    by_number = CorrelationClassifier().fit(frames, labels)
    found = model.predict(frames).tolist()
    assert found == named(kind, by_number.predict(frames))
    assert set(map(type, found)) == set(map(type, names))
    assert model.score(frames, names) == by_number.score(frames, labels) > 0.5


def test_labels_keep_their_type(small):
    frames, labels = small
    days = np.datetime64("2024-01-01", "ns") + labels.astype("m8[D]")
    for given, dtype in (
        (labels, "int64"),
        (labels.astype(np.uint8), "uint8"),
        (torch.from_numpy(labels), "int64"),
        (labels.tolist(), "int64"),
        ((labels == 1).tolist(), "bool"),
        ([f"class {k}" for k in labels], "<U7"),
        (np.array([f"class {k}" for k in labels], object), "<U7"),
        (["a\0" if k else "a" for k in labels], "O"),  # NumPy's own texts lose the null
        (days, days.dtype),
    ):
        model = CorrelationClassifier().fit(frames, given)
        assert model.predict(frames).dtype == np.dtype(dtype)
        assert model.predict(frames[:0]).dtype == np.dtype(dtype)
        assert model.score(frames, given) > 0.9


def read_only(frames: Tensor) -> np.ndarray:
    array = frames.numpy().copy()
    array.flags.writeable = False
    return array


FORMS: dict[str, Callable[[Tensor], Any]] = {
    "array": lambda frames: frames.numpy(),
    "list_of_tensors": list,
    "list_of_arrays": lambda frames: list(frames.numpy()),
    "read_only": read_only,
    "backwards": lambda frames: frames.numpy()[::-1].copy()[::-1],
    "fortran": lambda frames: np.asfortranarray(frames.numpy()),
}


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("form", [*FORMS, "lazy"])
def test_frames_of_any_form_give_the_model_of_the_tensor(model, small, form, lazy):
    frames, labels = small
    given = lazy(frames) if form == "lazy" else FORMS[form](frames)
    other = clone(model).fit(given, labels)
    assert same_state(model.fit(frames, labels), other)
    assert (model.predict(frames) == other.predict(given)).all()


def test_flat_frames_are_frames_of_one_row(model, small):
    frames, labels = small
    flat = frames.flatten(1)
    if isinstance(model, CNN):
        with pytest.raises(ValueError, match=r"pooling layers need .* pixels, found 1×120"):
            model.fit(flat, labels)
        return
    model.fit(flat, labels)
    assert (model.predict(flat) == clone(model).fit(frames, labels).predict(frames)).mean() > 0.9
    assert (model.predict(flat[:, None]) == model.predict(flat)).all()
    with pytest.raises(ValueError, match=r"shape \[Q, 120\] as in training, found \[40, 12, 10\]"):
        model.predict(frames)


def test_scikit_learn_validates_it(model, speckle):
    frames, labels = speckle(30, (16, 16), 3)
    names = np.array(["left", "right", "far"])[labels]
    scores = cross_val_score(model, frames.numpy(), names, cv=3, error_score="raise")
    assert scores.shape == (3,)
    assert scores.mean() > 0.7


def test_a_saved_model_is_the_model(model, speckle, tmp_path):
    frames, labels = speckle(30, (16, 16), 3)
    path = tmp_path / "model.safetensors"
    model.fit(frames, named("text", labels))
    if isinstance(model, SklearnClassifier):
        with pytest.raises(TypeError, match=r"SklearnClassifier: .* of class RidgeClassifier"):
            model.save(path)
        assert not any(tmp_path.iterdir())
        return
    model.save(path)
    assert [file.name for file in tmp_path.iterdir()] == ["model.safetensors"]
    loaded = type(model).load(path)
    assert loaded.get_params() == model.get_params()
    assert vars(loaded).keys() == vars(model).keys()
    assert same_state(model, loaded)
    batch = model.read(frames, slice(0, 7))
    assert torch.equal(model.scores(batch), loaded.scores(batch))
    assert (loaded.predict(frames) == model.predict(frames)).all()
    path.write_bytes(path.read_bytes()[:-1])
    with pytest.raises(ValueError, match=r"model\.safetensors: expected a saved .*, found"):
        type(model).load(path)


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
    for tensor in model.state_tensors().values():
        flat = tensor.view(-1)  # no copy: what is changed here is changed in the model
        if tensor.is_floating_point():
            flat.mul_(-1)
        elif tensor.dtype == torch.uint8:
            flat[::2] ^= 255
    after = model.scores(model.read(frames, slice(0, 40)))
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
        (torch.zeros(4, dtype=torch.uint8), [0, 1, 0, 1], r"shape \[N, H, W\] or \[N, D\]"),
        (np.zeros((4, 6, 6)), [0, 1, 0, 1], "expected uint8 or uint16, found torch.float64"),
        (np.zeros((4, 6, 6), complex), [0, 1, 0, 1], "expected uint8 or uint16, found complex128"),
        (
            [np.zeros((6, 6), np.uint8), np.zeros((6, 5), np.uint8)],
            [0, 1],
            r"frames\[1\]: .* \[6, 6\] as frames\[0\], found torch.uint8 \[6, 5\]",
        ),
        ([], [], "at least one, found none"),
        (torch.zeros(4, 6, 6, dtype=torch.uint8), [0, 1], r"expected 4 \(one a frame\)"),
        (torch.zeros(4, 6, 6, dtype=torch.uint8), [1, 1, 1, 1], "two classes, found only 1"),
        (torch.zeros(3, 6, 6, dtype=torch.uint8), [0.0, np.nan, 1], r"labels\[1\]: .* found nan"),
        (torch.zeros(2, 6, 6, dtype=torch.uint8), [["a"], ["b"]], "labels: expected hashable"),
    ],
)
def test_bad_input_is_named(model, frames, labels, message):
    with pytest.raises(ValueError, match=message):
        model.fit(frames, labels)


def test_queries_are_checked(model, small):
    with pytest.raises(RuntimeError, match="needs train or fit first"):
        model.predict(small[0])
    model.fit(*small)
    with pytest.raises(ValueError, match=r"expected shape \[Q, 12, 10\].*found \[40, 10, 12\]"):
        model.predict(small[0].transpose(1, 2))
    with pytest.raises(ValueError, match=r"found \[12, 10\]; one frame is frame\[None\]"):
        model.predict(small[0][0])
    with pytest.raises(RuntimeError, match="save needs train or fit first"):
        clone(model).save("nowhere")


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
    from experiments.protocol.model import Model

    assert isinstance(model, Model)


@pytest.mark.parametrize(
    ("key", "value", "expected"),
    [("lr", "abc", "float or int"), ("seed", 1.5, "int"), ("batch_size", True, "int or NoneType")],
)
def test_a_value_of_another_type_is_refused_when_the_model_is_made(key, value, expected):
    with pytest.raises(ValueError, match=f"{key}: expected {expected}, found {value!r}"):
        SoftmaxRegression(**{key: value})
