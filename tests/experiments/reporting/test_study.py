"""A study is a folder with a view; its functions of a data frame make tables, figures, numbers."""

import pandas as pd
import pytest

from experiments import studies
from experiments.records.results import Results
from experiments.reporting.study import Numbers, Quantity, Study
from experiments.reporting.study import studies as studies_of
from experiments.reporting.table import Table


def test_no_study_has_anything_to_say_of_an_empty_folder(tmp_path):
    every = studies_of(studies)
    assert {"table1", "accuracy", "claims", "recordings", "drift"} <= {
        s.name for s in every
    }
    results = Results(tmp_path)
    for study in every:
        for made in (study.tables_of, study.plots_of, study.quantities_of):
            assert not list(made(results)), study.name


def some(frame):
    counts = frame.groupby("model", as_index=False)["right"].sum()
    return counts.assign(k=frame.config.iloc[0]["k"])


def nothing(frame):
    raise AssertionError("drift was not measured")


def quantities(frame):
    yield Quantity("a/b", float(frame.right.sum()))


STUDY = Study(
    "of_a_test",
    "Title",
    "Question?",
    1,
    tables=[
        Table(
            "some",
            some,
            of="correlation",
            title="Some, {frames}, {machine}",
            note=lambda frame: f"Of {len(frame)} lines.",
            shown=lambda data: [name for name in data if name != "k"],
        ),
        Table("none", nothing, of="drift", title="None"),
    ],
    numbers=[Numbers(quantities, of="correlation")],
)


def test_rows_of_an_experiment_become_a_table(tmp_path, write_measurement):
    rows = [
        {"origin": "simulated", "model": m, "right": int(n)}
        for m, n in ("a1", "a2", "b4")
    ]
    write_measurement("correlation", rows, config={"k": 5})
    (made,) = STUDY.tables_of(Results(tmp_path))
    pd.testing.assert_frame_equal(
        made.data, pd.DataFrame({"model": ["a", "b"], "right": [3, 4], "k": 5})
    )
    assert made.title == "Some, simulated frames, A CPU, 2 threads"
    assert made.commands == ("python -m experiments.run experiment=correlation",)
    assert (made.note, made.names) == ("Of 3 lines.", ["model", "right"])


def test_frames_of_others_are_lines_and_none_of_the_papers_numbers(
    tmp_path, write_measurement
):
    row = {"origin": "simulated", "model": "a", "right": 1}
    write_measurement("correlation", [row], config={"k": 5})
    mine = {"k": 5, "scene": {"path": "mine"}}
    write_measurement("correlation", [row], config=mine, scene="recorded")
    (made,) = STUDY.tables_of(Results(tmp_path))
    assert made.data.right.tolist() == [2]
    assert [q.value for q in STUDY.quantities_of(Results(tmp_path))] == [1]


def test_what_fails_is_named_and_the_others_are_made(tmp_path, write_measurement):
    row = {"origin": "simulated", "model": "a", "right": 1}
    write_measurement("correlation", [row], config={"k": 5})
    write_measurement("drift", [row])
    failures = []
    (made,) = STUDY.tables_of(Results(tmp_path), failures)
    assert made.name == "some"
    (failure,) = failures
    expected = "study of_a_test failed at table none: AssertionError: drift was not"
    assert str(failure).startswith(expected)
    with pytest.raises(AssertionError, match="drift was not measured"):
        list(STUDY.tables_of(Results(tmp_path)))
