"""Saved models: what is refused, what damage shows, and that a failed save costs nothing."""

from __future__ import annotations

import json
import os
from dataclasses import dataclass

import numpy as np
import pytest
import torch
from safetensors import safe_open
from safetensors.torch import save_file

from baselines import files
from baselines.correlation import CorrelationClassifier
from baselines.ridge import RidgeReadout
from baselines.softmax import SoftmaxRegression


@pytest.fixture
def saved(small, tmp_path):
    """A model, and the file it was saved to."""
    model = SoftmaxRegression(pixels="standard", lr=1e-2, max_epochs=2).fit(*small)
    model.save(tmp_path / "model")
    return model, tmp_path / "model"


def rewrite(path, change):
    """Change the header (a dict) and the tensors of a saved model in place."""
    with safe_open(path, framework="pt") as file:
        header = json.loads(file.metadata()["model"])
        tensors = {name: file.get_tensor(name) for name in list(file.keys())}
    change(header, tensors)
    save_file(tensors, path, metadata={"model": json.dumps(header)})


def test_sixteen_bits_and_maps_of_the_pixels_come_back(small, tmp_path):
    frames = (small[0].to(torch.int32) * 257).to(torch.uint16)
    model = SoftmaxRegression(pixels="standard", lr=1e-2, max_epochs=2).fit(frames, small[1])
    model.save(str(tmp_path / "model"))
    loaded = SoftmaxRegression.load(str(tmp_path / "model"))
    assert torch.equal(loaded.scaling_.shift, model.scaling_.shift)
    assert (loaded.predict(frames) == model.predict(frames)).all()
    with pytest.raises(ValueError, match=r"expected torch\.uint16 as in training"):
        loaded.predict(small[0])


@pytest.mark.parametrize(
    "labels",
    [np.array([1, 2], np.uint8), np.array([0.5, np.inf]), np.array(["b", "a"]), [True, False],
     [1, "a"]],
)  # fmt: skip
def test_labels_come_back_with_their_type(labels, small, tmp_path):
    given = [labels[k % 2] for k in range(40)]
    model = CorrelationClassifier().fit(small[0], given)
    model.save(tmp_path / "model")
    loaded = CorrelationClassifier.load(tmp_path / "model")
    assert loaded.classes_.dtype == model.classes_.dtype
    assert loaded.classes_.tolist() == model.classes_.tolist()


def test_a_loaded_network_can_be_trained_again(saved, small):
    model, path = saved
    loaded = SoftmaxRegression.load(path)
    assert all(p.requires_grad for p in loaded.network_.parameters())
    loaded.fit(*small)
    for name, tensor in loaded.state_tensors().items():
        assert torch.equal(tensor, model.state_tensors()[name])


@dataclass(kw_only=True, eq=False)
class Keeper(CorrelationClassifier):
    """Keeps what JSON does not know."""

    def train(self, frames, labels):
        yield from super().train(frames, labels)
        self.tree_ = object()


@pytest.mark.parametrize(
    ("model", "labels", "found"),
    [
        (
            Keeper(),
            [0, 1],
            "Keeper: expected tensors and numbers to save, found tree_ of class obj",
        ),
        (CorrelationClassifier(), [(0, 1), (1, 0)], r"str, int, float or bool .*, found \(0, 1\)"),
        (CorrelationClassifier(), np.array([0, 1], "M8[ns]"), r"found datetime64\[ns\]"),
    ],
)
def test_what_cannot_be_saved_is_named(model, labels, found, small, tmp_path):
    fitted = type(model)().fit(small[0][:2], labels)
    (tmp_path / "model").write_text("as it was")
    with pytest.raises(TypeError, match=found):
        fitted.save(tmp_path / "model")
    assert (tmp_path / "model").read_text() == "as it was"
    assert len(list(tmp_path.iterdir())) == 1


def test_a_save_that_fails_leaves_the_old_file(saved, monkeypatch):
    model, path = saved
    before = path.read_bytes()

    def full(handle):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(files.os, "fsync", full)
    with pytest.raises(OSError, match="No space left"):
        model.save(path)
    assert path.read_bytes() == before
    assert [file.name for file in path.parent.iterdir()] == ["model"]


def test_a_folder_that_is_not_there_is_named(saved, tmp_path):
    with pytest.raises(FileNotFoundError, match=r"expected the folder .*nowhere, found none"):
        saved[0].save(tmp_path / "nowhere" / "model")
    with pytest.raises(FileNotFoundError, match="nothing"):
        SoftmaxRegression.load(tmp_path / "nothing")


def test_another_class_is_not_loaded(saved, tmp_path):
    with pytest.raises(ValueError, match="expected a saved RidgeReadout, found a saved SoftmaxReg"):
        RidgeReadout.load(saved[1])


def test_only_a_regular_file_is_opened(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    for path in (tmp_path / "pipe", tmp_path):
        with pytest.raises(ValueError, match="found what is not a regular file"):
            RidgeReadout.load(path)


DAMAGES = {
    "format": lambda h, t: h.update(format="other"),
    "no_class": lambda h, t: h.pop("class"),
    "parameter": lambda h, t: h["parameters"].update(depth=3),
    "one_class": lambda h, t: h.update(classes=[0]),
    "twice_the_same": lambda h, t: h.update(classes=[0, 1, 1, 3]),
    "more_classes": lambda h, t: h.update(classes=[0, 1, 2, 3, 4]),
    "label_type": lambda h, t: h.update(label_type="V8"),
    "labels_of_text": lambda h, t: h.update(classes=["a", "b", "c", "d"]),
    "shape": lambda h, t: h.update(frame_shape=[10, 13]),
    "no_shape": lambda h, t: h.update(frame_shape=[-12, -10]),
    "huge": lambda h, t: h.update(frame_shape=[10**9, 10**9]),
    "frame_type": lambda h, t: h.update(frame_type="float32"),
    "kind": lambda h, t: h["learnt"].update(network_={"pickle": "os.system"}),
    "no_tensor": lambda h, t: t.pop("scaling_.offset"),
    "no_weight": lambda h, t: h["learnt"]["network_"]["network"].popitem(),
    "no_network": lambda h, t: h["learnt"].pop("network_"),
    "short_map": lambda h, t: t.update({"scaling_.scale": t["scaling_.scale"][:5].clone()}),
    "weight": lambda h, t: t.update({"network_.1.weight": torch.zeros(4, 7)}),
}


@pytest.mark.parametrize("damage", DAMAGES)
def test_damage_is_a_line_that_names_the_file(saved, damage):
    rewrite(saved[1], DAMAGES[damage])
    with pytest.raises(
        ValueError, match=r"/model: expected a saved SoftmaxRegression, found ."
    ) as e:
        SoftmaxRegression.load(saved[1])
    assert len(str(e.value).splitlines()) == 1


def test_a_model_of_a_gpu_that_is_not_here_comes_to_the_cpu(saved, small, monkeypatch):
    model, path = saved
    rewrite(path, lambda header, _: header["parameters"].update(device="cuda"))
    monkeypatch.setattr(torch.cuda, "is_available", lambda: False)
    with pytest.warns(UserWarning, match="trained on 'cuda', which is not here"):
        loaded = SoftmaxRegression.load(path)
    assert (loaded.predict(small[0]) == model.predict(small[0])).all()
