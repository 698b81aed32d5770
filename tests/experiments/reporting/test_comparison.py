"""Published numbers beside ours: the verdict's rule, and what a row says."""

import csv
import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from experiments.records.configs import CONFIGS
from experiments.reporting import published
from experiments.reporting.comparison import compare, verdict
from experiments.reporting.published import Published
from experiments.reporting.study import Quantity
from experiments.reporting.table import records


def paper(value=90.0, low=None, high=None, calibration="", name="touch/some"):
    return Published(name, value, "%", low, high, calibration)


def ours(value, low=None, high=None):
    return Quantity("touch/some", value, low, high)


@pytest.mark.parametrize(
    ("known", "found", "expected"),
    [
        (paper(), None, "missing"),
        (paper(calibration="fitted"), None, "missing"),
        (paper(name="touch/labels"), None, "missing"),
        (paper(name="touch/labels"), ours(90.0), "setting, same"),
        (paper(name="touch/labels"), ours(91.0), "setting, another"),
        (paper(name="touch/labels"), ours("mixed"), "setting, another"),
        (paper(), ours("not reached in 5 s"), "not reached"),
        (paper(), ours(90.0), "no interval"),
        (paper(), ours(90.0, low=80.0), "no interval"),
        (paper(calibration="fitted"), ours(90.0), "fitted, no interval"),
        (paper(), ours(88.0, 85.0, 91.0), "matches"),
        (paper(), ours(88.0, 85.0, 89.0), "differs"),
        (paper(calibration="fitted"), ours(88.0, 85.0, 91.0), "fitted"),
        (paper(calibration="fitted"), ours(88.0, 85.0, 89.0), "fitted, differs"),
        (paper(calibration="watched"), ours(88.0, 85.0, 91.0), "watched, matches"),
        # Both have an interval: √(1² + 1.5²) = 1.8.
        (paper(low=88.5, high=99.0), ours(88.3, 85.0, 89.3), "matches"),
        (paper(low=88.5, high=99.0), ours(88.1, 85.0, 89.1), "differs"),
        (paper(low=50.0, high=91.5), ours(91.7, 90.7, 99.0), "matches"),
        (paper(low=50.0, high=91.5), ours(91.9, 90.9, 99.0), "differs"),
    ],
)
def test_verdicts(known, found, expected):
    assert verdict(known, found) == expected


@given(st.floats(-1e3, 1e3), st.floats(-1e3, 1e3), st.floats(0, 10), st.floats(0, 10))
def test_against_an_exact_number_the_interval_itself_decides(value, known, below, above):
    low, high = value - below, value + above
    if not any(math.isclose(known, end, rel_tol=1e-9, abs_tol=1e-9) for end in (low, high)):
        inside = low <= known <= high
        assert verdict(paper(known), ours(value, low, high)) == ("matches" if inside else "differs")


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
    assert (row["measured"], row["ci_low"], row["ci_high"]) == (98, 95, 99.5)
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
