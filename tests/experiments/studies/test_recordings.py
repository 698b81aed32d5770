"""Measured recordings: what a draw trains on, the rows, and the estimates made of them."""

import numpy as np
import pandas as pd
import pytest
import torch
from rich.console import Console

from experiments.protocol.draws import draw_split, nested
from experiments.protocol.experiment import Run
from experiments.records import configs
from experiments.records.results import Results
from experiments.records.rows import unpack_labels
from experiments.reporting.measured import with_right
from experiments.studies.recordings import view
from experiments.studies.recordings.measure import (
    recording_distances,
    recording_theory,
    recordings,
)
from scenes.frames import Frames

RANDOM = {"kind": "random", "test_fraction": 0.5}
MODELS = {name: configs.part("model", name) for name in ("hdc", "hdc_integer", "ridge")}


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


def test_rows_of_a_small_recording(scene, recording):
    of = configs.part("scene", "recorded")["scene"] | {"path": str(recording(60, 3))}
    run = Run(console=Console(quiet=True), force=True)
    rows = list(recordings.rows(run, of, {"random": RANDOM}, MODELS, [1, 5], draws=2))
    assert len(rows) == 2 * len(MODELS)
    for k, row in enumerate(rows):
        assert row["n"] == [1, 5]
        assert ("labels" in row) == (k % len(MODELS) == 0)  # once a draw
    counted = with_right(pd.DataFrame(rows), ("seed", "split", "draw"))
    for row, right in zip(rows, counted.right, strict=True):
        truth = rows[row["draw"] * len(MODELS)]["labels"]
        for predicted, n_right in zip(row["predicted"], right, strict=True):
            said = unpack_labels(predicted)
            assert len(said) == row["n_test"]
            assert (said == unpack_labels(truth)).sum() == n_right
    distances = list(recording_distances.rows(run, of))
    for kind, pairs in (("intra", 3 * 20 * 19 / 2), ("inter", 3 * 20 * 20)):
        counts = [row["count"] for row in distances if row["kind"] == kind]
        assert sum(counts) == pairs
    expected = list(recording_theory.rows(run, of, [1, 5], draws=2))
    assert [(row["draw"], row["n"]) for row in expected] == [
        (0, 1),
        (0, 5),
        (1, 1),
        (1, 5),
    ]
    for few, more in zip(expected[::2], expected[1::2], strict=True):
        for model in ("hdc", "mean_image"):
            assert 1 / 3 < few[model] < more[model] + 1e-9 <= 1 + 2e-9


def test_theory_stands_beside_what_was_measured(tmp_path, write_measurement):
    of = {"draw": 0, "seed": 0}
    rows = [
        of
        | {"model": name, "split": "random", "n_test": 100, "n": [1, 5], "right": right}
        for name, right in (("hdc", [50, 70]), ("correlation", [60, 75]))
    ]
    write_measurement("recordings", rows, scene="gelsight")
    write_measurement(
        "recording_theory",
        [of | {"n": 5, "hdc": 0.68, "mean_image": 0.7}],
        scene="gelsight",
    )
    (row,) = view.expected_by_theory(Results(tmp_path)).to_dict("records")
    assert (row["n"], row["hdc"], row["hdc_theory"]) == (5, 0.7, 0.68)
    assert row["cost"] == pytest.approx(0.05)
    assert row["cost_theory"] == pytest.approx(0.02)


def test_one_fibre_seen_through_more_fields_is_one_recording(
    tmp_path, write_measurement
):
    row = {
        "draw": 0,
        "seed": 0,
        "model": "hdc",
        "split": "counts",
        "n_test": 10,
        "n": [1],
    }
    for scene in ("fibre_grouped", "fibre_4_fields", "fibre_16_fields"):
        config = {"scene": configs.part("scene", scene)["scene"]}
        write_measurement(
            "recordings", [row | {"right": [5]}], config=config, scene=scene
        )
    results = Results(tmp_path)
    assert list(view.recordings(results)) == ["fibre_grouped"]
    assert view.fields(results).pixels.tolist() == [3362, 13448, 53792]


def test_a_change_of_settings_does_not_displace_the_whole_measurement(
    tmp_path, write_measurement
):
    scene = configs.task("recordings")["scene"]
    for draws, right in ((20, 90), (2, 10)):
        row = {
            "seed": 0,
            "split": "counts",
            "draw": 0,
            "n_test": 100,
            "n": [5],
            "right": [right],
        }
        rows = [
            row | {"model": name, "draw": k}
            for name in ("hdc", view.RIVAL)
            for k in range(3)
        ]
        config = {"scene": scene, "draws": draws, "seeds": [0]}
        write_measurement("recordings", rows, config=config, scene="gelsight")
    (measured,) = view.recordings(Results(tmp_path)).values()
    assert measured.record.config["draws"] == 20
    summary = view.summary(measured).set_index("model")
    assert summary.accuracy["hdc"] == 0.9
