"""Own results against the reference: equal, within the range, outside."""

import pandas as pd

from experiments.reporting.against import EQUAL, OUTSIDE, WITHIN, compare
from experiments.reporting.table import Table


def table(own, low=0.8, high=0.9, key=("model",), name="some", **more):
    row = {"model": "hdc", "x": own, "x_low": low, "x_high": high, **more}
    return Table(name, "", pd.DataFrame([row]), key=key)


def test_a_number_is_equal_within_or_outside():
    for own, verdict in ((0.85, EQUAL), (0.81, WITHIN), (0.79, OUTSIDE)):
        found = compare([table(own)], [table(0.85)])
        assert [cell.verdict for cell in found.cells] == [verdict]
    first, second = found.lines()
    assert first.endswith("1 cells: 0 equal, 0 within, 1 outside")
    assert second == "! some: hdc: X 0.790; reference 0.800 to 0.900"
    assert found.table().data.verdict.tolist() == [OUTSIDE]


def test_tables_without_a_key_and_the_same_cell_twice_do_not_count():
    assert not compare([table(0.85, key=())], [table(0.85)]).cells
    twice = [[table(x), table(x, name="other")] for x in (0.81, 0.85)]
    assert len(compare(*twice).cells) == 1


def test_trainings_that_ended_by_another_rule_and_seconds_are_not_compared():
    other = [table(0.85, stop="trained")]
    assert len(compare([table(0.5, stop="trained")], other).cells) == 1
    assert not compare([table(0.5, stop="reached")], other).cells
    times = {"total_time_s": 9.0, "total_time_s_low": 1.0, "total_time_s_high": 2.0}
    assert len(compare([table(0.85, **times)], [table(0.85, **times)]).cells) == 1
