"""Typed parts of a config, and the experiments that it names."""

import msgspec
import pytest

from experiments.protocol.settings import checked, named


@pytest.mark.parametrize(
    ("before", "today"),
    [
        ("stability.measure.stability", "limits.stability.measure.stability"),
        ("values.measure.coverage", "promises.values.measure.coverage"),
        ("times.measure.times_grid", "table1.times.measure.times_grid"),
    ],
)
def test_an_experiment_that_moved_since_version_2_is_named_where_it_is(before, today):
    with pytest.raises(ValueError, match=rf"expected experiments\.studies\.{today}, "):
        named({"_target_": f"experiments.studies.{before}"})
    assert callable(named({"_target_": f"experiments.studies.{today}"}))


class Limits(msgspec.Struct):
    draws: dict[str, int] = {}
    sizes: list[int] = []


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"draws": {"a": "x"}}, "task.draws: expected each value to be an integer"),
        ({"sizes": [5, "x"]}, "task.sizes: expected each value to be an integer"),
        ({"sizes": 5}, "task.sizes: expected a list, found 5"),
    ],
    ids=str,
)
def test_a_wrong_value_inside_a_mapping_or_a_list_is_named(values, message):
    with pytest.raises(ValueError, match=f"^{message}"):
        checked(values, Limits, "task")
