"""Every scene that was run has its table and figures; positions are in millimetres."""

import numpy as np
import pytest

from experiments.records.results import Results
from experiments.studies.scenes.view import STUDY, position_errors, positions, stem
from scenes.split import split

pytestmark = pytest.mark.filterwarnings("error")


@pytest.fixture
def everything(write_scene):
    for seed in (0, 1):
        write_scene("touch", {}, seed=seed)
        write_scene("finger", {3: 4, 5: 4}, seed=seed)
        write_scene("spatial", {10: 11, 40: 20}, seed=seed)
        write_scene("tactile", {}, seed=seed)


@pytest.mark.parametrize(
    ("scene", "n_train", "n_test"),
    [("touch", 400, 100), ("finger", 560, 140), ("spatial", 4080, 1020), ("tactile", 240, 120)],
)
def test_scenes_are_split_as_the_paper_splits_them(composed, scene, n_train, n_test):
    cfg = composed(scene, "hdc", "paper")
    classes = {"touch": 5, "finger": 7, "spatial": 51, "tactile": 3}[scene]
    labels = np.repeat(np.arange(classes), cfg.scene.samples_per_class)
    train, test = split(labels, test_fraction=cfg.split.test_fraction)
    assert (len(train), len(test)) == (n_train, n_test)


def test_every_model_of_a_scene_is_in_its_table(tmp_path, write_scene, everything):
    write_scene("finger", {0: 1}, model="ridge")
    write_scene("finger", {}, n_train=20)  # a point of its learning curve
    found = {table.name: table for table in STUDY.tables(Results(tmp_path))}
    assert set(found) == {"scene_touch", "scene_finger", "scene_spatial", "scene_tactile"}
    rows = found["scene_finger"].data
    assert rows["model"].tolist() == ["hdc", "ridge"]
    assert rows["test_accuracy_final"].tolist() == pytest.approx([12 / 14, 13 / 14])
    assert "simulated frames, scene “finger”" in found["scene_finger"].title


def test_accuracies_are_means_over_the_seeds(number, everything):
    found = number(STUDY, "finger/test_accuracy")
    assert found.value == pytest.approx(100 * 24 / 28)
    assert (found.n, found.seeds) == (28, 2)
    assert (found.low, found.high) == (0, 100)  # Student's t of two seeds is 12.7


def test_positions_are_millimetres_of_the_configured_line(tmp_path, number, everything):
    run = Results(tmp_path).group("spatial", "hdc").runs[0]
    np.testing.assert_allclose(positions(run.record), np.arange(51) * 1e-3, atol=1e-12)
    assert np.flatnonzero(position_errors(run.record)).tolist() == [20, 80]
    # 1 mm and 20 mm of 102 samples
    assert number(STUDY, "spatial/mean_position_error").value == pytest.approx(21 / 102)
    assert number(STUDY, "spatial/median_position_error").value == 0


def test_every_figure_says_what_it_is_of(everything, drawn):
    found = drawn(STUDY)
    assert set(found) == {"fig5_confusion", "fig6_confusion", "fig7_spatial", "fig9_confusion"}
    for name, words in found.items():
        assert "simulated frames" in words, name
        assert "2 seeds" in words, name
    assert "85.7 % [0.0, 100.0] (95 %); paper 87.9 %" in found["fig6_confusion"]
    assert "50" in found["fig6_confusion"].split()  # % of a row, in a cell
    assert "no measurement" in found["fig7_spatial"]
    assert "mean 0.21 mm" in found["fig7_spatial"]


def test_a_scene_of_ones_own_has_a_learning_curve_of_every_model(write_run, drawn):
    seen = {"name": "mine", "origin": "recorded", "classes": ["L1", "L2", "R1", "R2", "$x_{$"],
            "shape": [500, 500], "n": 500, "fingerprint": "abcdef0123"}  # fmt: skip
    for n in (5, 20, None):
        for model in ("hdc", "cnn1"):
            write_run(model, n_train=n, wrong=range(400 // (n or 400)), choices={"scene": "mine"},
                      scene=seen)  # fmt: skip
    found = drawn(STUDY)
    assert set(found) == {"confusion_mine_abcdef", "accuracy_vs_n_mine_abcdef"}
    words = found["accuracy_vs_n_mine_abcdef"]
    for expected in ("recorded frames, 1 seed, 95 % intervals", "HDC", "CNN, 1 layer", "400"):
        assert expected in words
    assert "$x_{$" in found["confusion_mine_abcdef"]


def test_without_hdc_the_first_model_stands_for_the_scene(write_scene, drawn):
    write_scene("tactile", {0: 1}, model="ridge")
    assert "Ridge read-out: confusion of 3 objects" in drawn(STUDY)["fig9_confusion"]


def test_names_of_files_are_told_apart_and_plain():
    assert stem("touch") == "touch"
    assert stem("recorded a b.npz (a1b2c3)") == "recorded_a_b_npz_a1b2c3"
    long = [stem(f"touch (scene.{'x' * 80}={k})") for k in range(2)]
    assert len(set(long)) == 2
    assert all(len(name) <= 60 for name in long)
