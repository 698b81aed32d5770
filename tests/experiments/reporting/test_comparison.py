"""Published numbers beside ours: the rule of the verdict, the rows, and margins fixed before."""

import csv
import math

import pytest

from experiments.reporting import published
from experiments.reporting.comparison import compare, verdict
from experiments.reporting.estimates import Estimate
from experiments.reporting.published import Published
from experiments.reporting.study import Quantity
from experiments.reporting.table import records

KNOWN = published.numbers()


def paper(value=90.0, unit="%", margin=3.0, **more):
    return Published(value, unit, margin, **more)


FITTED, WATCHED = (paper(calibration=each) for each in ("fitted", "watched"))
RATIO = paper(100.0, unit="×", margin=2.0)  # ratios are off by factors


@pytest.mark.parametrize(
    ("known", "ours", "expected"),
    [
        (paper(), (90.0,), "no interval"),
        (paper(), (88.0, 85.5, 90.5), "agrees"),
        # Outside the interval and within the margin: no more than a precise measurement.
        (paper(), (88.0, 87.0, 89.0), "agrees"),
        (paper(), (86.5, 85.5, 87.5), "differs"),
        # A wide interval agrees with nothing, and differs from what is outside.
        (paper(), (90.0, 86.5, 91.0), "uninformative"),
        # An interval that ends at 100 % is as wide as its other side.
        (paper(100.0), (99.9, 96.0, 100.0), "uninformative"),
        (FITTED, (80.0, 79.0, 81.0), "fitted, differs"),
        (WATCHED, (88.0, 85.5, 90.5), "watched, agrees"),
        (RATIO, (60.0, 40.0, 90.0), "agrees"),
        (RATIO, (40.0, 30.0, 60.0), "differs"),
        (RATIO, (60.0, 20.0, 180.0), "uninformative"),
    ],
)
def test_verdicts(known, ours, expected):
    if known.unit == "%":  # ours are fractions
        ours = [number / 100 for number in ours]
    quantity = Quantity("touch/some", Estimate(*ours), 100)
    assert verdict(known, quantity) == expected


def test_a_number_of_ours_stands_beside_the_papers_in_its_unit_and_order():
    names = ("drift/stored_accuracy", "table1/hdc_test_accuracy")
    quantities = [Quantity(name, Estimate(0.5, 0.4, 0.6), 100) for name in names]
    last, first = records(compare(quantities))[::-1]
    assert (first["quantity"], last["quantity"]) == names[::-1]
    assert (first["published"], first["measured"], first["measured_low"]) == (
        100,
        50,
        40,
    )


def test_every_number_is_judged_within_a_margin_or_says_why_not():
    """Margins are at most half of what the paper concludes from."""
    lead = KNOWN["table1/hdc_test_accuracy"].value
    lead -= KNOWN["table1/cnn1_test_accuracy"].value
    gain = KNOWN["correlation/contrast_prototype"].value
    gain -= KNOWN["correlation/contrast_speckle"].value
    with published.PATH.open(encoding="utf-8", newline="") as file:
        why_not = {
            f"{line['experiment']}/{line['quantity']}": line["not_comparable"]
            for line in csv.DictReader(file)
        }
    for name, known in KNOWN.items():
        assert math.isfinite(known.value)
        assert math.isnan(known.margin) == bool(why_not[name]), name
        assert known.unit != "s" or why_not[name], name  # of another machine
        if not math.isnan(known.margin):
            half = {"%": lead / 2, "1": gain / 2, "samples": known.value / 2, "×": 2}
            assert 0 < known.margin <= half[known.unit], name


def test_a_ratio_is_that_of_the_two_published_times():
    for model in published.models_of_table1()[1:]:
        time, hdc = (
            KNOWN[f"table1/{each}_training_time"].value for each in (model, "hdc")
        )
        assert KNOWN[f"table1/{model}_time_over_hdc"].value == time / hdc
