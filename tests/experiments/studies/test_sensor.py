"""The simulated sensor beside the paper: the fit, and controls of the tactile scene."""

from __future__ import annotations

import pandas as pd
import pytest

from experiments.protocol.experiment import Run
from experiments.records import configs
from experiments.studies.correlation.measure import correlations
from experiments.studies.correlation.sums import contrast
from experiments.studies.sensor import view
from experiments.studies.sensor.measure import calibration
from scenes.export import compose

pytestmark = pytest.mark.usefixtures("one_thread")
SPLIT = {"kind": "random", "test_fraction": 0.25, "n_train": None}
CHANGES = {
    "tactile_texture": {"offset"},
    "tactile_same_patch": {"offset", "fresh"},
    "tactile_precise": {"offset", "fresh", "depth_spread", "position_spread"},
    "tactile_depth": {"spacing"},
}


def test_every_parameter_is_beside_its_neighbours(small_scene):
    rooms = [{"_target_": "scenes.sensor.environment.Room"} for _ in range(2)]
    task = {
        "scene": {"touch": small_scene, "drift": {**small_scene, "sessions": rooms}},
        "split": SPLIT,
        "seeds": [100, 101],
        "fitted": {
            "touch": {"sensor.thermal.scale": [12.0, 124.0, 1240.0]},
            "drift": {"sessions.1.offset": [-0.5, 0.0, 0.5]},
        },
        "n_train": [2, 6, None],
        "drift": {"n_test": 4, "n_new": 4, "p": 0.5},
    }
    rows = pd.DataFrame(calibration.rows(Run(), **task))
    # Each scene as it is and at two neighbours; on touch two correlations and three accuracies.
    assert len(rows) == 2 * 3 * ((2 + 3) + 2)
    table = view.fit(rows, task).set_index("quantity")
    assert {"accuracy_vs_n/n_for_90_percent", "drift/recovered_accuracy"} < set(table.index)
    same = table.loc["correlation/max_same_class_speckle"]
    # Colder and hotter paths: frames of a class stay more, and less, alike.
    assert same.smaller > same.fitted > same.larger
    sensor = Run().scene(small_scene, 100)
    values = [row["value"] for row in correlations(sensor, SPLIT, 100, ["speckle"], ["all"])]
    known = rows[(rows.seed == 100) & rows.parameter.isna()].set_index("quantity").value
    expected = contrast(pd.Series(values).to_numpy().reshape(2, 2))
    assert known["correlation/contrast_speckle"] == pytest.approx(expected)
    task["fitted"] = {"touch": {"sensor.thermal.scale": [124.0, 130.0, 140.0]}}
    with pytest.raises(ValueError, match=r"task\.fitted\.touch\.sensor\.thermal\.scale: expected"):
        next(calibration.rows(Run(), **task))


def test_the_config_fits_parameters_that_the_sensor_has():
    task = configs.task("calibration")
    del task["_target_"]
    assert not list(calibration.rows(Run(), **{**task, "seeds": []}))  # makes no frame
    assert min(task["seeds"]) >= 100


@pytest.mark.parametrize("name", CHANGES)
def test_a_control_differs_in_its_factor_alone(name):
    whole, control = configs.part("scene", "tactile"), configs.part("scene", name)
    assert control["split"] == whole["split"]
    changed = {key.split(".")[-1] for key in configs.differences(control, whole)}
    assert changed == CHANGES[name]
    made = compose([f"scene={name}"])
    offsets, spacings = zip(*((c.offset, c.spacing) for c in made.contacts), strict=True)
    assert (set(offsets) == {0.0}) == (name != "tactile_depth")
    assert (set(spacings) == {None}) == (name == "tactile_depth")
