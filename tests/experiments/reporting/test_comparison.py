"""Published numbers beside ours: the verdict's rule, and what a row says."""

import csv

import pytest
from hypothesis import given
from hypothesis import strategies as st

from experiments.records.configs import CONFIGS
from experiments.reporting import published
from experiments.reporting.comparison import compare, verdict
from experiments.reporting.published import Published
from experiments.reporting.study import Quantity
from experiments.reporting.table import records


def paper(value=90.0, calibration="", name="touch/some", unit="%", margin=3.0, why=""):
    return Published(name, value, unit, calibration=calibration, margin=margin, not_comparable=why)


def ours(value, low=None, high=None):
    return Quantity("touch/some", value, low, high)


@pytest.mark.parametrize(
    ("known", "found", "expected"),
    [
        (paper(), None, "missing"),
        (paper(), ours(None), "missing"),
        (paper(calibration="fitted"), None, "missing"),
        (paper(name="touch/labels"), None, "missing"),
        (paper(name="touch/labels"), ours(90.0), "setting, same"),
        (paper(name="touch/labels"), ours(91.0), "setting, another"),
        (paper(name="touch/labels"), ours("mixed"), "setting, another"),
        (paper(), ours("not reached in 5 s"), "not reached"),
        (paper(why="another machine"), ours(90.0, 89.0, 91.0), "not comparable"),
        (paper(), ours(90.0), "no interval"),
        (paper(), ours(90.0, low=80.0), "no interval"),
        (paper(margin=None), ours(90.0, 89.0, 91.0), "no interval"),
        (paper(calibration="fitted"), ours(90.0), "fitted, no interval"),
        (paper(), ours(88.0, 85.5, 90.5), "agrees"),
        # Outside the interval and within the margin: no more than a precise measurement.
        (paper(), ours(88.0, 87.0, 89.0), "agrees"),
        (paper(), ours(86.5, 85.5, 87.5), "differs"),
        # What is wide agrees with nothing, and differs from what is outside.
        (paper(), ours(90.0, 86.5, 91.0), "uninformative"),
        (paper(), ours(80.0, 65.0, 95.0), "uninformative"),
        (paper(), ours(70.0, 55.0, 85.0), "differs"),
        # An interval that ends at 100 % is as wide as its other side.
        (paper(100.0), ours(99.9, 96.0, 100.0), "uninformative"),
        (paper(calibration="fitted"), ours(88.0, 85.5, 90.5), "fitted"),
        (paper(calibration="fitted"), ours(88.0, 80.0, 96.0), "fitted, uninformative"),
        (paper(calibration="fitted"), ours(80.0, 79.0, 81.0), "fitted, differs"),
        (paper(calibration="watched"), ours(88.0, 85.5, 90.5), "watched, agrees"),
        (paper(calibration="watched"), ours(90.0, 50.0, 91.0), "watched, uninformative"),
        # Ratios are off by factors.
        (paper(100.0, unit="×", margin=2.0), ours(60.0, 40.0, 90.0), "agrees"),
        (paper(100.0, unit="×", margin=2.0), ours(40.0, 30.0, 60.0), "differs"),
        (paper(100.0, unit="×", margin=2.0), ours(60.0, 20.0, 180.0), "uninformative"),
    ],
)
def test_verdicts(known, found, expected):
    assert verdict(known, found) == expected


@given(st.floats(-1e3, 1e3), st.floats(-1e3, 1e3), st.floats(0.1, 10), st.floats(0.1, 10))
def test_imprecision_never_makes_a_number_agree(value, known, half, margin):
    """The committed times of the networks matched because three seeds made them factors wide."""
    narrow, wide = (
        verdict(paper(known, margin=margin), ours(value, value - h, value + h))
        for h in (half, half + 1.1 * margin)
    )
    assert wide == ("differs" if abs(value - known) > half + 1.1 * margin else "uninformative")
    if narrow == "agrees":
        assert max(abs(value - known), half) <= margin * (1 + 1e-6)


def test_every_published_number_has_a_row_whatever_is_missing():
    rows = records(compare([]).data)
    assert [f"{row['experiment']}/{row['quantity']}" for row in rows] == list(published.numbers())
    assert {row["verdict"] for row in rows} == {"missing"}
    for row in rows:
        program, _, experiment = row["made_by"].partition(" experiment=")
        assert program == "python -m experiments.run"
        assert (CONFIGS / "experiment" / f"{experiment}.yaml").is_file()


def test_a_row_says_what_is_behind_its_number():
    quantity = Quantity(
        "table1/hdc_test_accuracy", 98.0, 95.0, 99.5, "Wilson", n=300, seeds=3, made_by="make it",
        note="as it is",
    )  # fmt: skip
    made = compare([quantity])
    (row,) = (row for row in records(made.data) if row["measured"] is not None)
    assert (row["experiment"], row["quantity"], row["unit"]) == ("table1", "hdc_test_accuracy", "%")
    assert (row["measured"], row["low"], row["high"]) == (98, 95, 99.5)
    assert (row["n"], row["seeds"], row["made_by"]) == (300, 3, "make it")
    assert row["note"].startswith("interval: Wilson; as it is")
    cells = next(cells for cells in made.cells() if "make it" in cells)
    assert cells[0] == "table1: hdc test accuracy"
    assert "98.00 [95.00, 99.50]" in cells


def test_a_condition_that_the_paper_leaves_open_makes_a_row_of_each():
    rates = [Quantity("drift/recovered_accuracy", 90.0, condition=f"p = {p}") for p in (0.5, 0.75)]
    made = compare(rates)
    assert len(records(made.data)) == len(published.numbers()) + 1
    names = [cells[0] for cells in made.cells() if "recovered accuracy, " in cells[0]]
    assert names == [f"drift: recovered accuracy, p = {p}" for p in (0.5, 0.75)]


def test_what_the_paper_does_not_give_has_no_row():
    assert compare([Quantity("table1/of_our_own", 1.0)]).csv() == compare([]).csv()


def test_csv_and_markdown_have_the_same_verdicts():
    made = compare(
        [Quantity("touch/labels", 5), Quantity("table1/hdc_training_time", "not reached")]
    )
    found = [line["verdict"] for line in csv.DictReader(made.csv().splitlines())]
    assert {"missing", "setting, same", "not reached"} == set(found)
    lines = [line for line in made.markdown().splitlines() if line.startswith("|")][2:]
    assert [line.split(" | ")[1] for line in lines] == found
