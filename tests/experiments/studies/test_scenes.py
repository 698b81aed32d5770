"""Every scene that was run is in the table and the figures; positions are in millimetres."""

import numpy as np
import pytest
from matplotlib import pyplot as plt

from experiments.records.groups import Groups
from experiments.records.results import Results
from experiments.studies.scenes.view import STUDY, positions

pytestmark = pytest.mark.filterwarnings("error")


@pytest.fixture
def everything(write_scene):
    for seed in (0, 1):
        write_scene("touch", {}, seed=seed)
        write_scene("finger", {3: 4, 5: 4}, seed=seed)
        write_scene("spatial", {10: 11, 40: 20}, seed=seed)
        write_scene("fibre_grouped", {1: 0}, seed=seed)


def test_the_table_has_a_row_a_scene_and_model_measured_scenes_first(
    tmp_path, write_scene, everything
):
    write_scene("finger", {0: 1}, model="ridge")
    write_scene("finger", {}, n_train=20)  # a point of the learning curve
    (table,) = STUDY.tables_of(Results(tmp_path))
    rows = table.data.set_index(["scene", "model"])
    assert rows.index[0] == ("fibre_grouped", "hdc")
    assert rows.index.value_counts().max() == 1
    assert rows.loc[("finger", "hdc"), "test_accuracy_final"] == pytest.approx(12 / 14)
    assert rows.loc[("finger", "ridge"), "test_accuracy_final"] == pytest.approx(
        13 / 14
    )
    assert rows.loc[("finger", "ridge"), "over_hdc"] == pytest.approx(1 / 14)


def test_accuracies_are_means_over_the_seeds(number, everything):
    accuracy = number(STUDY, "finger/test_accuracy")
    assert accuracy.value == pytest.approx(100 * 24 / 28)
    assert (accuracy.n, accuracy.seeds) == (28, 2)
    assert (accuracy.low, accuracy.high) == (0, 100)  # Student's t of two seeds is 12.7


def test_positions_are_millimetres_of_the_configured_line(tmp_path, everything):
    (run, _) = Groups(Results(tmp_path).runs).group("spatial", "hdc").runs
    np.testing.assert_allclose(positions(run), np.arange(51), atol=1e-9)


def test_figures_fit_and_name_every_scene(everything, write_scene, drawn):
    write_scene("tactile", {0: 1})
    words = drawn(STUDY)
    assert set(words) == {"confusions", "fig7_spatial", "own_error_vs_time"}
    for scene in ("Finger", "Fibre 1, positions", "Objects"):
        assert scene in words["confusions"]
    assert "Touch" not in words["confusions"]  # every frame is right
    assert "83.3 %" in words["confusions"]
    assert "mean 0.21 mm" in words["fig7_spatial"]


def test_names_of_ones_own_are_no_formulas(write_run, drawn):
    classes = ["L1", "L2", "R1", "R2", "$x_{$"]
    more = {"choices": {"scene": "mine"}, "origin": "recorded", "wrong": [0]}
    write_run("hdc", classes=classes, **more)
    assert "$x_{$" in drawn(STUDY)["confusions"]


def test_runs_started_by_hand_have_figures_of_their_own(
    tmp_path, write_scene, write_run
):
    own = {"own_accuracy_vs_n", "own_error_vs_time"}
    write_scene("finger", {0: 1}, n_train=20)
    shown = {plot.name: plot for plot in STUDY.plots_of(Results(tmp_path))}
    assert own & set(shown) == {"own_error_vs_time"}  # no curve of one number
    write_scene("finger", {}, n_train=70)
    write_scene("finger", {})
    curve = [{"training_s": 1.0, "loss": 0.5, "test_accuracy": 0.5}]
    write_run("softmax", curve=[*curve, {"training_s": 2.0, "loss": 0.1}])
    shown = {plot.name: plot for plot in STUDY.plots_of(Results(tmp_path))}
    assert own <= set(shown)
    against_n = shown["own_accuracy_vs_n"].draw()
    (axes,) = against_n.axes  # one scene has several numbers
    sizes = [label.get_text() for label in axes.get_xticklabels()]
    assert sizes == ["20", "70", "400"]
    accuracies = axes.lines[0].get_ydata()
    assert sorted(accuracies)[-1] == 100
    against_time = shown["own_error_vs_time"].draw()
    _, touch = against_time.axes
    assert touch.lines[0].get_xdata().tolist() == [1.0, 2.0]
    assert touch.lines[0].get_ydata()[0] == pytest.approx(0.5)
    for figure in (against_n, against_time):
        plt.close(figure)


def test_runs_of_an_experiment_are_not_started_by_hand(tmp_path, write_scene):
    write_scene("finger", {0: 1})
    path = tmp_path / "records.jsonl"
    text = path.read_text()
    assert '"experiment":' not in text
    start = '{"type":"run",'
    path.write_text(text.replace(start, f'{start}"experiment":"all_scenes",'))
    names = {plot.name for plot in STUDY.plots_of(Results(tmp_path))}
    assert names == {"confusions"}
