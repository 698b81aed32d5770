"""Disturbances have their size and are undone; an experiment tells what they cost."""

from __future__ import annotations

import math

import numpy as np
import pandas as pd
import pytest
import torch

from experiments.protocol.model import models_of
from experiments.protocol.settings import Split
from experiments.protocol.splits import choose
from experiments.protocol.stop import StopRule
from experiments.protocol.task import Context
from experiments.studies.robustness import measure
from experiments.studies.robustness.disturbances import (
    OF_FRAMES,
    dither,
    flipped_bits,
    flipped_bits_of_int8,
    shift,
)
from tests.experiments import composed

FRAMES = np.random.default_rng(0).integers(0, 256, (6, 20, 30), np.uint8)
SPLIT = Split("random", 0.2)


def random():
    return np.random.default_rng(0)


# Frames -------------------------------------------------------------------------------------------


@pytest.mark.parametrize("disturb", OF_FRAMES.values())
def test_nothing_is_disturbed_at_level_zero_nor_in_the_frames_themselves(disturb):
    given = FRAMES.copy()
    assert (disturb(given, 0, random()) == given).all()
    disturb(given, 1, random())
    assert (given == FRAMES).all()


def test_disturbances_of_frames_have_their_size():
    moved = shift(FRAMES, 3, random())
    assert (moved[:, :, 3:] == FRAMES[:, :, :-3]).all()
    assert (moved[:, :, :3] == FRAMES[:, :, :1]).all()
    added = dither(np.full((40, 50, 50), 100, np.uint8), 1, random()).astype(int) - 100
    values, counts = np.unique(added, return_counts=True)
    assert values.tolist() == [-1, 0, 1]
    assert counts / added.size == pytest.approx(1 / 3, abs=0.01)


@pytest.mark.parametrize(("dtype", "edge"), [(np.uint8, 0), (np.uint16, 65535)])
def test_disturbances_stay_within_the_camera_s_range(dtype, edge):
    given = np.full((50, 9, 9), edge, dtype)
    apart = np.abs(dither(given, 2, random()).astype(int) - edge)
    assert set(np.unique(apart)) == {0, 1, 2}


# Bits ---------------------------------------------------------------------------------------------


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


@pytest.mark.parametrize("rate", [0, 1e-3, 0.5, 1])
def test_flips_have_their_rate_and_are_undone(stored, rate):
    before = all_bits(stored)
    flips = []
    for seed in ((1, 2), (1, 2), (1, 3)):
        with flipped_bits(stored, rate, seed):
            flips.append(all_bits(stored) != before)
        assert (all_bits(stored) == before).all()
    n = len(before)
    deviation = math.sqrt(rate * (1 - rate) / n)
    assert flips[0].mean() == pytest.approx(rate, abs=5 * deviation)
    assert (flips[0] == flips[1]).all()
    assert (flips[0] != flips[2]).any() == (0 < rate < 1)
    # Independent: neighbours are both flipped at rate².
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


# Models -------------------------------------------------------------------------------------------

# A rate at which nothing is flipped comes last: the model is what it was.
STORED = [0.5, 1e-12]
CASES = [
    *(("none", 0), ("shift", 2), ("dither", 1)),
    *(("bit_flips", rate) for rate in STORED),
]
OF_FLOATS = [("bit_flips_int8", rate) for rate in (0, *STORED)]


@pytest.mark.parametrize(("name", "cases"), [("hdc", []), ("ridge", OF_FLOATS)])
def test_every_model_is_measured_and_left_as_it_was(
    name, cases, make_scene, monkeypatch
):
    scene = make_scene(n=99, shape=(24, 24))
    monkeypatch.setattr(Context, "scenes", lambda run, config, seeds: [(3, scene)])
    models = composed.models(name)
    task = measure.Robustness(
        scene={},
        split=SPLIT,
        models=models,
        stop=StopRule(),
        seeds=[3],
        disturbances={"shift": [2], "dither": [1]},
        bit_error_rates=STORED,
    )
    rows = pd.DataFrame(task.rows(Context()))
    right = rows.set_index(["disturbance", "level"]).right
    assert set(right.index) == {*CASES, *cases}
    model = models_of(models)[name]
    train, test = choose(scene, SPLIT, 3)
    model.fit(scene.images[train], scene.labels[train])
    undisturbed = (model.predict(scene.images[test]) == scene.labels[test]).sum()
    assert undisturbed > 18
    assert right["none", 0] == right["bit_flips", 1e-12] == undisturbed
    assert right["bit_flips", 0.5] < undisturbed
    if cases:
        assert min(right["bit_flips_int8", 0], right["bit_flips_int8", 1e-12]) > 18
