"""A study is a folder with a view; its decorators make tables, figures and numbers of records."""

import pandas as pd
import pytest

from experiments import studies
from experiments.records.results import Results
from experiments.reporting.study import Quantity, Study
from experiments.reporting.study import studies as studies_of


def test_no_study_has_anything_to_say_of_an_empty_folder(tmp_path):
    every = studies_of(studies)
    assert {"table1", "accuracy", "claims", "recordings", "drift"} <= {
        s.name for s in every
    }
    results = Results(tmp_path)
    for study in every:
        for made in (study.tables_of, study.plots_of, study.quantities_of):
            assert not list(made(results)), study.name


@pytest.fixture
def study():
    made = Study("of_a_test", "Title", "Question?", 1)

    @made.table(
        "some", of="correlation", title="Some, {frames}, {machine}", note="How."
    )
    def some(rows, config):
        return (
            rows.groupby("model", as_index=False)["right"].sum().assign(k=config["k"])
        )

    @made.table("none", of=("correlation", "drift"), title="None")
    def none(rows, others, config):
        raise AssertionError("drift was not measured")

    @made.quantities(of="correlation")
    def quantities(rows, config):
        yield Quantity("a/b", float(rows.right.sum()))

    return made


def test_rows_of_a_measurement_become_a_table_for_each_kind_of_frames(
    tmp_path, write_measurement, study
):
    rows = [
        {"origin": "simulated", "model": m, "right": int(n)}
        for m, n in ("a1", "a2", "b4")
    ]
    write_measurement("correlation", rows, config={"k": 5})
    write_measurement("correlation", rows[:1], config={"k": 6, "scene": {"path": "mine"}},
                      scene="recorded")  # fmt: skip
    first, second = study.tables_of(Results(tmp_path))
    pd.testing.assert_frame_equal(
        first.data, pd.DataFrame({"model": ["a", "b"], "right": [3, 4], "k": 5})
    )
    assert (first.name, second.name) == ("some", "some_recorded")
    assert first.title == "Some, simulated frames, A CPU, 2 threads"
    assert first.commands == ("python -m experiments.run experiment=correlation",)
    assert [q.value for q in study.quantities_of(Results(tmp_path))] == [
        7
    ]  # not of other frames


def test_a_caption_says_pale_only_where_a_reference_is_drawn(tmp_path, write_run):
    study = Study("some", "A title", "A question?", 1)
    drawn = []

    @study.figure(
        "curve",
        caption=lambda results: f"Of {len(results.runs)}.",
        needs=lambda results: bool(results.runs),
        commands=lambda results: [f"make {len(results.runs)}"],
        over=True,
    )
    def curve(figure, results, behind=None):
        drawn.append(behind)

    empty = Results(tmp_path / "empty")
    write_run("hdc")
    own = Results(tmp_path)
    (plot,) = study.plots_of(own)
    assert (plot.caption, tuple(plot.commands)) == ("Of 1.", ("make 1",))
    assert plot.over(None).caption == plot.over(empty).caption == "Of 1."
    over = plot.over(own)
    assert over.caption == "Of 1. Pale: the reference."
    over.draw()
    plot.draw()
    assert drawn == [own, None]
