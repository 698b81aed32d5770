"""Numbers at their limits: every case holds, and the verdict of a case."""

import math

import pytest

from experiments.studies.limits.stability.case import Case
from experiments.studies.limits.stability.measure import CASES

pytestmark = pytest.mark.usefixtures("one_thread")


@pytest.mark.parametrize("case", CASES, ids=lambda case: f"{case.part}: {case.case}")
def test_ours_is_right_where_the_obvious_computation_is_extreme(case):
    row = case.row()
    assert row["verdict"] == "holds", row
    assert row["error_naive"] is None or row["error_naive"] > row["tolerance"]


@pytest.mark.parametrize(
    ("error", "verdict"),
    [(0.0, "holds"), (0.5, "holds"), (0.51, "fails"), (math.nan, "fails"), (math.inf, "fails")],
)  # fmt: skip
def test_a_case_holds_up_to_its_tolerance_and_never_by_nan(error, verdict):
    def prepare():
        return lambda: 1 / 0, lambda: 0, 0, 0.5

    row = Case(*[""] * 6, lambda result, exact: error, prepare).row()
    assert row["verdict"] == verdict
    assert row["error_ours"] == (error if math.isfinite(error) else None)
    assert row["error_naive"] is None
