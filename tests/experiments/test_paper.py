"""The paper's numbers and figures, from records and measurements made up here."""

from __future__ import annotations

import csv
import json

import cv2
import numpy as np
import pytest
from omegaconf import OmegaConf

from experiments import measurement, paper_figures, record, sources
from experiments.paper_data import crossing, mean_interval, positions, updates
from experiments.paper_drift import drift
from experiments.paper_numbers import summary_rows
from experiments.selection import Records
from scenes.split import split

CLASSES = {
    "finger": ["L1", "L2", "L3", "R1", "R2", "R3", "None"],
    "spatial": [str(i) for i in range(51)],
    "tactile": ["paper", "P40", "P120"],
    "touch": ["L1", "L2", "R1", "R2", "None"],
}


@pytest.fixture(autouse=True)
def results(tmp_path, monkeypatch):
    monkeypatch.setenv("RESULTS_DIR", str(tmp_path))
    return tmp_path


# Of a finished run, as every record has them.
RESULTS = {
    "training_s": 0.1, "time_to_target_train_s": 0.1, "time_to_target_test_s": 0.1,
    "train_accuracy_max": 1.0, "train_accuracy_final": 1.0, "test_accuracy_max": 1.0,
    "test_accuracy_final": 1.0, "test_ci_low": 0.9, "test_ci_high": 1.0, "model_bytes": 1000,
    "predict_single_s": 1e-3, "predict_batch_s_per_frame": 1e-4,
    "data_sha256": {"train": "a", "test": "b"},
}  # fmt: skip


@pytest.fixture
def write_scene(results, composed):
    """write_scene(scene, wrong, seed): an HDC record of two test samples a class; {class: taken
    for} says which class has one of its two samples wrong."""

    def write(scene, wrong, seed=0, n_train=None):
        cfg = composed(scene, "hdc", "paper")
        cfg.seed.run, cfg.split.n_train = seed, n_train
        config = OmegaConf.to_container(cfg, resolve=True)
        for key in record.NOT_IDENTITY:
            config.pop(key)
        config["threads"] = 2
        files = sources.sources(config)
        made_by = {"code": sources.code_hash(files), "sources": files}
        classes = CLASSES[scene]
        truth = np.repeat(np.arange(len(classes)), 2)
        predicted = truth.copy()
        for label, taken_for in wrong.items():
            predicted[2 * label] = taken_for
        confusion = np.zeros((len(classes), len(classes)), int)
        np.add.at(confusion, (truth, predicted), 1)
        identity = record.run_id(scene, "hdc", config, "f" * 64)
        entry = {
            "schema": record.SCHEMA, "id": identity, "status": "finished", "stop": "finished",
            "choices": {"scene": scene, "model": "hdc", "stop": "paper"}, "config": config,
            "environment": {"cpu": "A CPU", "threads": 2, **made_by},
            "scene": {"name": scene, "origin": "simulated", "classes": classes, "n": 500,
                      "shape": [500, 500]},
            "n_train": n_train or 8 * len(classes), "n_test": len(truth),
            "test_labels": truth, "predicted": predicted, "confusion": confusion,
            **RESULTS,
        }  # fmt: skip
        record.write_record(results / "runs" / identity, entry)

    return write


@pytest.fixture
def correlation(results):
    """A measurement of two seeds: C_ll = 0.2 (0.3 in seed 1), elsewhere 0.1; pictures of noise."""
    classes = CLASSES["touch"]
    rows = [
        {"origin": "simulated", "seed": seed, "kind": kind, "samples": samples,
         "class_i": a, "class_j": b,
         "value": 0.2 + 0.1 * seed if a == b else 0.1, "n": 100, "undefined": 0}
        for seed in (0, 1) for kind in ("speckle", "hypervector", "prototype")
        for samples in ("training", "held-out", "all") for a in classes for b in classes
    ]  # fmt: skip
    config = {"_target_": "experiments.class_correlations.run", "seeds": [0, 1]}
    folder = measurement.measure("correlation", {**config, "crop": [0, 0, 8]}, lambda: rows)
    rng = np.random.default_rng(0)
    for name in classes:
        for what in ("speckle", "hypervector", "prototype", "whole"):
            image = rng.integers(0, 256, (8, 8), np.uint8)
            assert cv2.imwrite(str(folder / f"{name}-{what}.png"), image)


@pytest.fixture
def recalibration(results):
    """A measurement of two seeds: stored 30 of 100 right, with p = 0.5 90 and 94, else 80."""
    config = {"_target_": "experiments.drift.run"}
    methods = [("replace", p) for p in (0.25, 0.5, 0.75, 1)]
    methods += [("balance", r) for r in (0.5, 1)] + [("weight", 1), ("both", None)]

    def rows():
        tests = {"origin": "simulated", "n_test_new": 100, "n_test_old": 50, "n_old": 400}
        for seed in (0, 1):
            yield {"seed": seed, "method": "stored", "n_new": 0, "right_new": 30, "right_old": 50,
                   **tests}  # fmt: skip
            for draw in (0, 1):
                for n_new in (5, 50):
                    for method, parameter in methods:
                        right = (90 + 4 * seed if parameter == 0.5 else 80) + (-1) ** draw
                        value = {} if parameter is None else {"parameter": parameter}
                        yield {"seed": seed, "draw": draw, "n_new": n_new, "method": method,
                               "right_new": right, "right_old": 45, **value, **tests}  # fmt: skip

    measurement.measure("drift", config, rows)


@pytest.fixture
def everything(write_scene, correlation, recalibration):
    for seed in (0, 1):
        write_scene("touch", {}, seed)
        write_scene("touch", {0: 1, 1: 0, 2: 0}, seed, n_train=5)
        write_scene("finger", {3: 4, 5: 4}, seed)
        write_scene("spatial", {10: 11, 40: 20}, seed)
        write_scene("tactile", {}, seed)


# Configs ------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("scene", "n_train", "n_test"),
    [("touch", 400, 100), ("finger", 560, 140), ("spatial", 4080, 1020), ("tactile", 240, 120)],
)
def test_scenes_are_split_as_the_paper_splits_them(composed, scene, n_train, n_test):
    cfg = composed(scene, "hdc", "paper")
    labels = np.repeat(np.arange(len(CLASSES[scene])), cfg.scene.samples_per_class)
    train, test = split(labels, test_fraction=cfg.split.test_fraction)
    assert (len(train), len(test)) == (n_train, n_test)


# Numbers ------------------------------------------------------------------------------------------


def test_student_interval():
    # t(0.975, 2) = 4.3027
    assert mean_interval([1.0, 2.0, 3.0]) == pytest.approx((2, 2 - 2.4841, 2 + 2.4841), abs=1e-4)
    assert np.isnan(mean_interval([1.0])[1:]).all()


@pytest.mark.parametrize(
    ("n", "accuracy", "expected"),
    [
        ([5, 10, 20], [0.5, 0.8, 1.0], 15),
        ([20, 5, 10], [1.0, 0.5, 0.8], 15),
        ([5, 10], [0.95, 1.0], 5),
        ([5, 10], [0.5, 0.9], np.nan),
    ],
)
def test_where_a_curve_crosses(n, accuracy, expected):
    assert crossing(n, accuracy) == pytest.approx(expected, nan_ok=True)


def test_numbers_have_the_names_of_the_published_ones(results, everything):
    rows = summary_rows(results)
    with (record.ROOT / "results" / "published.csv").open(encoding="utf-8") as file:
        published = {(line["experiment"], line["quantity"]): line for line in csv.DictReader(file)}
    mine = {(row["experiment"], row["quantity"]) for row in rows}
    assert {key for key in published if key[0] != "table1"} <= mine
    keys = [(row["experiment"], row["quantity"], row["condition"]) for row in rows]
    assert len(set(keys)) == len(keys)
    for row in rows:
        known = published.get((row["experiment"], row["quantity"]))
        assert known is None or row["unit"] == known["unit"]
        assert row["seeds"] == 2
        assert row["code"] == "current"
        assert all((results / folder).is_dir() for folder in row["source"].split())
        bounds = [row[key] for key in ("low", "measured", "high") if row[key] is not None]
        assert bounds == sorted(bounds)
        json.dumps(row, allow_nan=False)


def number(results, experiment, quantity, condition=""):
    wanted = experiment, quantity, condition
    (found,) = [
        row
        for row in summary_rows(results)
        if (row["experiment"], row["quantity"], row["condition"]) == wanted
    ]
    return found


def test_accuracies_pool_the_seeds(results, everything):
    found = number(results, "finger", "test_accuracy")
    assert found["measured"] == pytest.approx(100 * 24 / 28)
    assert found["n"] == 28
    assert (found["low"], found["high"]) == pytest.approx((68.51, 94.30), abs=0.01)  # Wilson
    crossed = number(results, "accuracy_vs_n", "n_for_90_percent")
    # From 70 % at N = 5 to 100 % at 40.
    assert crossed["measured"] == pytest.approx(5 + 35 * 2 / 3)
    assert crossed["low"] < crossed["measured"]
    assert crossed["high"] is None  # no lower bound is above 90 % with so few samples


def test_positions_are_millimetres_of_the_configured_line(results, everything):
    run = Records(results).group("spatial", "hdc").runs[0]
    np.testing.assert_allclose(positions(run.record), np.arange(51) * 1e-3, atol=1e-12)
    # 1 mm and 20 mm of 102 samples
    found = number(results, "spatial", "mean_position_error")
    assert found["measured"] == pytest.approx(21 / 102)
    assert found["unit"] == "mm"
    assert number(results, "spatial", "median_position_error")["measured"] == 0


def test_correlations_are_means_over_seeds(results, correlation):
    assert number(results, "correlation", "max_same_class_speckle", "all samples")[
        "measured"
    ] == pytest.approx(0.25)
    found = number(results, "correlation", "contrast_prototype", "held-out samples")
    # ΔC is 0.1 and 0.2; t(0.975, 1)·0.0707/√2 = 0.635
    assert found["measured"] == pytest.approx(0.15)
    assert found["high"] == pytest.approx(0.15 + 0.6353, abs=1e-3)


def test_draws_of_a_seed_are_not_independent_of_each_other(results, recalibration):
    stored = number(results, "drift", "stored_accuracy")
    assert (stored["measured"], stored["low"], stored["n"]) == (30, 30, 200)
    found = number(results, "drift", "recovered_accuracy", "p = 0.5")
    assert found["measured"] == pytest.approx(92)
    assert found["high"] == 100  # 92 ± 25: an interval of fractions ends at one
    assert found["low"] == pytest.approx(92 - 12.706 * 2, abs=0.01)
    assert number(results, "drift", "remembered_accuracy", "p = 0.5")["measured"] == 90
    assert set(updates(measurement.read(results, "drift"))["replace", 0.5]) == {5, 50}


def test_without_records_there_are_no_numbers(results):
    assert summary_rows(results) == []


def test_what_broke_off_is_not_counted(results):
    def broken():
        yield {"seed": 0, "method": "stored", "n_new": 0}
        raise ArithmeticError

    with pytest.raises(ArithmeticError):
        measurement.measure("drift", {"_target_": "experiments.drift.run"}, broken)
    assert summary_rows(results) == []
    assert drift(results) is None


# Figures ------------------------------------------------------------------------------------------


def text_of(figure):
    texts = [text.get_text() for axes in figure.axes for text in axes.texts]
    return "\n".join([" ".join(figure.get_suptitle().split()), *texts])


def test_figures_are_written_from_what_there_is(results, write_scene):
    assert paper_figures.write(results) == []
    write_scene("tactile", {})
    written = paper_figures.write(results)
    assert [path.name for path in written] == ["fig9_confusion.svg", "fig9_confusion.pdf"]
    before = [path.read_bytes() for path in written]
    assert [path.read_bytes() for path in paper_figures.write(results)] == before


def test_every_figure_says_what_it_is_of(results, everything):
    records = Records(results)
    drawn = {
        "images": paper_figures.speckle_images(results),
        "correlations": paper_figures.correlations(results),
        "touch": paper_figures.confusion(records, "touch"),
        "finger": paper_figures.confusion(records, "finger"),
        "spatial": paper_figures.spatial(records, results),
        "drift": drift(results),
    }
    for name, figure in drawn.items():
        text = text_of(figure)
        assert "simulated" in text, name
        assert "seed" in text, name
        assert "code changed" not in text, name
        paper_figures.plt.close(figure)
    assert "paper 87.9 %" in text_of(drawn["finger"])
    assert "85.7 % [68.5, 94.3]" in text_of(drawn["finger"])
    assert "50" in text_of(drawn["finger"]).split("\n")  # % of a row, in a cell
    assert "no measurement" in text_of(drawn["spatial"])
    assert "mean 0.21 mm" in text_of(drawn["spatial"])
    assert "paper 0.178" in text_of(drawn["correlations"])
    assert ".250" in text_of(drawn["correlations"])


def test_a_figure_says_that_code_has_changed(results, correlation):
    path = results / "measured" / "correlation" / "record.json"
    entry = json.loads(path.read_text())
    entry["environment"]["sources"]["hdc/bits.py"] = "0" * 12
    path.write_text(json.dumps(entry))
    figure = paper_figures.correlations(results)
    assert "code changed since: hdc/bits.py" in text_of(figure)
    paper_figures.plt.close(figure)
