"""Disturbances have their size and are undone; an experiment tells what they cost."""

from __future__ import annotations

import math

import numpy as np
import pandas as pd
import pytest
import torch
from omegaconf import OmegaConf

from experiments.protocol.experiment import Run
from experiments.protocol.model import instantiate
from experiments.records import configs
from experiments.reporting.estimates import mean_share
from experiments.studies.robustness import view
from experiments.studies.robustness.disturbances import (
    OF_FRAMES,
    dead_pixels,
    dither,
    flipped_bits,
    flipped_bits_of_int8,
    flipped_pixels,
    flipped_queries,
    power,
    shift,
)
from experiments.studies.robustness.measure import Rates, robustness, rows_of
from hdc import HDCClassifier, bits
from scenes.frames import Frames

FRAMES = np.random.default_rng(0).integers(0, 256, (6, 20, 30), np.uint8)


def random():
    return np.random.default_rng(0)


def test_disturbances_of_frames():
    given = FRAMES.copy()
    assert all(
        (disturb(given, 0, random()) == given).all() for disturb in OF_FRAMES.values()
    )
    bright = power(np.full((500, 1, 1), 100, np.uint8), 0.2, random())
    assert (bright.min(), bright.max()) == (80, 120)
    assert power(np.full((50, 1, 1), 60000, np.uint16), 0.2, random()).max() == 65535
    dead = (dead_pixels(np.full_like(FRAMES, 7), 0.05, random()) == 0).all(axis=0)
    assert dead.sum() == 30  # 5 % of 600, the same in every frame
    moved = shift(FRAMES, 3, random())
    assert (moved[:, :, 3:] == FRAMES[:, :, :-3]).all()
    assert (moved[:, :, :3] == FRAMES[:, :, :1]).all()
    assert (given == FRAMES).all()


@pytest.fixture
def stored():
    return [
        torch.arange(1000, dtype=torch.float32).view(10, 100),
        torch.tensor(-1),
        torch.zeros(300_001, dtype=torch.uint8),  # more than a block
    ]


def all_bits(tensors):
    flat = [t.reshape(-1).view(torch.uint8).numpy().copy() for t in tensors]
    return np.unpackbits(np.concatenate(flat))


@pytest.mark.parametrize("rate", [0, 1e-300, 1e-5, 1e-3, 0.1, 0.5, 1])
def test_flips_have_their_rate_and_are_undone(stored, rate):
    before = all_bits(stored)
    flips = []
    for seed in ((1, 2), (1, 2), (1, 3)):
        with flipped_bits(stored, rate, seed):
            flips.append(all_bits(stored) != before)
        assert (all_bits(stored) == before).all()
    expected, n = rate * len(before), len(before)
    assert abs(flips[0].sum() - expected) <= 5 * math.sqrt(expected * (1 - rate))
    assert (flips[0] == flips[1]).all()
    assert (flips[0] != flips[2]).any() == (1e-5 <= rate < 1)
    if 0.1 <= rate < 1:  # independent: neighbours are both flipped at rate²
        both = (flips[0][1:] & flips[0][:-1]).mean()
        assert both == pytest.approx(rate**2, abs=5 * rate / math.sqrt(n))


def test_numbers_in_8_bits_are_near_and_come_back_exactly(stored):
    before = [tensor.clone() for tensor in stored]
    with flipped_bits_of_int8([*stored, torch.zeros(3)], 0.0, (0,)):
        assert (stored[0] - before[0]).abs().max() <= 999 / 127 / 2 + 1e-3
        assert len(stored[0].unique()) == 128  # 0…127 steps
        assert torch.equal(stored[1], before[1])
    with flipped_bits_of_int8(stored, 0.5, (0,)):
        assert (stored[0] != before[0]).float().mean() > 0.9
        assert stored[0].abs().max() <= 999 * 128 / 127 + 1e-3  # and never more
    assert all(torch.equal(a, b) for a, b in zip(stored, before, strict=True))


def test_dither_is_uniform_and_stays_within_the_camera_s_range():
    middle = np.full((40, 50, 50), 100, np.uint8)
    added = dither(middle, 1, random()).astype(int) - 100
    values, counts = np.unique(added, return_counts=True)
    assert values.tolist() == [-1, 0, 1]
    assert counts / added.size == pytest.approx(1 / 3, abs=0.01)
    for edge in (0, 255):
        dithered = dither(np.full_like(FRAMES, edge), 2, random())
        assert set(np.unique(dithered)) == {edge, abs(edge - 1), abs(edge - 2)}
    assert dither(np.full((1, 9, 9), 65535, np.uint16), 1, random()).min() == 65534


@pytest.fixture(scope="module")
def scene():
    """Speckle of 24×24 pixels, five classes, 20 samples each."""
    generator, labels = np.random.default_rng(1), np.arange(100) % 5
    patterns = generator.exponential(1.0, (5, 24, 24))
    mixed = 0.6 * patterns[labels] + 0.4 * generator.exponential(1.0, (100, 24, 24))
    images = torch.from_numpy(np.clip(50 * mixed, 0, 255).astype(np.uint8))
    return Frames(images, labels, tuple("abcde"), {}, "simulated")


@pytest.mark.parametrize(
    "name",
    ["hdc", "hdc_levels_lda", "bits_chosen", "ridge", "nearest_neighbour"],
)
def test_every_model_is_measured_and_left_as_it_was(name, scene):
    model = instantiate(OmegaConf.create(configs.part("model", name)["model"]), "model")
    model.fit(scene.images[:80], scene.labels[:80])
    test, levels = np.arange(80, 100), {"power": [0.2], "shift": [1]}
    rates = Rates([1e-4, 0.5], [0.01, 0.5])
    rows = pd.DataFrame(rows_of(model, scene, test, levels, rates, ("labels",)))
    assert rows.disturbance[:3].tolist() == ["none", "power", "shift"]
    queries = rows[rows.disturbance == "query_flips"].right.tolist()
    assert queries[0] > 15
    assert queries[1] < 15
    assert set(rows.n_test) == {20}
    assert rows.right[0] > 18
    right = rows.groupby(["disturbance", "level"]).right.mean()
    assert right["bit_flips", 0.5] < right["none", 0]
    if name == "ridge":
        assert right["bit_flips_int8", 0.0] > 18
        assert right["bit_flips_int8", 1e-4] > 18
    assert (
        model.predict(scene.images[test]) == scene.labels[test]
    ).sum() == rows.right[0]


def test_the_experiment_of_the_config(small_scene):
    task = configs.task("robustness")
    assert task.pop("_target_").endswith("robustness.measure.robustness")
    assert all(configs.part("model", name) for name in task["spared"])
    small = {"scene": small_scene, "seeds": [0], "bit_error_rates": [0.1]}
    small["query_error_rates"] = [0.1]
    models = {name: task["models"][name] for name in ("hdc", "softmax_dual")}
    rows = list(robustness.rows(Run(), **{**task, **small, "models": models}))
    # softmax in 8 bits too: dithered frames at two levels, flips, and rounding alone
    assert len(rows) == (1 + 7 + 2) + (1 + 7 + 2 + 2 + 2)
    rounded = [row for row in rows if row["disturbance"] == "dither_of_int8"]
    assert [(row["model"], row["level"]) for row in rounded] == [
        ("softmax_dual", 1),
        ("softmax_dual", 2),
    ]


@pytest.mark.parametrize("encoder", ["median", "levels"])
def test_queries_have_flips_of_their_rate_and_of_no_other_bits(encoder, scene):
    model = HDCClassifier(encoder=encoder).fit(scene.images[:80], scene.labels[:80])
    words = model.encode(scene.images[80:])
    before = words.packed.clone()
    for rate in (0.0, 0.1, 1.0):
        after = flipped_queries(words, rate, random()).packed
        used = model.dimension_ * len(words)
        flips = int(bits.count_ones(before ^ after).sum())
        assert abs(flips - rate * used) <= 5 * math.sqrt(used * rate * (1 - rate))
        # Nothing beyond the last bit, which would count in a distance.
        unpacked = bits.unpack(after, after.shape[1] * 64)
        assert not unpacked[:, model.dimension_ :].any()
    assert torch.equal(words.packed, before)


def test_pixels_have_flips_of_their_rate():
    assert (flipped_pixels(FRAMES, 0.0, random()) == FRAMES).all()
    assert (flipped_pixels(FRAMES, 1.0, random()) == 255 - FRAMES).all()
    changed = flipped_pixels(FRAMES, 0.1, random()) ^ FRAMES
    share = np.unpackbits(changed).mean()
    assert share == pytest.approx(0.1, abs=0.01)


def test_bounds_of_flips_are_the_worst_and_the_best_seed():
    right = {("none", 0.0): [10, 9], ("bit_flips", 1e-4): [9, 2]}
    # The mean of equal shares is less than each in the last digit.
    right["bit_flips", 1e-3] = [6] * 20
    rows = [
        {"model": "softmax", "seed": seed, "disturbance": name, "level": level, "right": n,
         "n_test": 10}
        for (name, level), numbers in right.items() for seed, n in enumerate(numbers)
    ]  # fmt: skip
    (line,) = view.accuracies(pd.DataFrame(rows)).to_dict("records")
    assert line["none_0_low"] == mean_share([1, 0.9], 10).low
    flipped = [line[f"bit_flips_0.0001{end}"] for end in ("", "_low", "_high")]
    assert flipped == pytest.approx([0.55, 0.2, 0.9])
    assert {line[f"bit_flips_0.001{end}"] for end in ("", "_low", "_high")} == {0.6}


def test_the_legend_has_every_model_that_some_panel_shows(
    tmp_path, write_measurement, drawn
):
    """The last row of panels may lack one that was measured on few scenes."""
    for scene, models in (("gelsight", ("hdc", "bits_chosen")), ("fibre", ("hdc",))):
        rows = [
            {"model": model, "seed": 0, "disturbance": name, "level": level, "right": 5,
             "n_test": 10, "n_classes": 5, "origin": "measured"}
            for model in models
            for name, level in (("none", 0.0), ("bit_flips", 0.01), ("bit_flips", 0.1))
        ]  # fmt: skip
        config = {"scene": configs.part("scene", scene)["scene"]}
        write_measurement("robustness", rows, config=config, scene=scene)
    words = drawn(view.STUDY)["robustness"]
    assert words.count("Bits, chosen") == words.count("HDC ") == 1
