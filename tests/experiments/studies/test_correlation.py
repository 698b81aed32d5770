"""Correlations within and between classes, against numpy's; the pictures; a measurement."""

from __future__ import annotations

import copy

import cv2
import numpy as np
import pytest
import torch
from omegaconf import OmegaConf

from experiments.protocol.scenes import at_seed
from experiments.records import measurement
from experiments.records.results import Results
from experiments.studies.correlation import measure as class_correlations
from experiments.studies.correlation import view
from experiments.studies.correlation.measure import add_up, members_of, rows, write_images
from hdc import bits
from hdc.encode import encode
from scenes.frames import Frames

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
    found = measurement.read(folder)
    assert folder.parent == results / "measured"
    assert len(found.rows) == 2 * 3 * 2 * 2
    values = {row["seed"]: row["value"] for row in found.rows}
    assert values["0"] != values["1"]
    assert {"experiments/studies/correlation/sums.py", "scenes/sensor/paths.py"} <= set(
        found.record.environment.sources
    )
    assert len(list(folder.glob("*.png"))) == 2 * 4
    assert not (results / "cache").exists()


@pytest.mark.parametrize("scene", ["touch", "finger", "drift", "tactile", "fibre"])
def test_frames_of_a_seed_are_those_of_runs_with_that_seed(composed, scene):
    cfg = composed(scene, "hdc", "paper")
    config = OmegaConf.to_container(cfg.scene, resolve=True)
    before = copy.deepcopy(config)
    made = at_seed(config, 3)
    assert config == before != made
    cfg.seed.run = 3
    assert made == OmegaConf.to_container(cfg.scene, resolve=True)


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


# What is shown ------------------------------------------------------------------------------------


@pytest.fixture
def measured(results, write_measurement):
    """A measurement of two seeds: C_ll = 0.2 (0.3 in seed 1), elsewhere 0.1; pictures of noise."""
    classes = ("L1", "L2", "R1", "R2", "None")
    made = [
        {"origin": "simulated", "seed": seed, "kind": kind, "samples": samples,
         "class_i": a, "class_j": b,
         "value": 0.2 + 0.1 * seed if a == b else 0.1, "n": 100, "undefined": 0}
        for seed in (0, 1) for kind in ("speckle", "hypervector", "prototype")
        for samples in ("training", "held-out", "all") for a in classes for b in classes
    ]  # fmt: skip
    write_measurement("correlation", made, config={"seeds": [0, 1], "crop": [0, 0, 8]})
    rng = np.random.default_rng(0)
    for name in classes:
        for what in ("speckle", "hypervector", "prototype", "whole"):
            path = results / "measured" / "correlation" / f"{name}-{what}.png"
            assert cv2.imwrite(str(path), rng.integers(0, 256, (8, 8), np.uint8))


def test_contrasts_are_means_over_seeds(measured, number):
    found = number(view.STUDY, "correlation/max_same_class_speckle")
    assert found.value == pytest.approx(0.25)
    found = number(view.STUDY, "correlation/contrast_prototype")
    # ΔC is 0.1 and 0.2; t(0.975, 1)·0.0707·√1.5 = 1.1
    assert found.value == pytest.approx(0.15)
    assert found.high == pytest.approx(0.15 + 1.1004, abs=1e-3)
    assert "of those in the prototypes 0.15, of the others 0.15" in found.note
    assert (found.seeds, found.n) == (2, 2 * 5 * 100)


@pytest.mark.filterwarnings("error")
def test_the_figures_say_what_they_are_of(measured, drawn):
    found = drawn(view.STUDY)
    assert set(found) == {"fig4_images", "fig4_correlations"}
    for words in found.values():
        assert "simulated frames" in words
    assert "paper0.178" in found["fig4_correlations"]
    assert ".250" in found["fig4_correlations"]


def test_rows_that_are_not_there_are_named(results, write_measurement):
    write_measurement("correlation", [{"kind": "speckle", "samples": "all"}])
    with pytest.raises(ValueError, match=r"rows\.csv: expected rows prototype, held-out, found"):
        view.matrices(Results(results).measured("correlation"), "prototype", "held-out")
