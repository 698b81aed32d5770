"""Published numbers beside ours: the rule of the verdict, the rows, and margins fixed before."""

import math

import pytest

from experiments.records.configs import CONFIGS
from experiments.reporting import published
from experiments.reporting.comparison import compare, verdict
from experiments.reporting.published import Published
from experiments.reporting.study import Quantity
from experiments.reporting.table import records

KNOWN = published.numbers()
SETTINGS = ("table1/learning_rate", "touch/labels")


def paper(value=90.0, name="touch/some", unit="%", margin=3.0, **more):
    return Published(name, value, unit, margin=margin, **more)


LABELS = paper(name="touch/labels")
FITTED, WATCHED = (paper(calibration=each) for each in ("fitted", "watched"))
RATIO = paper(100.0, unit="×", margin=2.0)  # ratios are off by factors


@pytest.mark.parametrize(
    ("known", "ours", "expected"),
    [
        (LABELS, (90.0,), "setting, same"),
        (paper(), ("not reached in 5 s",), "not reached"),
        (paper(not_comparable="machine"), (90.0, 89.0, 91.0), "not comparable"),
        (paper(), (90.0, 80.0), "no interval"),
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
    assert verdict(known, Quantity("touch/some", *ours)) == expected


def test_every_published_number_has_a_row_and_an_experiment_that_makes_it():
    measured = [Quantity(name, 1.0) for name in reversed(KNOWN)]
    rows = records(compare(measured))
    assert [f"{row['experiment']}/{row['quantity']}" for row in rows] == list(KNOWN)
    for experiment in {row["made_by"].partition(" experiment=")[2] for row in rows}:
        assert (CONFIGS / "experiment" / f"{experiment}.yaml").is_file(), experiment


def test_every_number_is_judged_within_a_margin_or_a_setting_or_says_why_not():
    """Margins are at most half of what the paper concludes from."""
    lead = KNOWN["table1/hdc_test_accuracy"].value
    lead -= KNOWN["table1/cnn1_test_accuracy"].value
    gain = KNOWN["correlation/contrast_prototype"].value
    gain -= KNOWN["correlation/contrast_speckle"].value
    for name, known in KNOWN.items():
        assert math.isfinite(known.value)
        kinds = (known.margin is not None, bool(known.not_comparable), name in SETTINGS)
        assert sum(kinds) == 1, name
        assert known.unit != "s" or known.not_comparable, name  # of another machine
        if known.margin is not None:
            half = {"%": lead / 2, "1": gain / 2, "samples": known.value / 2, "×": 2}
            assert 0 < known.margin <= half[known.unit], name
