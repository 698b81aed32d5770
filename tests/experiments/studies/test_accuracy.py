"""Accuracy against samples and pixels."""

import numpy as np
import pytest

from experiments.records import configs
from experiments.records.results import Results
from experiments.studies.accuracy.view import STUDY

TABLES = {"accuracy_vs_n", "accuracy_vs_d"}


def test_a_table_has_a_row_for_all_that_its_experiments_ask_for(tmp_path, a_full_set):
    tables = {table.name: table for table in STUDY.tables_of(Results(tmp_path))}
    assert set(tables) == TABLES
    params = configs.sweep("accuracy_vs_d")
    pixels = configs.numbers(params["data.pixels"])
    data = tables["accuracy_vs_d"].data
    assert len(data) == len(params["model"]) * len(pixels)
    rows = tables["accuracy_vs_n"].data
    (line,) = rows[(rows["model"] == "hdc") & (rows["n_train"] == 20)].to_dict(
        "records"
    )
    assert (line["seeds"], line["test_accuracy_final"]) == (2, 0.9)


@pytest.mark.filterwarnings("error")
def test_the_figure_is_drawn_within_its_frame(a_full_set, drawn):
    words = drawn(STUDY)["accuracy_vs_n"]
    expected = ("training samples N", "test accuracy (%)", "HDC", "Ridge")
    for text in (*expected, "simulated frames", "95 % intervals"):
        assert text in words


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
