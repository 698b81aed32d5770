"""Typed parts of a config: a wrong value is named by its key, before anything is built."""

from collections.abc import Mapping

import msgspec
import pytest

from experiments.protocol.settings import checked


@pytest.mark.parametrize(
    ("override", "message"),
    [
        ("seed.run=-1", r"seed\.run: Expected `int` >= 0"),
        ("data=null", r"data: Expected `object`, got `null`"),
        (
            "stop.most_steps=199",
            r"stop: .*most_steps: expected at least 200, found 199",
        ),
        ("+stop.colour=0", r"stop: .* unknown field `colour`"),
        ("~split.kind", r"split: .* missing required field `kind`"),
        ("exclusive=no", r"exclusive: Expected `bool`, got `str`"),
        ("device=cuda:7", r"device=cuda:7: "),
    ],
)
def test_a_wrong_value_is_named_by_its_key(carry_out, override, message):
    with pytest.raises(ValueError, match=f"^{message}"):
        carry_out(override)


class Whole(msgspec.Struct):
    draws: dict[str, int] = {}
    sizes: list[int] = []
    parts: Mapping[str, int] | None = None


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"draws": {"b": "x"}}, r"task\.draws\[...\]: Expected `int`, got `str`"),
        ({"sizes": [5, "x"]}, r"task\.sizes\[1\]: Expected `int`, got `str`"),
        ({"parts": 5}, r"task\.parts: Expected `object \| null`, got `int`"),
        (5, "task: Expected `object`, got `int`"),
    ],
    ids=str,
)
def test_a_wrong_value_inside_a_mapping_or_a_list_is_named(values, message):
    with pytest.raises(ValueError, match=f"^{message}"):
        checked(values, Whole, "task")
