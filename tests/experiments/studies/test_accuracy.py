"""Accuracy against samples, pixels and the time of a prediction."""

import numpy as np
import pytest
import torch

from experiments.records import configs
from experiments.records.results import Results
from experiments.studies.accuracy.view import STUDY
from experiments.studies.crossing import theory
from hdc import HDCClassifier

WORDS = {
    "accuracy_vs_n": ["training samples N", "test accuracy (%)", "HDC", "Ridge read-out"],
    "accuracy_vs_d": ["pixels seen, D", "250,000", "Image correlation"],
    "work_precision": ["time to predict a single frame (ms)", "test error", "HDC"],
}


def test_a_table_has_a_row_for_all_that_its_experiments_ask_for(tmp_path, a_full_set):
    tables = {table.name: table for table in STUDY.tables_of(Results(tmp_path))}
    assert set(tables) == set(WORDS)
    params = configs.sweep("accuracy_vs_d")
    pixels = configs.numbers(params["data.pixels"])
    data = tables["accuracy_vs_d"].data
    assert len(data) == len(params["model"]) * len(pixels)
    rows = tables["accuracy_vs_n"].data
    (line,) = rows[(rows["model"] == "hdc") & (rows["n_train"] == 20)].to_dict("records")
    assert (line["seeds"], line["test_accuracy_final"]) == (2, 0.9)


@pytest.mark.filterwarnings("error")
def test_the_figures_are_drawn_within_their_frames(a_full_set, drawn):
    figures = drawn(STUDY)
    assert set(figures) == set(WORDS)
    for name, words in figures.items():
        for expected in [*WORDS[name], "simulated frames", "95 % intervals"]:
            assert expected in words, (name, expected)


def test_a_curve_has_more_than_one_place(write_run, drawn):
    write_run("hdc", n_train=20)
    assert drawn(STUDY) == {}
    write_run("ridge", n_train=100)
    assert set(drawn(STUDY)) == {"accuracy_vs_n"}


def test_where_hdc_crosses_90_percent(write_run, number):
    for seed in range(3):
        for n, wrong in ((5, 20 + 10 * seed), (50, 0)):
            write_run("hdc", seed=seed, n_train=n, wrong=range(wrong))
    crossed = number(STUDY, "accuracy_vs_n/n_for_90_percent")
    # From 80, 70 and 60 % at N = 5 to 100 % at 50: each sensor has a curve of its own.
    each = [5 + 45 * (90 - start) / (100 - start) for start in (80, 70, 60)]
    half = 4.302652730 * np.std(each, ddof=1) * np.sqrt(4 / 3)
    middle = np.mean(each)
    assert (crossed.value, crossed.low, crossed.high) == pytest.approx(
        (middle, middle - half, middle + half)
    )
    assert (crossed.n, crossed.seeds) == (300, 3)


@pytest.mark.parametrize("sizes", [(5,), (5, 10)])
def test_a_level_that_was_not_crossed_is_no_number(tmp_path, write_run, sizes):
    for n in sizes:
        write_run("hdc", n_train=n, wrong=range(30 if len(sizes) > 1 else 0))
    assert not list(STUDY.quantities_of(Results(tmp_path)))


SIDE, CLASSES, TEST = 40, 5, 100
COMMON, OWN = 0.08, 0.12  # correlations of pixels of two classes, and of one


def frames(rng, n):
    """Frames uint8 [n, SIDE, SIDE] and labels: independent pixels, of which a part is the same in
    all frames, another in all of a class."""
    labels = np.arange(n) % CLASSES
    common = rng.normal(size=SIDE**2)
    of_class = np.random.default_rng(rng.integers(2**31)).normal(size=(CLASSES, SIDE**2))
    rest = rng.normal(size=(n, SIDE**2))
    pixels = np.sqrt(COMMON) * common + np.sqrt(OWN - COMMON) * of_class[labels]
    pixels = pixels + np.sqrt(1 - OWN) * rest
    return np.clip(128 + 30 * pixels, 0, 255).astype(np.uint8).reshape(-1, SIDE, SIDE), labels


@pytest.mark.parametrize("n", [5, 15, 25, 45, 95])  # odd numbers a class: majorities without ties
def test_hdc_is_as_accurate_as_theory_says_where_correlations_are_known(n):
    """Hypervectors correlate by 2/π·asin ρ and scatter only because D is finite."""
    within, between = (2 / np.pi * np.arcsin(rho) for rho in (OWN, COMMON))
    mean = np.where(np.eye(CLASSES, dtype=bool), within, between)
    moments = theory.Correlations(mean, 0 * mean, 0 * mean, 0 * mean)
    expected = theory.hdc_accuracy(moments, n, SIDE**2)
    shares = []
    for seed in range(25):
        made, labels = frames(np.random.default_rng([n, seed]), n + TEST)
        model = HDCClassifier().fit(torch.from_numpy(made[:n]), labels[:n])
        shares.append(np.mean(np.asarray(model.predict(torch.from_numpy(made[n:]))) == labels[n:]))
    error = 3 * np.std(shares, ddof=1) / np.sqrt(len(shares))
    assert np.mean(shares) == pytest.approx(expected, abs=error + 0.01)
