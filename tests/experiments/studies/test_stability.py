"""Numbers at their limits: every case holds, and the verdict of a case."""

import math

import pytest

from experiments.studies.stability.case import Case, largest
from experiments.studies.stability.measure import CASES, PARTS

pytestmark = pytest.mark.usefixtures("one_thread")


def row_of(naive, ours, *exact, error=largest):
    return Case(
        "training", "a", lambda: (naive, ours, *exact), "", "", "", "", error, tolerance=0.5
    ).row()


@pytest.mark.parametrize("case", CASES, ids=lambda case: f"{case.part}: {case.name}")
def test_ours_is_right_where_the_obvious_computation_is_extreme(case):
    row = case.row()
    assert row["verdict"] == "holds", row
    if "ties of" not in case.name:
        assert row["error_naive"] is None or row["error_naive"] > row["tolerance"]


@pytest.mark.parametrize(
    ("error", "verdict"),
    [(0.0, "holds"), (0.5, "holds"), (0.51, "fails"), (math.nan, "fails"), (math.inf, "fails")],
)
def test_a_case_holds_up_to_its_tolerance_and_never_by_nan(error, verdict):
    row = row_of(lambda: 0, lambda: 0, 0, error=lambda result, exact: error)
    assert row["verdict"] == verdict
    assert row["error_ours"] == (error if math.isfinite(error) else None)


def test_a_computation_that_raises_has_no_error():
    row = row_of(lambda: 1 / 0, lambda: 3, 0, 3.0)
    assert (row["error_naive"], row["error_ours"], row["verdict"]) == (None, 3.0, "holds")


def test_a_mistake_in_a_case_is_not_hidden():
    with pytest.raises(TypeError):
        row_of(lambda: None + 1, lambda: 1, 0)


def test_names_tell_cases_apart_and_every_part_has_some():
    assert len({case.name for case in CASES}) == len(CASES)
    assert {case.part for case in CASES} == set(PARTS)
