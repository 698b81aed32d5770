"""Own results beside the reference: equal, within its interval, outside; what is not compared."""

import pandas as pd
import pytest

from experiments.reporting.against import (
    EQUAL,
    OUTSIDE,
    WITHIN,
    compare,
    lines,
)
from experiments.reporting.table import Table


def a_table(value, low=0.8, high=0.9, column="x", key=("model",), **more):
    numbers = {column: value, f"{column}_low": low, f"{column}_high": high}
    return Table(
        "some", data=pd.DataFrame([{"model": "softmax", **numbers, **more}]), key=key
    )


@pytest.mark.parametrize(
    ("own", "verdict"),
    [
        (a_table(0.85), EQUAL),
        (a_table(0.81, None, None), WITHIN),
        (a_table(0.79, None, None), OUTSIDE),
        (a_table(0.79, 0.75, 0.81), WITHIN),  # the intervals meet
        (a_table(0.79, 0.75, 0.799), OUTSIDE),
        (a_table(0.95, 0.91, 0.99), OUTSIDE),
    ],
)
def test_a_number_is_outside_if_its_interval_is(own, verdict):
    assert [cell.verdict for cell in compare([own], [a_table(0.85)])] == [verdict]


def test_nothing_is_compared_without_a_key_in_seconds_or_after_another_stop():
    for more in ({"key": ()}, {"column": "training_time_s"}, {"column": "time"}):
        assert not compare([a_table(0.5, **more)], [a_table(0.85, **more)])
    stopped, trained = a_table(0.5, stop="reached"), a_table(0.85, stop="trained")
    assert not compare([stopped], [trained])
    assert len(compare([stopped], [stopped])) == 1
    # Until 90 % in training, another rule is the same.
    ratio = {"column": "training_time_over_hdc"}
    stopped, trained = (a_table(0.5, stop=stop, **ratio) for stop in ("a", "b"))
    assert len(compare([stopped], [trained])) == 1


def test_what_is_outside_is_a_sentence():
    ratio = {"column": "training_time_over_hdc", "seeds": 1}
    own = a_table(4.3, None, None, **ratio)
    cells = compare([own], [a_table(4.0, 3.9, 4.1, **ratio)])
    assert list(lines(cells)) == [
        "1 number of yours beside the reference: 0 equal, 0 within its interval, 1 outside",
        "some: Softmax took 4.3 times HDC's training time (reference: 3.9 to 4.1); one seed on a "
        "busy machine often differs that much.",
    ]


def test_the_terminal_names_the_first_and_counts_the_others():
    own = a_table(0.5, None, None)
    cells = compare([own], [a_table(0.85)]) * 7
    assert list(lines(cells))[-1] == "2 more on the page"
