"""One wording for a value that does not fit: the key, what was expected, what was found."""

import numpy as np
import pytest

from scenes.validate import require_integer, require_number


def test_values_in_range_pass():
    for value in (0, 3, np.int64(3), np.uint8(3)):
        require_integer("a.b", value, 0)
        require_number("a.b", value / 3, 0, 1)
    require_number("a.b", 1e-300, 0, strict=True)


@pytest.mark.parametrize("value", [0, -1, True, None, "3", float("nan"), float("inf"), [1]])
def test_other_values_are_named_with_what_was_expected(value):
    with pytest.raises(ValueError, match=r"a.b: expected an integer in \[1, 9\], found"):
        require_integer("a.b", value, 1, 9)
    with pytest.raises(ValueError, match=r"a.b: expected a finite number > 0 and ≤ 5, found"):
        require_number("a.b", value, 0, 5, strict=True)
