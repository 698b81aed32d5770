"""Accuracy against samples and pixels and by scene; own runs; positions in millimetres."""

import numpy as np
import pytest

from experiments.records import configs
from experiments.records.results import RUNS, Results
from experiments.studies.accuracy.confusions import spatial
from experiments.studies.accuracy.view import STUDY

pytestmark = pytest.mark.filterwarnings("error")
SCENE_FIGURES = {"confusions", "fig7_spatial", "own_error_vs_time"}


def test_a_table_has_a_row_for_what_was_measured_of_its_experiment(answers, a_full_set):
    made = answers(STUDY)
    for name, size in (
        ("accuracy_vs_n", "split.n_train"),
        ("accuracy_vs_d", "data.pixels"),
    ):
        params = configs.sweep(name)
        data = made.table(name).data
        assert 0 < len(data) < len(params["model"]) * len(params[size]), name
        assert (data.seeds > 0).all()
    rows = made.table("accuracy_vs_n").data.set_index(["model", "n_train"])
    line = rows.loc["hdc", 20]
    assert (line.seeds, line.test_accuracy_final) == (2, 0.9)
    assert rows.loc["ridge", 100].seeds == 2


def test_a_curve_has_more_than_one_place(write_run, figures):
    write_run("hdc", n_train=20)
    assert "accuracy_vs_n" not in figures(STUDY)
    write_run("ridge", n_train=100)
    assert "accuracy_vs_n" in figures(STUDY)


def test_where_hdc_crosses_90_percent(write_run, number):
    for seed in range(3):
        for n, wrong in ((5, 20 + 10 * seed), (50, 0)):
            write_run("hdc", seed=seed, n_train=n, wrong=range(wrong))
    crossed = number(STUDY, "accuracy_vs_n/n_for_90_percent")
    # From 80, 70 and 60 % at N = 5 to 100 % at 50: each sensor has a curve of its own.
    each = [5 + 45 * (90 - start) / (100 - start) for start in (80, 70, 60)]
    half = 4.302652730 * np.std(each, ddof=1) * np.sqrt(4 / 3)
    middle = np.mean(each)
    found = (crossed.value, crossed.low, crossed.high)
    assert found == pytest.approx((middle, middle - half, middle + half))
    assert (crossed.n, crossed.seeds) == (300, 3)


@pytest.mark.parametrize("sizes", [(5,), (5, 10)])
def test_a_level_that_was_not_crossed_is_no_number(tmp_path, write_run, sizes):
    for n in sizes:
        write_run("hdc", n_train=n, wrong=range(30 if len(sizes) > 1 else 0))
    (numbers,) = STUDY.numbers
    assert not list(numbers.made(Results(tmp_path).frame(RUNS)))


# Scenes -------------------------------------------------------------------------------------------


@pytest.fixture
def everything(write_scene):
    for seed in (0, 1):
        write_scene("touch", {}, seed=seed)
        write_scene("finger", {3: 4, 5: 4}, seed=seed)
        write_scene("spatial", {10: 11, 40: 20}, seed=seed)
        write_scene("fibre_grouped", {1: 0}, seed=seed)


def test_the_table_has_a_row_a_scene_and_model_measured_scenes_first(
    answers, write_scene, everything, number
):
    write_scene("finger", {0: 1}, model="ridge")
    write_scene("finger", {}, n_train=20)  # a point of the learning curve
    rows = answers(STUDY).table("all_scenes").data.set_index(["scene", "model"])
    assert rows.index[0] == ("fibre_grouped", "hdc")
    assert rows.index.is_unique
    finger = rows.loc["finger"]
    assert finger.test_accuracy_final.to_dict() == pytest.approx(
        {"hdc": 12 / 14, "ridge": 13 / 14}
    )
    assert finger.over_hdc["ridge"] == pytest.approx(1 / 14)
    accuracy = number(STUDY, "finger/test_accuracy")
    assert accuracy.value == pytest.approx(100 * 24 / 28)
    assert (accuracy.n, accuracy.seeds) == (28, 2)
    assert (accuracy.low, accuracy.high) == (0, 100)  # Student's t of two seeds is 12.7


def test_positions_are_millimetres_of_the_configured_line(tmp_path, everything):
    data = spatial(Results(tmp_path).frame(RUNS, "correlation"))
    errors = data[data.what == "error_mm"].set_index("true").share
    np.testing.assert_allclose(errors.index.astype(float), np.arange(51), atol=1e-9)
    wrong = errors[errors > 0].to_dict()
    assert wrong == pytest.approx({10: 0.5, 40: 10})  # one of two samples of each
    whole = data[data.what == "error"].set_index("true").share
    assert whole["mean"] == pytest.approx((0.5 + 10) / 51)


def test_figures_fit_and_name_every_scene(everything, write_scene, write_run, drawn):
    write_scene("tactile", {0: 1})
    more = {"choices": {"scene": "mine"}, "origin": "recorded", "wrong": [0]}
    write_run("hdc", classes=["L1", "L2", "R1", "R2", "$x_{$"], **more)
    words = drawn(STUDY)
    assert set(words) == SCENE_FIGURES
    for text in ("Finger", "Fibre 1, positions", "Objects", "83.3 %", "$x_{$"):
        assert text in words["confusions"]
    assert "Touch" not in words["confusions"].partition("(a)")[2]  # all right


def test_runs_started_by_hand_have_figures_of_their_own(
    write_scene, write_run, figures
):
    own = {"own_accuracy_vs_n", "own_error_vs_time"}
    write_scene("finger", {0: 1}, n_train=20)
    assert own & set(figures(STUDY)) == {"own_error_vs_time"}  # no curve of one number
    write_scene("finger", {}, n_train=70)
    write_scene("finger", {})
    curve = [{"training_s": 1.0, "loss": 0.5, "test_accuracy": 0.5}]
    write_run("softmax", curve=[*curve, {"training_s": 2.0, "loss": 0.1}])
    write_run("ridge", n_train=70, experiment="all_scenes")  # by an experiment
    shown = figures(STUDY)
    (axes,) = shown["own_accuracy_vs_n"].axes  # one scene has several numbers
    sizes = [label.get_text() for label in axes.get_xticklabels()]
    assert sizes == ["20", "70", "400"]
    assert max(axes.lines[0].get_ydata()) == 100
    _, touch = shown["own_error_vs_time"].axes
    assert touch.lines[0].get_xdata().tolist() == [1.0, 2.0]
    assert touch.lines[0].get_ydata()[0] == pytest.approx(0.5)
