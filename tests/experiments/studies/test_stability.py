"""Numbers at their limits: the verdict, every case in its small size, the table."""

import math

import pytest

from experiments.protocol.experiment import Run
from experiments.records.results import Results
from experiments.studies.stability.case import CASES, Case, Forms
from experiments.studies.stability.measure import PARTS, stability
from experiments.studies.stability.view import STUDY

pytestmark = pytest.mark.usefixtures("one_thread")

WORDS = dict.fromkeys(("extreme", "unit", "naive", "ours"), "words")


def row_of(naive, ours, error, tolerance=None):
    forms = Forms(naive, ours, error, tolerance)
    return Case(part="layer", name="a", prepare=lambda: forms, tolerance=0.5, **WORDS).row()


@pytest.mark.parametrize("case", CASES, ids=lambda case: f"{case.part}: {case.name}")
def test_ours_is_right_where_the_obvious_computation_is_extreme(case):
    row = case.row(small=True)
    assert row["verdict"] == "holds", row


def test_the_obvious_computation_fails_in_the_full_sizes_that_are_quick():
    named = {case.name: case for case in CASES}
    for name in ("balance of a constant frame", "negative words", "two samples a class"):
        row = named[name].row()
        assert row["error_naive"] > row["tolerance"]


@pytest.mark.parametrize(
    ("error", "verdict"),
    [(0.0, "holds"), (0.5, "holds"), (0.51, "fails"), (math.nan, "fails"), (math.inf, "fails")],
)
def test_a_case_holds_up_to_its_tolerance_and_never_by_nan(error, verdict):
    row = row_of(lambda: 0, lambda: 0, lambda _: error)
    assert row["verdict"] == verdict
    assert row["error_ours"] == (error if math.isfinite(error) else None)


def test_a_computation_that_raises_has_no_error():
    row = row_of(lambda: 1 / 0, lambda: 3, abs, tolerance=3.0)
    assert (row["error_naive"], row["error_ours"], row["verdict"]) == (None, 3.0, "holds")


def test_a_mistake_in_a_case_is_not_hidden():
    with pytest.raises(TypeError):
        row_of(lambda: "a", lambda: "b", abs)


def test_names_tell_cases_apart_and_every_part_has_some():
    assert len({case.name for case in CASES}) == len(CASES)
    assert {case.part for case in CASES} == set(PARTS)


def test_rows_become_a_table(tmp_path, write_measurement, monkeypatch):
    few = [case for case in CASES if case.name in ("negative words", "squares that underflow")]
    monkeypatch.setattr("experiments.studies.stability.measure.CASES", few)
    rows = list(stability.rows(Run(), small=True))
    write_measurement("stability", [*rows, {**rows[0], "verdict": "fails", "error_ours": 125000.0}])
    (table,) = STUDY.tables_of(Results(tmp_path))
    assert table.title == "Numbers at their limits: 2 of 3 cases hold"
    shown = [dict(zip(table.heads, cells, strict=True)) for cells in table.cells()]
    assert [line["Error, obvious"] for line in shown] == ["63", "–", "63"]
    assert [line["Error, ours"] for line in shown][::2] == ["0", "125,000"]
    assert [line["Verdict"] for line in shown] == ["holds", "holds", "fails"]
