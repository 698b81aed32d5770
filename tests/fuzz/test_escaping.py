"""Names and errors from outside are shown as they are: in every form of a table."""

from __future__ import annotations

import pandas as pd
import pytest

from experiments.reporting.table import Table

HOSTILE = (
    "x|y \\| `c` <img src=x> [a](javascript:b) *c* &amp; \n"
    "| row | \x1b[31m \\input{/etc/passwd} $\\"
)


@pytest.fixture
def table():
    return Table("t", "Title", pd.DataFrame({"status": [HOSTILE, "ok"], "n": [1, 2]}))


def test_markdown(table):
    lines = [line for line in table.markdown().splitlines() if line.startswith("|")]
    assert len(lines) == 4  # head, rule and two rows
    for line in lines:
        bars = [i for i, c in enumerate(line) if c == "|" and not _escaped(line, i)]
        assert len(bars) == 3
    for what in ("<img", "](", " `c`", " *c*"):
        assert what not in lines[2]


def _escaped(text: str, i: int) -> bool:
    """Whether an odd number of backslashes stands before it."""
    before = text[:i]
    return (len(before) - len(before.rstrip("\\"))) % 2 == 1


def test_latex(table):
    text = table.latex()
    assert r"\input" not in text
    assert r"\textbackslash{}input\{/etc/passwd\} \$" in text
    assert all(c.isprintable() or c == "\n" for c in text)
