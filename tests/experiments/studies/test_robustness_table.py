"""The table and figure of the robustness measurement pool what was measured and say so."""

from __future__ import annotations

import copy

import pytest

from experiments.records import configs
from experiments.records.results import Results
from experiments.reporting.estimates import mean_share
from experiments.studies.robustness.disturbances import OF_FRAMES
from experiments.studies.robustness.view import FLIPS, LEVELS, STUDY, accuracies

CASES = [
    ("none", 0.0),
    ("power", 0.2),
    ("dead_pixels", 0.05),
    ("shift", 1),
    ("bit_flips", 1e-4),
    ("bit_flips", 0.5),
    ("bit_flips_int8", 0.0),
    ("bit_flips_int8", 0.5),
]


def rows():
    """Two models, two seeds of 10 test frames, two draws of flipped bits."""
    for model in ("hdc", "softmax"):
        for seed in (0, 1):
            for name, level in CASES if model == "softmax" else CASES[:-2]:
                for draw in range(2 if name == "bit_flips" else 1):
                    lost = {"none": 0, "bit_flips": 8 if model == "softmax" and draw else 1}
                    right = 10 - lost.get(name, 2) - seed
                    yield {
                        "origin": "simulated",
                        "model": model,
                        "seed": seed,
                        "disturbance": name,
                        "level": level,
                        "draw": draw,
                        "n_test": 10,
                        "right": right,
                        "accuracy": right / 10,
                        "chance": 0.2,
                        "model_bits": 8000,
                    }


@pytest.fixture
def config():
    task = copy.deepcopy(configs.task("robustness"))
    return {key: task[key] for key in ("scene", "split", "stops")}


@pytest.fixture
def results(tmp_path, write_measurement, config):
    write_measurement("robustness", list(rows()), config=config)
    return Results(tmp_path)


def test_seeds_and_draws_are_pooled(results):
    found = accuracies(results.measured("robustness"))
    assert set(found) == set(CASES)
    clean = found["none", 0.0]["hdc"]
    assert clean == mean_share([1, 0.9], 10)
    assert clean.value == 0.95
    flipped = found["bit_flips", 1e-4]["softmax"]
    assert flipped.value == pytest.approx((0.9 + 0.2 + 0.8 + 0.1) / 4)
    assert flipped[1:] == (0.1, 0.9)
    assert set(found["bit_flips_int8", 0.5]) == {"softmax"}


def test_the_table_says_what_is_shown(results):
    (table,) = STUDY.tables(results)
    assert table.name == "robustness"
    text = table.markdown()
    assert "simulated frames, 5 classes" in text
    assert "| Disturbance | Level | HDC, 1.00 kB | Softmax, 1.00 kB |" in text
    assert "| laser power ± | 20 % | 75 [0, 100] |" in text
    assert "| bit error rate | 1e-04 | 85 (80…90) | 50 (10…90) |" in text
    assert "| bit error rate, 8-bit numbers | 0.5 | – | 75 (70…80) |" in text
    assert "2 seeds, 2 draws of bits each" in text
    assert "Made by other code" not in text
    assert table.csv().splitlines()[1].startswith("none,0,0.95,")


def test_a_model_that_was_stopped_at_90_percent_is_named(results):
    (table,) = STUDY.tables(results)
    assert "exceeded 90 % (stop=reached), and so short of its best: CNN, 1 layer, bfloat16." in (
        table.note
    )


def test_other_frames_have_names_of_their_own(tmp_path, write_measurement, config):
    config["split"]["test_fraction"] = 0.5
    write_measurement("robustness", list(rows()), config=config)
    (tmp_path / "measured" / "robustness").rename(tmp_path / "measured" / "robustness-abc")
    found = Results(tmp_path)
    assert [one.name for one in (*STUDY.tables(found), *STUDY.plots(found))] == [
        "robustness_abc",
        "robustness_abc",
    ]


@pytest.mark.filterwarnings("error")
def test_figure_fits_and_says_what_it_is(results, drawn):
    words = drawn(STUDY)["robustness"]
    for expected in (
        "simulated frames, 5 classes, 2 seeds",
        "bit error rate",
        "dead pixels (%)",
        "camera shifted (px)",
        "chance",
        "8 bits for each float32",
    ):
        assert expected in words


def test_every_disturbance_has_a_name():
    assert set(LEVELS) == {"none", *FLIPS, *OF_FRAMES}
