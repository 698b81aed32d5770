"""Measured recordings: what a draw trains on, the rows, and the estimates made of them."""

import numpy as np
import pytest
import torch
from rich.console import Console

from experiments.protocol.experiment import Run
from experiments.records import configs
from experiments.records.results import Results
from experiments.studies.recordings import view
from experiments.studies.recordings.measure import (
    Subsets,
    draw_split,
    nested,
    recording_distances,
    recordings,
)
from scenes.frames import Frames

RANDOM = {"kind": "random", "test_fraction": 0.5}
MODELS = {name: configs.of_model(name) for name in ("hdc", "hdc_integer", "ridge")}


@pytest.fixture
def scene(frames_and_labels):
    frames, labels = frames_and_labels(90, classes=3, side=12)
    return Frames(torch.from_numpy(frames), labels, ("a", "b", "c"))


def test_training_sets_grow_and_hold_no_test_frame(scene):
    pool, test = draw_split(scene, RANDOM, (0, 0), most_test=20)
    assert len(test) == 20
    order, sizes = nested(pool, scene.labels, [1, 5, 1000], (0, 0))
    assert sizes == [1, 5]  # no class has a thousand
    for label, frames in enumerate(order):
        assert set(scene.labels[frames]) == {label}
        assert not set(frames) & set(test)
    again = draw_split(scene, RANDOM, (0, 0), most_test=20)
    assert all(map(np.array_equal, (pool, test), again))
    assert not np.array_equal(test, draw_split(scene, RANDOM, (0, 1), most_test=20)[1])


@pytest.mark.parametrize("model", MODELS)
def test_models_on_subsets_are_those_trained_on_the_frames(scene, model):
    """What is computed from products of all frames is what the model itself predicts."""
    from experiments.studies.recordings.measure import _build

    pool, test = draw_split(scene, RANDOM, (0, 0), most_test=400)
    train = np.sort(pool)[:21]
    alone = _build(MODELS[model], 0)
    for _ in alone.train(scene.frames(train), scene.labels[train]):
        pass
    predicted = Subsets(scene).predict(_build(MODELS[model], 0), train, test)
    assert np.array_equal(predicted, np.asarray(alone.predict(scene.frames(test))))


def test_rows_of_a_small_recording(scene, recording):
    of = configs.of_scene("recorded")["scene"] | {"path": str(recording(60, 3))}
    run = Run(console=Console(quiet=True), force=True)
    rows = list(recordings.rows(run, of, {"random": RANDOM}, MODELS, [1, 5], draws=2))
    assert len(rows) == 2 * len(MODELS)
    for row in rows:
        assert row["n"] == [1, 5]
        assert all(0 <= right <= row["n_test"] for right in row["right"])
    distances = list(recording_distances.rows(run, of))
    for kind, pairs in (("intra", 3 * 20 * 19 / 2), ("inter", 3 * 20 * 20)):
        counts = [row["count"] for row in distances if row["kind"] == kind]
        assert sum(counts) == pairs


def test_a_change_of_settings_does_not_displace_the_whole_measurement(tmp_path, write_measurement):
    scene = configs.task("recordings")["scene"]
    for draws, right in ((20, 90), (2, 10)):
        row = {"seed": 0, "split": "counts", "draw": 0, "n_test": 100, "n": [5], "right": [right]}
        rows = [row | {"model": name, "draw": k} for name in ("hdc", view.RIVAL) for k in range(3)]
        config = {"scene": scene, "draws": draws, "seeds": [0]}
        write_measurement("recordings", rows, config=config, scene="gelsight")
    (measured,) = view.recordings(Results(tmp_path)).values()
    assert measured.record.config["draws"] == 20
    summary = view.summary(measured).set_index("model")
    assert summary.accuracy["hdc"] == 0.9
    assert summary.over_hdc[view.RIVAL] == 0
