"""Published numbers beside ours: the rule of the verdict, and the rows."""

import pytest

from experiments.records.configs import CONFIGS
from experiments.reporting import published
from experiments.reporting.comparison import compare, verdict
from experiments.reporting.published import Published
from experiments.reporting.study import Quantity
from experiments.reporting.table import records


def paper(value=90.0, calibration="", name="touch/some", unit="%", margin=3.0, why=""):
    return Published(
        name, value, unit, calibration=calibration, margin=margin, not_comparable=why
    )


def ours(value, low=None, high=None):
    return Quantity("touch/some", value, low, high)


@pytest.mark.parametrize(
    ("known", "measured", "expected"),
    [
        (paper(), None, "missing"),
        (paper(name="touch/labels"), ours(90.0), "setting, same"),
        (paper(name="touch/labels"), ours("mixed"), "setting, another"),
        (paper(), ours("not reached in 5 s"), "not reached"),
        (paper(why="another machine"), ours(90.0, 89.0, 91.0), "not comparable"),
        (paper(), ours(90.0, low=80.0), "no interval"),
        (paper(calibration="fitted"), ours(90.0), "fitted, no interval"),
        (paper(), ours(88.0, 85.5, 90.5), "agrees"),
        # Outside the interval and within the margin: no more than a precise measurement.
        (paper(), ours(88.0, 87.0, 89.0), "agrees"),
        (paper(), ours(86.5, 85.5, 87.5), "differs"),
        # A wide interval agrees with nothing, and differs from what is outside.
        (paper(), ours(90.0, 86.5, 91.0), "uninformative"),
        (paper(), ours(70.0, 55.0, 85.0), "differs"),
        # An interval that ends at 100 % is as wide as its other side.
        (paper(100.0), ours(99.9, 96.0, 100.0), "uninformative"),
        (paper(calibration="fitted"), ours(88.0, 85.5, 90.5), "fitted"),
        (paper(calibration="fitted"), ours(80.0, 79.0, 81.0), "fitted, differs"),
        (paper(calibration="watched"), ours(88.0, 85.5, 90.5), "watched, agrees"),
        # Ratios are off by factors.
        (paper(100.0, unit="×", margin=2.0), ours(60.0, 40.0, 90.0), "agrees"),
        (paper(100.0, unit="×", margin=2.0), ours(40.0, 30.0, 60.0), "differs"),
        (paper(100.0, unit="×", margin=2.0), ours(60.0, 20.0, 180.0), "uninformative"),
        (paper(100.0, unit="×", margin=2.0), ours(60.0, 0.0, 180.0), "no interval"),
    ],
)
def test_verdicts(known, measured, expected):
    assert verdict(known, measured) == expected


def test_every_published_number_has_a_row_and_an_experiment_that_makes_it():
    rows = records(compare([]).data)
    assert [f"{row['experiment']}/{row['quantity']}" for row in rows] == list(
        published.numbers()
    )
    for row in rows:
        assert row["verdict"] == "missing"
        experiment = row["made_by"].partition(" experiment=")[2]
        assert (CONFIGS / "experiment" / f"{experiment}.yaml").is_file(), experiment


def test_a_row_has_what_is_behind_its_number_and_one_for_each_condition():
    quantities = [
        Quantity(
            "table1/hdc_test_accuracy",
            98.0,
            95.0,
            99.5,
            "Wilson",
            n=300,
            made_by="make it",
        ),
        *(
            Quantity("drift/recovered_accuracy", 90.0, condition=f"p = {p}")
            for p in (0.5, 0.75)
        ),
        Quantity("table1/of_our_own", 1.0),  # the paper does not give it
    ]
    data = records(compare(quantities).data)
    assert len(data) == len(published.numbers()) + 1
    (row,) = (row for row in data if row["measured"] == 98)
    assert (row["low"], row["high"], row["n"], row["made_by"]) == (
        95,
        99.5,
        300,
        "make it",
    )
    assert {row["condition"] for row in data if row["measured"] == 90} == {
        "p = 0.5",
        "p = 0.75",
    }
