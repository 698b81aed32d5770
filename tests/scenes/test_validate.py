"""One wording for a value that does not fit: the key, what was expected, what was found."""

import numpy as np
import pytest

from scenes.validate import require_integer, require_number


def test_values_in_range_pass():
    for value in (0, 3, np.int64(3), np.uint8(3)):
        require_integer("a.b", value, 0)
    for value in (0, 0.5, np.float32(1), np.int16(1)):
        require_number("a.b", value, 0, 1)
    require_number("a.b", 1e-300, 0, strict=True)


@pytest.mark.parametrize(
    ("check", "message"),
    [
        (lambda v: require_integer("a.b", v, 1), "a.b: expected an integer ≥ 1, found {}"),
        (lambda v: require_integer("a.b", v, 1, 9), "a.b: expected an integer in [1, 9], found {}"),
        (lambda v: require_number("a.b", v, 0, strict=True), "expected a finite number > 0, found"),
        (lambda v: require_number("a.b", v, 1, 5), "a finite number ≥ 1 and ≤ 5, found {}"),
    ],
)
@pytest.mark.parametrize("value", [0, -1, True, None, "3", float("nan"), float("inf"), [1]])
def test_other_values_are_named_with_what_was_expected(check, message, value):
    with pytest.raises(ValueError) as caught:  # noqa: PT011
        check(value)
    assert message.format(repr(value)) in str(caught.value)
