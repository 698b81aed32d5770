"""Correlations within and between classes, against numpy's; the pictures; a measurement."""

from __future__ import annotations

import copy

import cv2
import numpy as np
import pytest
import torch

from experiments import class_correlations, measurement
from experiments.class_correlations import add_up, members_of, rows, write_images
from experiments.repetitions import at_seed
from hdc import bits
from hdc.encode import encode
from scenes.frames import Frames
from scenes.sensor.configured import scene as configured

SPLIT = {"kind": "random", "test_fraction": 0.25, "n_train": None}


@pytest.fixture(autouse=True)
def results(tmp_path, monkeypatch):
    monkeypatch.setenv("RESULTS_DIR", str(tmp_path))
    return tmp_path


def a_scene(per_class=(12, 12, 12), side=10):
    rng = np.random.default_rng(0)
    labels = np.repeat(np.arange(len(per_class)), per_class)
    base = rng.integers(0, 80, (len(per_class), side, side))
    frames = (base[labels] + rng.integers(0, 120, (len(labels), side, side))).astype(np.uint8)
    return Frames(torch.from_numpy(frames), labels, tuple("ABCDE"[: len(per_class)]))


def table(scene, **choice):
    members = members_of(scene, SPLIT, 0)
    sums, prototypes = add_up(scene, members)
    found = {}
    for row in rows(scene.classes, sums, prototypes, **choice):
        found[row["kind"], row["samples"], row["class_i"], row["class_j"]] = row
    return found, members, prototypes


def test_every_row_is_the_mean_of_numpys_coefficients():
    scene = a_scene()
    found, members, prototypes = table(scene)
    assert len(found) == 3 * 3 * 3 * 3
    frames = scene.images.flatten(1).numpy().astype(float)
    words = encode(scene.images)
    ones = bits.unpack(words, 100).numpy().astype(float)
    for (kind, samples, i, j), row in found.items():
        parts = [samples] if samples != "all" else ["training", "held-out"]
        a, b = (np.concatenate([members[p]["ABC".index(c)] for p in parts]) for c in (i, j))
        assert row["n"] == len(a) == {"training": 9, "held-out": 3, "all": 12}[samples]
        if kind == "prototype":
            stored = prototypes["ABC".index(i)].numpy().astype(float)
            expected = np.mean([np.corrcoef(stored, ones[k])[0, 1] for k in b])
        else:
            x = frames if kind == "speckle" else ones
            pairs = np.corrcoef(x[a], x[b])[: len(a), len(a) :]
            expected = pairs[~np.eye(len(a), dtype=bool)].mean()
        assert float(row["value"]) == pytest.approx(expected, abs=2e-6), (kind, samples, i, j)


def test_prototypes_are_made_of_the_training_samples_alone():
    scene = a_scene()
    members = members_of(scene, SPLIT, 0)
    _, prototypes = add_up(scene, members)
    for c in range(3):
        majority = bits.majority(encode(scene.images[members["training"][c]]))
        assert torch.equal(prototypes[c], bits.unpack(majority, 100))


def test_constant_frames_are_counted_in_their_rows():
    scene = a_scene()
    members = members_of(scene, SPLIT, 0)
    scene.images[members["held-out"][1, 0]] = 7
    with pytest.warns(UserWarning, match="constant"):
        sums, prototypes = add_up(scene, members, ["speckle"])
    for row in rows(scene.classes, sums, prototypes, ["speckle"], ["held-out", "training"]):
        touched = "B" in (row["class_i"], row["class_j"]) and row["samples"] == "held-out"
        assert row["undefined"] == touched
        assert (row["value"] == "nan") == touched


def test_classes_of_different_sizes_are_refused():
    with pytest.raises(ValueError, match=r"as many training samples of every class, found \[6, 9"):
        members_of(a_scene((12, 8, 12)), SPLIT, 0)


def test_pictures_are_parts_of_what_they_show(tmp_path):
    scene = a_scene()
    members = members_of(scene, SPLIT, 0)
    _, prototypes = add_up(scene, members, ["hypervector"])
    written = write_images(scene, members["training"][:, 0], prototypes, [2, 1, 8], tmp_path)
    assert len(written) == 3 * 4

    def read(name):
        return cv2.imread(str(tmp_path / name), cv2.IMREAD_UNCHANGED)

    first = members["training"][1, 0]
    np.testing.assert_array_equal(read("B-speckle.png"), scene.images[first, 2:10, 1:9])
    ones = 255 * bits.unpack(encode(scene.images[[first]]), 100).view(10, 10)
    np.testing.assert_array_equal(read("B-hypervector.png"), ones[2:10, 1:9])
    np.testing.assert_array_equal(
        read("B-prototype.png"), 255 * prototypes[1].view(10, 10)[2:10, 1:9]
    )
    assert read("B-whole.png").shape == (2, 2)


@pytest.mark.parametrize("crop", [[0, 0, 11], [-1, 0, 4], [0, 7, 4], [0, 4]])
def test_a_picture_outside_the_frame_is_refused(tmp_path, crop):
    scene = a_scene()
    with pytest.raises(ValueError, match=r"task\.crop: .* 10 × 10 pixels, found"):
        write_images(scene, np.array([0, 12, 24]), torch.zeros(3, 100).bool(), crop, tmp_path)


def test_a_measurement_over_seeds(results, small_scene):
    folder = class_correlations.run(
        "some", small_scene, SPLIT, seeds=[0, 1], samples=["held-out"], crop=[0, 0, 20], cache=False
    )
    found = measurement.read(results, "some")
    assert folder == results / "measured" / "some"
    assert len(found.rows) == 2 * 3 * 2 * 2
    values = {row["seed"]: row["value"] for row in found.rows}
    assert values["0"] != values["1"]
    assert {"experiments/correlation.py", "scenes/sensor/paths.py"} <= set(
        found.record["environment"]["sources"]
    )
    assert len(list(folder.glob("*.png"))) == 2 * 4
    assert not (results / "cache").exists()


def test_frames_of_a_seed_are_those_of_runs_with_that_seed():
    from hydra.utils import instantiate
    from omegaconf import OmegaConf

    from experiments.selection import CONFIGS

    root = OmegaConf.create({"seed": {"sensor": 0, "samples": 0}, "device": "cpu"})
    root.scene = OmegaConf.load(CONFIGS / "scene" / "touch.yaml")
    config = OmegaConf.to_container(root, resolve=True)["scene"]
    before = copy.deepcopy(config)
    made = instantiate(at_seed(config, 3), _convert_="all")
    assert made.fingerprint() == configured("touch", 3, 3).fingerprint()
    assert config == before


@pytest.mark.parametrize(
    ("choice", "message"),
    [
        ({"kinds": ["speckles"]}, r"task\.kinds: expected among .* found 'speckles'"),
        ({"samples": ["some"]}, r"task\.samples: expected among .* found 'some'"),
    ],
)
def test_unknown_choices_are_named(small_scene, choice, message):
    with pytest.raises(ValueError, match=message):
        class_correlations.run("some", small_scene, SPLIT, seeds=[0], **choice)
