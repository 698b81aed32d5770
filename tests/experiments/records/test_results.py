"""Which records count, what a line of the frame has, and that every run is seen somewhere."""

import json
import math

import pytest

from experiments.records import configs, store
from experiments.records.results import RUNS, Results, own_frames
from experiments.records.rows import pack_labels

OTHER = {"experiments": 0, "hdc.HDCClassifier": 1}  # of an earlier protocol
STEPS = [{"training_s": 1.0, "loss": 1.0}]  # the curve of a model that learns by steps
BESIDE = {"environment": {"exclusive": False}}


def every(seeds, **about):
    return [{"seed": seed, **about} for seed in seeds]


@pytest.mark.parametrize(
    ("written", "seeds", "others"),
    [
        # The newest of one code: none are averaged with those of another.
        ([*every((1, 2, 3), made_by=OTHER), *every((0,))], [0], 3),
        ([*every((0,)), *every((3, 1), made_by=OTHER)], [1, 3], 1),
        # The stopping rule of the paper before newer ones, and before more.
        ([*every((7,)), *every((0, 1), stop="quick")], [7], 2),
        # Timed alone before the rule.
        ([*every((0,), stop="quick"), *every((1, 2), **BESIDE)], [0], 2),
        # Another sensor is another repetition.
        (every((0,)) + every((1, 2), change={"scene.sensor.seed": 9}), [0, 1, 2], 0),
    ],
)
def test_of_several_configurations_of_one_row_one_counts(
    tmp_path, write_run, written, seeds, others
):
    for about in written:
        write_run("softmax", curve=STEPS, **about)
    lines = Results(tmp_path).frame(RUNS)
    assert lines.seed.tolist() == seeds
    assert set(lines.others) == {others}


@pytest.mark.parametrize(
    ("model", "key", "value", "row"),
    [
        ("softmax", "model.lr", 0.5, ("touch", "softmax (lr=0.5)")),
        ("softmax", "stop.budget_s", 7, ("touch", "softmax (budget_s=7)")),
        ("hdc", "stop.budget_s", 7, ("touch", "hdc")),  # it learns in one pass
        ("hdc", "split.test_fraction", 0.3, ("touch (test_fraction=0.3)", "hdc")),
    ],
)
def test_a_run_with_another_value_has_a_row_of_its_own(
    tmp_path, write_run, model, key, value, row
):
    curve = STEPS if model == "softmax" else None
    write_run(model, curve=curve)
    for seed in (1, 2):  # more of them, so that they would be preferred
        write_run(model, seed=seed, curve=curve, change={key: value})
    rows = Results(tmp_path).frame(RUNS).groupby(["scene", "model"]).seed.agg(list)
    assert rows["touch", model][0] == 0
    assert rows[row][-2:] == [1, 2]


@pytest.mark.parametrize(
    ("report", "reason", "seconds"),
    [
        ({"loss": 0.1, "steps": 20, "train_accuracy": 0.95}, "trained", 7.0),
        ({"loss": 0.1, "steps": 20}, "budget", math.inf),
        ({}, "finished", 7.0),
        # One report without steps of an optimiser: it was solved, below 90 %.
        ({"loss": 0.1}, "finished", 7.0),
        ({"loss": 0.1}, "budget", math.inf),
    ],
)
def test_a_training_lasts_until_90_percent_or_until_it_is_done(
    tmp_path, write_run, report, reason, seconds
):
    curve = [{"training_s": 7.0, "train_accuracy": 0.8, **report}]
    write_run("ridge", curve=curve, stopped=reason)
    lines = Results(tmp_path).frame(RUNS)
    assert (lines.training_time_s[0], lines.total_time_s[0]) == (seconds, 7.0)


# Measurements -------------------------------------------------------------------------------------


def of_models(*names, seeds=(0, 1), **config):
    config |= {"models": {name: {} for name in names}, "seeds": list(seeds)}
    return {"rows": [{"model": names[-1], "seed": 0}], "config": config}


@pytest.mark.parametrize(
    ("written", "models"),
    [
        # A richer measurement of one's own takes the place of the first.
        ([of_models("hdc"), of_models("hdc", "ridge")], ["ridge"]),
        ([of_models("ridge"), of_models("cnn1", p=0.5)], ["cnn1"]),
        # Measurements that the config counts stand beside each other, each the last of its number;
        # the second one may leave out a model that takes long.
        (
            [
                of_models("cnn1", measurement=1),
                of_models("cnn3", "ridge", measurement=1),
                of_models("ridge", measurement=2),
            ],
            ["ridge", "ridge"],
        ),
    ],
)
def test_of_several_measurements_the_newest_counts_and_what_is_left_out_is_said(
    tmp_path, write_measurement, written, models
):
    for about in written:
        write_measurement("robustness", scene="gelsight", **about)
    results = Results(tmp_path)
    assert sorted(results.frame("robustness").model) == models
    told = list(results.left_out())
    assert len(told) == len(written) - len(models)
    assert all("a later measurement of robustness takes its place" in x for x in told)
    counting = {measured.id for measured in results.chosen("robustness")[0]}
    assert not counting & {line.partition(":")[0] for line in told}


@pytest.mark.parametrize(
    ("experiment", "scenes", "own"),
    [
        ("drift", ["touch", "drift (noise=2)", "drift"], ["drift"]),
        ("times_busy", ["gelsight", "touch"], ["touch"]),  # as times, its base
        ("my_experiment", ["touch", "drift"], ["touch", "drift"]),
    ],
)
def test_an_experiments_own_frames_are_those_of_its_config(
    tmp_path, write_measurement, experiment, scenes, own
):
    for label in scenes:
        write_measurement(experiment, [{"a": 1}], {"of": label}, "x", label)
    found = own_frames(Results(tmp_path).frame(experiment))
    assert set(found.scene) == set(own)
    assert not len(own_frames(Results(tmp_path).frame("never made")))


# Lines --------------------------------------------------------------------------------------------


def test_a_line_has_the_values_of_its_row_and_what_names_its_record(
    tmp_path, write_measurement
):
    labels, *predicted = map(pack_labels, ([0, 1, 1], [0, 1, 1], [1, 1, 1]))
    rows = [
        {"model": "hdc", "n": [1, 5], "predicted": predicted, "labels": labels},
        {"model": "ridge", "n": [5], "predicted": [predicted[1]], "kept": [[1, 2]]},
        {"model": "cnn1", "n": [1, 2, 3], "why": ["a"]},  # not of one length
    ]
    config = {"scene": {"sizes": [1, 2]}, "draws": 2}
    write_measurement("recordings", rows, config, "recorded", "recorded (a=1)")
    write_measurement("drift", [{"n": 4, "scene": "of the row"}], scene="drift")
    frame = Results(tmp_path).frame("drift", "recordings")
    names = ["scene", "n", "place", "right", "kept", "scene.sizes"]
    found = frame[names].astype(object).where(frame[names].notna(), None)
    of_record = "recorded (a=1)"
    assert found.to_numpy().tolist() == [
        ["of the row", 4, None, None, None, None],
        [of_record, 1, 0, 3, None, "[1, 2]"],
        [of_record, 5, 1, 2, None, "[1, 2]"],
        [of_record, 5, 0, 2, "[1, 2]", "[1, 2]"],
        [of_record, "[1, 2, 3]", None, None, None, "[1, 2]"],
    ]
    assert frame.labels[1:4].tolist() == [labels] * 3  # each line has the true classes


def test_what_is_no_record_costs_itself_only(tmp_path, write_run):
    good = write_run("hdc")
    path = tmp_path / store.FILE
    earlier = f"{json.dumps({'schema': 5})}\n"
    path.write_text(f"{path.read_text()}no\n{2 * earlier}")
    results = Results(tmp_path)
    assert [made.id for made in results.runs] == [good]
    expected = [
        f"{path}, line 2: ",
        f"{path}: 2 records of an earlier version",
    ]
    assert len(results.problems) == len(expected)
    assert all(map(str.startswith, results.problems, expected))


def test_reading_records_changes_nothing_but_what_is_shown_while_it_is_asked_for(
    tmp_path, write_run
):
    shown = {"display": {"name": "Mine"}, "scene_display": {"name": "My sensor"}}
    write_run("hdc", **shown)
    write_run("hdc", **shown, choices={"model": "own", "scene": "mine"})

    def names():
        models = [configs.display(name)["name"] for name in ("hdc", "own")]
        return [*models, configs.scene_display("mine")["name"]]

    results = Results(tmp_path)
    results.frame(RUNS)
    assert names() == ["HDC as published", "own", "mine"]
    with configs.shown_as(results.displays):
        assert names() == ["HDC as published", "Mine", "My sensor"]
    assert names() == ["HDC as published", "own", "mine"]
