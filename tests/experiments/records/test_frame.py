"""The rows of records as one data frame."""

import pandas as pd

from experiments.records.groups import Groups
from experiments.records.results import META, RUNS, Results


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
    assert not Groups.of(Results(tmp_path).frame(RUNS))


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
