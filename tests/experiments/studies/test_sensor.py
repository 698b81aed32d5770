"""The simulated sensor beside the paper: a view over other studies, the fit, controls, pictures."""

from __future__ import annotations

from types import SimpleNamespace

import pytest
from hydra.utils import instantiate

from experiments.protocol.scenes import at_seed
from experiments.records import configs, measurement
from experiments.records.results import Group, Results
from experiments.reporting import comparison
from experiments.reporting.table import records
from experiments.studies.correlation import measure as correlation
from experiments.studies.sensor import fit, view
from experiments.studies.table1.view import quantities
from scenes.export import compose

pytestmark = pytest.mark.usefixtures("one_thread")

SPLIT = {"kind": "random", "test_fraction": 0.25, "n_train": None}
DRIFT = {"n_test": 4, "n_new": 4, "p": 0.5}
CONTROLS = ("tactile_texture", "tactile_same_patch", "tactile_precise", "tactile_depth")


@pytest.fixture(autouse=True)
def results(tmp_path, monkeypatch):
    monkeypatch.setenv("RESULTS_DIR", str(tmp_path))
    return tmp_path


def tables(results):
    return {table.name: table for table in view.STUDY.tables(Results(results))}


@pytest.mark.parametrize(("wrong", "met"), [(0, "yes"), (1, "yes"), (2, "no")])
def test_the_calibration_judges_what_the_comparison_shows(results, write_run, wrong, met):
    write_run("hdc", wrong=range(wrong))
    (row,) = records(tables(results)["calibration"].data)
    assert (row["quantity"], row["expected"]) == ("table1: hdc test accuracy, %", "99 to 100")
    assert (row["here"], row["met"], row["status"]) == (100 - wrong, met, "watched")
    compared = records(comparison.compare(quantities(Results(results))).data)
    (same,) = (r for r in compared if r["quantity"] == "hdc_test_accuracy")
    assert [same[key] for key in ("measured", "low", "high", "published")] == [
        row[key] for key in ("here", "low", "high", "paper")
    ]


# Fit ----------------------------------------------------------------------------------------------


def a_fit(small_scene, **changed):
    rooms = [{"_target_": "scenes.sensor.environment.Room"} for _ in range(2)]
    arguments = {
        "scene": {
            "touch": small_scene,
            "finger": {**small_scene, "samples_per_class": 4},
            "drift": {**small_scene, "sessions": rooms},
        },
        "split": SPLIT,
        "seeds": [100, 101],
        "fitted": {
            "touch": {"sensor.thermal.scale": [12.0, 124.0, 1240.0]},
            "finger": {"contact.depth": [1.7e-3, 1.8e-3, 1.9e-3]},
            "drift": {"sessions.1.offset": [-0.5, 0.0, 0.5]},
        },
        "n_train": [2, 6, None],
        "drift": DRIFT,
    }
    return fit.run(**{**arguments, **changed})


def test_every_parameter_stands_beside_its_neighbours(results, small_scene):
    found = measurement.read(a_fit(small_scene))
    rows = found.rows
    # Each scene as it is and at two neighbours; four correlations and three accuracies on touch.
    assert len(rows) == 2 * 3 * ((4 + 3) + 1 + 2)
    accuracies = [row for row in rows if row["kind"] != "speckle"]
    assert all(0 <= int(row["right"]) <= int(row["n_test"]) for row in accuracies)
    shown = records(view.fit(found).data)
    names = {(row["parameter"], row["quantity"]) for row in shown}
    assert ("finger: contact.depth", "finger: test accuracy, %") in names
    assert ("drift: sessions.1.offset", "drift: recovered accuracy, %") in names
    (same,) = (r for r in shown if r["quantity"] == "correlation: max same class speckle")
    # Colder and hotter paths: frames of a class stay more, and less, alike.
    assert same["smaller"] > same["fitted"] > same["larger"]
    assert (same["smaller_value"], same["fitted_value"]) == (12, 124)
    assert all(len(cells) == 7 for cells in view.fit(found).cells())


def test_the_estimators_are_those_of_the_other_studies(small_scene):
    """The rows of the scene as it is give what a run and the correlations give."""
    found = measurement.read(a_fit(small_scene, seeds=[3])).rows
    of_touch = [r for r in found if r["scene"] == "touch" and "parameter" not in r]
    folder = correlation.run("own", small_scene, SPLIT, [3], ["speckle"], ["all"], cache=False)
    theirs = [row["value"] for row in measurement.read(folder).rows]
    assert [row["value"] for row in of_touch if row["kind"] == "speckle"] == theirs
    made = instantiate(at_seed(small_scene, 3), _convert_="all")
    expected = [fit.accuracy(made, {**SPLIT, "n_train": n}, 3) for n in (2, 6, None)]
    assert [int(row["right"]) for row in of_touch if row["kind"] == "accuracy"] == [
        row["right"] for row in expected
    ]
    assert [row["n_train"] for row in expected] == [2, 6, 12]


@pytest.mark.parametrize("values", [[1.0, 2.0, 3.0], [124.0, 130.0, 140.0], [130.0, 124.0, 120.0]])
def test_the_scenes_own_value_is_in_the_middle(small_scene, values):
    with pytest.raises(ValueError, match=r"task\.fitted\.touch\.sensor\.thermal\.scale: expected"):
        a_fit(small_scene, fitted={"touch": {"sensor.thermal.scale": values}})


def test_the_calibration_fits_what_the_sensor_has():
    task = configs.task("calibration")
    task = {key: value for key, value in task.items() if key != "_target_"}
    found = measurement.read(fit.run(**{**task, "seeds": []}))  # makes no frame
    assert not found.rows
    assert min(task["seeds"]) >= 100


# Errors and controls ------------------------------------------------------------------------------


def test_confusions_say_what_a_label_is_taken_for(results, write_run):
    write_run("hdc", wrong=[0, 5, 1])  # labels 0, 0 and 1, taken for the next
    rows = records(view.confusions(Results(results).group("touch", "hdc")).data)
    assert [row["taken_for"] for row in rows] == ["L2 10 %", "R1 5 %", "", "", ""]
    assert [row["accuracy"] for row in rows] == [0.9, 0.95, 1, 1, 1]


def test_controls_are_told_apart_from_chance(results, write_run):
    write_run("hdc", wrong=range(10))
    group = Results(results).group("touch", "hdc")
    some = {"tactile_texture": group}
    stub = SimpleNamespace(group=lambda scene, model: some.get(scene, Group(scene, model)))
    (table,) = view.controls(stub)
    rows = {row["scene"]: row for row in records(table.data)}
    assert list(rows) == ["tactile", *CONTROLS]
    assert rows["tactile_texture"]["accuracy"] == 0.9
    assert (rows["tactile"]["accuracy"], rows["tactile"]["status"]) == (None, "missing")
    some.clear()
    assert not list(view.controls(stub))


@pytest.mark.parametrize("name", CONTROLS)
def test_a_control_is_the_scene_but_for_what_it_controls(name):
    whole, control = configs.of_scene("tactile"), configs.of_scene(name)
    assert control["split"] == whole["split"]
    changed = {key.split(".")[-1] for key in configs.differences(control, whole)}
    assert (
        changed
        == {
            "tactile_texture": {"offset"},
            "tactile_same_patch": {"offset", "fresh"},
            "tactile_precise": {"offset", "fresh", "depth_spread", "position_spread"},
            "tactile_depth": {"spacing"},
        }[name]
    )
    made = compose([f"scene={name}"])
    offsets, spacings = zip(*((c.offset, c.spacing) for c in made.contacts), strict=True)
    assert (set(offsets) == {0.0}) == (name != "tactile_depth")
    assert (set(spacings) == {None}) == (name == "tactile_depth")
