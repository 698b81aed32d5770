"""Figures of one's own runs; those of the reference are its tables, byte by byte."""

import pytest

from experiments.reporting.plot import save
from experiments.studies.accuracy.view import STUDY

pytestmark = pytest.mark.filterwarnings("error")


def test_a_name_of_a_class_that_looks_like_a_formula_is_drawn_as_it_is(
    write_run, figures
):
    classes = ["L1", "L2", "R1", "R2", "$x_{$"]
    about = {"choices": {"scene": "mine"}, "origin": "recorded"}
    write_run("hdc", classes=classes, wrong=[0], **about)
    assert "$x_{$" in save(figures(STUDY)["confusions"]).decode()


def test_runs_started_by_hand_have_figures_of_their_own(write_run, figures):
    own = {"own_accuracy_vs_n", "own_error_vs_time"}
    write_run("hdc", scene="finger", wrong=[0], n_train=20)
    assert own & set(figures(STUDY)) == {"own_error_vs_time"}  # no curve of one number
    write_run("hdc", scene="finger", n_train=70)
    write_run("hdc", scene="finger")
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
