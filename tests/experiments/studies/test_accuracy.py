"""Accuracy against samples, pixels and the time of a prediction."""

import numpy as np
import pytest
from matplotlib import pyplot as plt

from experiments.records import configs
from experiments.records.results import Results
from experiments.reporting import published
from experiments.studies.accuracy import view
from experiments.studies.accuracy.view import STUDY

WORDS = {
    "accuracy_vs_n": ["training samples N", "test accuracy (%)", "paper, Table I", "HDC",
                      "Ridge read-out", "only for N", "400"],
    "accuracy_vs_d": ["pixels seen, D", "250,000", "test accuracy (%)", "Image correlation"],
    "work_precision": ["time to predict a single frame (ms)", "test error", "HDC", "Softmax"],
}  # fmt: skip


def test_a_table_has_a_row_for_all_that_its_experiments_ask_for(tmp_path, a_full_set):
    found = {table.name: table for table in STUDY.tables(Results(tmp_path))}
    assert set(found) == set(WORDS)
    for name, experiments in (
        ("accuracy_vs_n", ["accuracy_vs_n", "accuracy_vs_n_cnn"]),
        ("accuracy_vs_d", ["accuracy_vs_d"]),
    ):
        wanted = set()
        for experiment in experiments:
            params = configs.sweep(experiment)
            sizes = configs.numbers(params.get("split.n_train", ["null"]))
            pixels = configs.numbers(params.get("data.pixels", ["null"]))
            wanted |= {(m, n, d) for m in params["model"] for n in sizes for d in pixels}
        assert len(found[name].data) == len(wanted)
        assert found[name].commands == [f"python -m experiments.run experiment={e}"
                                        for e in experiments]  # fmt: skip
    rows = found["accuracy_vs_n"].data
    (line,) = rows[(rows["model"] == "hdc") & (rows["n_train"] == 20)].to_dict("records")
    assert (line["seeds"], line["test_accuracy_final"]) == (2, 0.9)


@pytest.mark.filterwarnings("error")
def test_words_of_the_figures(a_full_set, drawn):
    found = drawn(STUDY)
    assert set(found) == set(WORDS)
    for name, words in found.items():
        for expected in [*WORDS[name], "simulated frames", "95 % intervals", "no records:"]:
            assert expected in words, (name, expected)


@pytest.mark.filterwarnings("error")
def test_a_curve_has_more_than_one_place(write_run, drawn):
    write_run("hdc", n_train=20)
    assert drawn(STUDY) == {}
    write_run("ridge", n_train=100)
    assert set(drawn(STUDY)) == {"accuracy_vs_n"}


def test_the_paper_stands_where_it_measured(tmp_path, a_full_set):
    figure = view.accuracy_vs_n(view.rows(Results(tmp_path), "accuracy_vs_n"))
    stars = [line for line in figure.axes[0].lines if line.get_marker() == "*"]
    shown = sorted(float(line.get_ydata()[0]) for line in stars)
    known = [published.value(f"table1/{model}_test_accuracy") for model in view.PUBLISHED_N]
    assert shown == pytest.approx(sorted(100 * accuracy for accuracy in known))
    # The words beside the limit do not lie on the axis.
    figure.draw_without_rendering()
    axes = figure.axes[0]
    (words,) = axes.texts
    assert words.get_window_extent().x0 > axes.get_window_extent().x0
    for panel in figure.axes:  # and those above leave room for the curves
        assert panel.get_position().height * figure.get_figheight() > 1.2
    plt.close(figure)


def test_where_hdc_crosses_90_percent(write_run, number):
    for seed in range(3):
        for n, wrong in ((5, 20 + 10 * seed), (40, 0)):
            write_run("hdc", seed=seed, n_train=n, wrong=range(wrong))
    found = number(STUDY, "accuracy_vs_n/n_for_90_percent")
    # From 80, 70 and 60 % at N = 5 to 100 % at 40: each sensor has a curve of its own.
    each = [5 + 35 * (90 - start) / (100 - start) for start in (80, 70, 60)]
    assert found.value == pytest.approx(np.mean(each))
    half = 4.302652730 * np.std(each, ddof=1) * np.sqrt(4 / 3)
    assert (found.low, found.high) == pytest.approx((np.mean(each) - half, np.mean(each) + half))
    assert (found.n, found.seeds) == (300, 3)


@pytest.mark.parametrize("sizes", [(), (5,), (5, 10)])
def test_a_level_that_was_not_crossed_is_no_number(tmp_path, write_run, sizes):
    for n in sizes:
        write_run("hdc", n_train=n, wrong=range(30 if len(sizes) > 1 else 0))
    assert not list(STUDY.quantities(Results(tmp_path)))
