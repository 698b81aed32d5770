"""Typed parts of a config: a wrong value is named by its key, before anything is built."""

import re
from collections.abc import Mapping

import msgspec
import pytest

from experiments.protocol.settings import checked


@pytest.mark.parametrize(
    ("override", "message"),
    [
        ("seed.run=-1", r"seed\.run: expected an integer >= 0, found -1"),
        (
            "split.test_fraction=nan",
            r"split\.test_fraction: expected a number in \(0, 1\)",
        ),
        ("stop.loss=nan", r"stop\.loss: expected a number >= 0\.0, found nan"),
        ("data=null", r"data: expected a mapping, found null"),
        ("stop.reached_after_s=-1", r"stop\.reached_after_s: expected .*, found -1"),
        ("stop.most_steps=199", r"stop\.most_steps: expected at least 200, found 199"),
        ("+stop.colour=0", r"stop\.colour: expected no such key"),
        ("exclusive=no", r"exclusive: expected true or false, found 'no'"),
        ("split.n_train=x", r"split\.n_train: expected an integer or null, found 'x'"),
        ("device=cuda:7", r"device: expected cpu, or one of .*, found 'cuda:7'"),
    ],
)
def test_a_wrong_value_is_named_by_its_key(carry_out, override, message):
    with pytest.raises(ValueError, match=f"^{message}"):
        carry_out(override)


class Part(msgspec.Struct, forbid_unknown_fields=True):
    draws: int = 1


class Whole(msgspec.Struct):
    draws: dict[str, int] = {}
    sizes: list[int] = []
    parts: Mapping[str, Part] | None = None


@pytest.mark.parametrize(
    ("values", "message"),
    [
        (
            {"draws": {"a": 1, "b": "x"}},
            "task.draws.*: expected an integer, found {'a': 1, 'b': 'x'}",
        ),
        ({"parts": {"a": {"n": 1}}}, "task.parts.*.n: expected no such key"),
        (
            {"parts": {"a": {}, "b": 1}},
            "task.parts.*: expected a mapping, found {'a': {}, 'b': 1}",
        ),
        ({"sizes": [5, "x"]}, "task.sizes.1: expected an integer, found"),
        ({"sizes": 5}, "task.sizes: expected a list, found 5"),
    ],
    ids=str,
)
def test_a_wrong_value_inside_a_mapping_or_a_list_is_named(values, message):
    with pytest.raises(ValueError, match=f"^{re.escape(message)}"):
        checked(values, Whole, "task")
