"""Columns of a table of labels: which of them hold numbers."""

from __future__ import annotations

import pytest

from hdc.readers.columns import Columns


def columns_of(*texts: str) -> Columns:
    places = [f"row {k}" for k in range(len(texts))]
    return Columns(places, {"depth": list(texts)})


@pytest.mark.parametrize("texts", [("1", "2", "a", "b"), ("1", "", "a", "b")])
def test_a_column_of_which_half_are_numbers_is_text(texts):
    assert columns_of(*texts).numeric() == []


def test_a_column_of_which_more_are_numbers_has_them_all():
    assert columns_of("1", "2").numeric() == ["depth"]
    with pytest.raises(ValueError, match=r"row 2: .*'a'"):
        columns_of("1", "2", "a").numeric()
