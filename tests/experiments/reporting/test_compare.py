"""Own results beside the reference: which numbers differ, and what is not compared."""

import pandas as pd
import pytest

from experiments.reporting.compare import compare
from experiments.reporting.table import Table

RATIO = "training_time_over_hdc"


def a_table(value, low=0.8, high=0.9, column="x", key=("model",), **more):
    numbers = {column: value, f"{column}_low": low, f"{column}_high": high}
    data = pd.DataFrame([{"model": "softmax", **numbers, **more}])
    return Table("some", lambda frame: frame, of="runs", data=data, key=key)


@pytest.mark.parametrize(
    ("own", "differs"),
    [
        ((0.85,), False),
        ((0.81, None, None), False),
        ((0.79, None, None), True),
        ((0.79, 0.75, 0.81), False),  # the intervals meet
        ((0.79, 0.75, 0.799), True),
        ((0.95, 0.91, 0.99), True),
    ],
)
def test_a_number_differs_if_its_interval_lies_outside(own, differs):
    assert compare([a_table(*own)], [a_table(0.85)]).differs.tolist() == [differs]


PAPER, QUICK = {"stop_rule": "paper"}, {"stop_rule": "quick"}


@pytest.mark.parametrize(
    ("own", "reference", "compared"),
    [
        ({}, {}, True),
        ({"key": ()}, {"key": ()}, False),
        ({"model": "ridge"}, {}, False),
        # Seconds belong to the machine.
        ({"column": "training_time_s"}, {"column": "training_time_s"}, False),
        # By the rule of stopping, not by the reason for which a training ended.
        (PAPER | {"stop": "budget"}, PAPER | {"stop": "trained"}, True),
        (PAPER | {"stop": "trained"}, QUICK | {"stop": "trained"}, False),
        # Until 90 % in training every rule is the same.
        (PAPER | {"column": RATIO}, QUICK | {"column": RATIO}, True),
    ],
)
def test_what_another_machine_or_another_rule_makes_is_not_compared(
    own, reference, compared
):
    found = compare([a_table(0.5, **own)], [a_table(0.85, **reference)])
    assert len(found) == compared
