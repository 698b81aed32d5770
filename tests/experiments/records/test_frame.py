"""The rows of records as one data frame."""

import pandas as pd

from experiments.records import store
from experiments.records.configs import scene_display
from experiments.records.groups import Groups
from experiments.records.results import META, RUNS, Results
from experiments.reporting.columns import scene_name


def test_lines_of_an_experiment_have_what_their_rows_and_records_have(
    tmp_path, write_measurement
):
    write_measurement("drift", [{"model": "hdc", "n": 3}], scene="drift")
    other = {"scene": {"path": "mine"}}
    rows = [{"model": "hdc", "n": 4, "scene": "of the row"}]
    write_measurement("robustness", rows, config=other, scene="recorded")
    results = Results(tmp_path)
    frame = results.frame("drift", "robustness")
    assert set(META) <= set(frame.columns)
    assert frame.experiment.tolist() == ["drift", "robustness"]
    assert frame.n.tolist() == [3, 4]
    assert frame.scene.tolist() == ["drift", "of the row"]
    assert frame.elsewhere.tolist() == [False, True]
    assert frame.config[1] == other
    assert "scene" not in results.measurements[0].frame
    pd.testing.assert_frame_equal(results.frame("drift"), frame[:1], check_dtype=False)


def test_there_are_no_lines_without_records(tmp_path):
    assert len(Results(tmp_path).frame(RUNS, "drift")) == 0
    assert list(Groups.of(Results(tmp_path).frame(RUNS))) == []


def test_runs_are_lines_and_their_groups_are_those_of_the_results(tmp_path, write_run):
    for seed in (0, 1):
        write_run("hdc", seed=seed)
    results = Results(tmp_path)
    frame = results.frame(RUNS)
    assert frame.seed.tolist() == [0, 1]
    assert frame.model.tolist() == ["hdc", "hdc"]
    assert frame.test_accuracy_final.tolist() == [
        run.test_accuracy_final for run in results.runs
    ]
    (group,) = Groups.of(frame)
    assert group == Groups(results.runs).group(group.scene, "hdc")


def of_models(*names, seeds=(0, 1), **more):
    """Config and scene of a measurement of some models."""
    config = {"models": {name: {} for name in names}, "seeds": list(seeds), **more}
    return {"config": config, "scene": "gelsight"}


def test_models_that_were_measured_apart_stand_beside_the_others(
    tmp_path, write_measurement
):
    """A form that takes long is measured by a call of its own, with fewer seeds."""
    for changes, model, entry in (
        (0, "hdc", of_models("hdc", "ridge")),
        (3, "bits_chosen", of_models("bits_chosen", seeds=[0])),
        (1, "hdc", of_models("hdc", p=0.5)),  # a model that is there
        (3, "cnn1", of_models("cnn1", p=0.5)),  # of other settings
        (3, "cnn3", of_models("cnn3", seeds=[2])),  # of other seeds
    ):
        changed = {f"key_{k}": "1" for k in range(changes)}
        row = {"model": model, "right": 5, "seed": 0}
        write_measurement("robustness", [row], changed=changed, **entry)
    frame = Results(tmp_path).frame("robustness")
    found = frame.config.map(lambda config: "p" in config)
    assert set(zip(frame.model, found, strict=True)) == {
        ("hdc", False),
        ("bits_chosen", False),
    }


def test_a_scene_that_the_command_line_changed_stands_beside_its_config_and_says_how(
    tmp_path, write_measurement
):
    command = "python -m experiments.run experiment=drift"
    typed = ["scene.sessions.1.offset=0.8", "'+scene.note=a b'", "scene.sensor.seed=3"]
    rooms = [{"offset": 0.0}, {"offset": 0.8}]
    config = {"scene": {"sessions": rooms, "note": "a b", "sensor": {"seed": 3}}}
    write_measurement("drift", [{"seed": 0}], scene="drift", command=command)
    write_measurement(
        "drift", [{"seed": 1}], config=config, scene="drift",
        command=" ".join([command, *typed]),
    )  # fmt: skip
    frame = Results(tmp_path).frame("drift")
    label = 'drift (sessions.1.offset=0.8, note="a b")'
    assert dict(zip(frame.seed, frame.scene, strict=True)) == {0: "drift", 1: label}
    assert scene_name(label) == 'Drift (sessions.1.offset=0.8, note="a b")'
    assert scene_display(label)["kind"] == scene_display("drift")["kind"]


def test_a_command_with_an_open_quote_costs_its_record_alone(
    tmp_path, write_measurement
):
    for name in ("drift", "robustness"):
        write_measurement(name, [{"seed": 0}], scene="drift", command=f"typed {name}")
    path = tmp_path / store.FILE
    path.write_text(path.read_text().replace("typed drift", "typed 'drift"))
    results = Results(tmp_path)
    (problem,) = results.problems
    assert "No closing quotation" in problem
    assert [measured.name for measured in results.measurements] == ["robustness"]


def test_times_of_two_calls_do_not_stand_beside_each_other(tmp_path, write_measurement):
    for model in ("hdc", "ridge"):
        row = {"model": model, "fit_s": 1.0}
        write_measurement("recording_costs", [row], **of_models(model))
    assert len(Results(tmp_path).frame("recording_costs")) == 1
