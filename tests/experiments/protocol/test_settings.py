"""Typed parts of a config: a wrong value is named by its key, before anything is built."""

import pytest


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
