"""Typed parts of a config: a wrong value is named by its key."""

import msgspec
import pytest

from experiments.protocol.settings import checked


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
