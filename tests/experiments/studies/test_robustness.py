"""Disturbances do what they say and are undone; a measurement says what they cost."""

from __future__ import annotations

import inspect
import math
import os
import subprocess
import sys

import numpy as np
import pytest
import torch
from omegaconf import OmegaConf

from experiments.protocol.trial import instantiate, stop_rule
from experiments.records import configs, measurement
from experiments.records.files import ROOT
from experiments.records.results import Results
from experiments.studies.robustness import measure as robustness
from experiments.studies.robustness.disturbances import (
    OF_FRAMES,
    dead_pixels,
    flipped_bits,
    flipped_bits_of_int8,
    power,
    shift,
)
from scenes.frames import Frames

FRAMES = np.random.default_rng(0).integers(0, 256, (6, 20, 30), np.uint8)


def random(seed=0):
    return np.random.default_rng(seed)


# Frames -------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", OF_FRAMES)
def test_level_zero_is_no_disturbance_and_frames_given_stay(name):
    given = FRAMES.copy()
    assert (OF_FRAMES[name](given, 0, random()) == FRAMES).all()
    disturbed = OF_FRAMES[name](given, 1, random())
    assert (given == FRAMES).all()
    assert (disturbed != FRAMES).any()
    assert disturbed.dtype == np.uint8
    assert (OF_FRAMES[name](given, 1, random()) == disturbed).all()


def test_power_scales_a_frame_as_a_whole_and_saturates():
    frames = np.full((400, 2, 2), 100, np.uint8)
    factors = power(frames, 0.2, random()) / 100
    assert (factors == factors[:, :1, :1]).all()
    assert factors.min() >= 0.8
    assert factors.max() <= 1.2
    assert factors.mean() == pytest.approx(1, abs=4 * 0.4 / math.sqrt(12 * 400))
    bright = power(np.full((50, 1, 1), 250, np.uint8), 0.2, random())
    assert bright.max() == 255
    assert power(np.full((50, 1, 1), 60000, np.uint16), 0.2, random()).max() == 65535


def test_dead_pixels_are_the_same_in_every_frame():
    dead = (dead_pixels(np.full_like(FRAMES, 7), 0.05, random()) == 0).all(axis=0)
    assert dead.sum() == 30  # 5 % of 600
    alive = dead_pixels(FRAMES, 0.05, random())[:, ~dead]
    assert (alive == FRAMES[:, ~dead]).all()


def test_shift_moves_columns_and_repeats_the_edge():
    moved = shift(FRAMES, 3, random())
    assert (moved[:, :, 3:] == FRAMES[:, :, :-3]).all()
    assert (moved[:, :, :3] == FRAMES[:, :, :1]).all()


@pytest.mark.parametrize(
    ("name", "level"),
    [("power", 1.5), ("dead_pixels", -0.1), ("shift", 30), ("shift", 0.5), ("power", math.nan)],
)
def test_a_level_that_makes_no_sense_is_named(name, level):
    with pytest.raises(ValueError, match=rf"{name}: expected .* found {level}"):
        OF_FRAMES[name](FRAMES, level, random())


# Bits ---------------------------------------------------------------------------------------------


def stored():
    return [
        torch.arange(1000, dtype=torch.float32).view(10, 100),
        torch.tensor(-1),
        torch.zeros(300_001, dtype=torch.uint8),  # more than a block
    ]


def all_bits(tensors):
    flat = [t.reshape(-1).view(torch.uint8).numpy().copy() for t in tensors]
    return np.unpackbits(np.concatenate(flat))


@pytest.mark.parametrize("rate", [1e-300, 1e-5, 1e-3, 0.1, 0.5])
def test_flips_have_their_rate_and_are_undone(rate):
    tensors = stored()
    before = all_bits(tensors)
    with flipped_bits(tensors, rate, (1, 2)):
        flips = all_bits(tensors) != before
    assert (all_bits(tensors) == before).all()
    expected, n = rate * len(before), len(before)
    assert abs(flips.sum() - expected) <= 5 * math.sqrt(expected * (1 - rate))
    if rate >= 0.1:  # independent: neighbours are both flipped at rate²
        both = (flips[1:] & flips[:-1]).mean()
        assert both == pytest.approx(rate**2, abs=5 * rate / math.sqrt(n))


def test_rates_zero_and_one_flip_nothing_and_everything():
    tensors = stored()
    before = all_bits(tensors)
    for rate in (0, 1):
        with flipped_bits(tensors, rate, (0,)):
            assert ((all_bits(tensors) != before) == rate).all()


def test_flips_are_undone_after_an_error_and_differ_with_the_seed():
    tensors = stored()
    before = all_bits(tensors)
    found = []
    for seed in ((0, 1), (0, 1), (0, 2)):
        with pytest.raises(ZeroDivisionError), flipped_bits(tensors, 0.1, seed):  # noqa: PT012
            found.append(all_bits(tensors))
            raise ZeroDivisionError
        assert (all_bits(tensors) == before).all()
    assert (found[0] == found[1]).all()
    assert (found[0] != found[2]).any()


def test_numbers_in_8_bits_are_near_and_come_back_exactly():
    tensors = stored()
    before = [tensor.clone() for tensor in tensors]
    with flipped_bits_of_int8(tensors, 0.0, (0,)):
        assert (tensors[0] - before[0]).abs().max() <= 999 / 127 / 2 + 1e-3
        assert len(tensors[0].unique()) == 128  # 0…127 steps
        assert torch.equal(tensors[1], before[1])
    with flipped_bits_of_int8(tensors, 0.5, (0,)):
        assert (tensors[0] != before[0]).float().mean() > 0.9
        assert tensors[0].abs().max() <= 999 * 128 / 127 + 1e-3  # and never more
        assert (tensors[2] != before[2]).any()
    assert all(torch.equal(a, b) for a, b in zip(tensors, before, strict=True))


def test_numbers_that_are_all_zero_stay_so_without_flips():
    zeros = torch.zeros(10)
    with flipped_bits_of_int8([zeros], 0.0, (0,)):
        assert (zeros == 0).all()


# The measurement ----------------------------------------------------------------------------------

MODELS = ("hdc", "hdc_integer", "softmax", "ridge", "nearest_neighbour", "cnn1_fast")
LEVELS = {"power": [0.2], "dead_pixels": [0.05], "shift": [1]}


@pytest.fixture(scope="module")
def scene():
    """Speckle of 24×24 pixels, five classes, 20 samples each."""
    generator, labels = np.random.default_rng(1), np.arange(100) % 5
    patterns = generator.exponential(1.0, (5, 24, 24))
    mixed = 0.6 * patterns[labels] + 0.4 * generator.exponential(1.0, (100, 24, 24))
    images = torch.from_numpy(np.clip(50 * mixed, 0, 255).astype(np.uint8))
    return Frames(images, labels, tuple("abcde"), {}, "simulated")


def trained(name, scene):
    """A model of configs/model trained on the first 80 samples."""
    part = OmegaConf.create(configs.of_model(name)["model"])
    if name in ("softmax", "cnn1_fast"):
        part.lr = 1e-2
    model = instantiate(part, "model")
    stop = stop_rule(OmegaConf.load(ROOT / "configs" / "stop" / "paper.yaml"))
    robustness.train_until(model, stop, scene, np.arange(80))
    return model


@pytest.mark.parametrize("name", MODELS)
def test_every_model_is_measured_and_left_as_it_was(name, scene):
    model, test = trained(name, scene), np.arange(80, 100)
    rates = [1e-4, 0.0, 0.5, 0.0]
    rows = list(robustness.rows_of(model, scene, test, LEVELS, rates, 2, ("labels",)))
    in_8_bits = [row for row in rows if row["disturbance"] == "bit_flips_int8"]
    rows = [row for row in rows if row not in in_8_bits]
    assert [row["disturbance"] for row in rows] == ["none", *LEVELS, *["bit_flips"] * 8]
    if name in ("softmax", "ridge", "cnn1_fast"):
        assert [row["level"] for row in in_8_bits] == [0, 1e-4, 1e-4, 0, 0.5, 0.5, 0]
        assert {row["accuracy"] > 0.9 for row in in_8_bits[:4]} == {True}
    else:
        assert in_8_bits == []
    clean, *_, first, again, last, also = rows
    assert {row["n_test"] for row in rows} == {20}
    assert clean["accuracy"] > 0.9
    assert last["right"] == also["right"] == rows[6]["right"] == clean["right"]  # rate 0
    assert first["accuracy"] < clean["accuracy"]  # rate 0.5: nothing is left of the model
    assert (first["level"], again["draw"]) == (0.5, 1)
    assert clean["ci_low"] < clean["accuracy"] <= clean["ci_high"]


def test_a_model_that_cannot_be_asked_has_nothing_right(scene):
    model = trained("nearest_neighbour", scene)
    *_, row = robustness.rows_of(model, scene, np.arange(80, 100), {}, [0.5], 1)
    assert (row["right"], row["disturbance"]) == (0, "bit_flips")


@pytest.fixture
def task(tmp_path, monkeypatch, small_scene):
    """The task of the experiment, with two models, on a scene of two classes."""
    monkeypatch.setenv("RESULTS_DIR", str(tmp_path))
    task = configs.task("robustness")
    assert task.pop("_target_") == "experiments.studies.robustness.measure.run"
    task |= {"scene": small_scene, "seeds": [0, 1], "bit_error_rates": [0.1], **LEVELS}
    return task | {"models": {name: task["models"][name] for name in ("hdc", "ridge")}}


def test_the_task_writes_its_rows(task):
    folder = robustness.run(**task)
    found = measurement.read(folder)
    assert len(found.rows) == 2 * (5 + 7)  # two seeds; ridge in 8 bits too
    assert {row["origin"] for row in found.rows} == {"simulated"}
    files = found.record.environment.sources
    own = "experiments/studies/robustness/disturbances.py"
    assert {own, "hdc/bits.py", "baselines/ridge.py"} < set(files)
    assert "baselines/cnn.py" not in files
    assert "display" not in found.record.config["models"]["hdc"]


def test_frames_of_ones_own_are_told_from_those_of_the_experiment(task, tmp_path):
    folder = robustness.run(**task)
    results = Results(tmp_path)
    assert results.measured("robustness") is None
    assert [one.folder for one in results.measured_elsewhere("robustness")] == [folder]
    robustness.run(
        **{**task, "scene": configs.task("robustness")["scene"], "models": {}, "seeds": []}
    )
    assert Results(tmp_path).measured("robustness").record.config["models"] == {}


def test_a_model_that_does_not_tell_what_it_stores_is_refused(task):
    forest = {
        "_target_": "baselines.sklearn_classifier.SklearnClassifier",
        "estimator": {
            "_target_": "sklearn.ensemble.RandomForestClassifier",
            "n_estimators": 2,
            "random_state": 0,
        },
    }
    task["models"] = {"forest": {"model": forest}}
    expected = r"task\.models\.forest: expected a model that tells .* SklearnClassifier"
    with pytest.raises(ValueError, match=expected):
        robustness.run(**task)


def test_whole_frames_and_the_memory_of_the_cpu_are_asked_for(task):
    with pytest.raises(ValueError, match=r"data\.pixels: expected null, .* found 100"):
        robustness.run(**task | {"pixels": 100})
    with pytest.raises(ValueError, match=r"device: expected cpu, .* found cuda"):
        robustness.run(**task | {"device": "cuda"})


def test_the_config_names_what_there_is():
    task = configs.task("robustness")
    assert task["spared"].keys() | task["stops"].keys() <= task["models"].keys()
    assert inspect.signature(robustness.run).parameters.keys() == task.keys() - {"_target_"}


def test_from_the_command_line(tmp_path, scene):
    np.savez(tmp_path / "frames.npz", frames=scene.images.numpy(), labels=scene.labels)
    others = [name for name in configs.task("robustness")["models"] if name != "ridge"]
    words = ["experiment=robustness", "task.seeds=[0]", "task.bit_error_rates=[0.5]",
             "scene=recorded", f"scene.path={tmp_path / 'frames.npz'}", "threads=1",
             *(f"~task.models.{name}" for name in others)]  # fmt: skip
    done = subprocess.run(
        [sys.executable, "-m", "experiments.run", *words],
        cwd=ROOT,
        env={**os.environ, "RESULTS_DIR": str(tmp_path)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    (folder,) = (tmp_path / "measured").iterdir()
    rows = measurement.read(folder).rows
    assert len(rows) == 1 + 9 + 1 + 2
    assert {(row["origin"], row["model"]) for row in rows} == {("recorded", "ridge")}
