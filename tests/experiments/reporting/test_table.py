"""A table says the same in CSV and Markdown, whatever a record quotes."""

import csv
import html
import io
import math
import re

import numpy as np
import pytest
from markdown_it import MarkdownIt

from experiments.reporting.columns import Column
from experiments.reporting.table import Table, frame, records
from experiments.reporting.text import number, percent, printable, two_digits

HOSTILE = [
    "</script><script>alert(1)</script> a | b, ends in a backslash \\",
    "`code` \\` *em* __strong__ ~~gone~~ # no head [a link](http://example.org) &lt;b&gt; & &amp;",
    "line\nbreak\r\nand\ttab\x85\u2028 \x1b[31mred\x1b]0;title\x07 \x00 \x9b \u202e \ufeff",
    "\\textbf{50% of {a_b} & #1} \\x ~ ^ $ \\end{tabular} \\\\",
    '=cmd|"/c calc"!A1, comma; "quote"',
]


def a_table(rows, **more):
    return Table("t", lambda lines: lines, of="runs", data=frame(rows), **more)


def cells_and_tags(markdown):
    """Texts of all cells of a table, and all tags, as a reader of Markdown shows them."""
    shown = MarkdownIt("gfm-like", {"linkify": False, "html": True}).render(markdown)
    cells = re.findall(r"<t[dh]\b[^>]*>(.*?)</t[dh]>", shown, re.DOTALL)
    texts = (html.unescape(cell.replace("<br>", " ")) for cell in cells)
    return [" ".join(text.split()) for text in texts], set(re.findall(r"<(\w+)", shown))


@pytest.mark.parametrize("text", HOSTILE)
def test_nothing_comes_of_what_a_record_quotes(text):
    rows = [{"name": name, "value": k} for k, name in enumerate((text, "next"))]
    table = a_table(rows)
    plain = printable(" ".join(text.split()))
    cells, tags = cells_and_tags(table.rows())
    assert cells == ["Name", "Value", plain, "0", "next", "1"]
    assert tags <= {"table", "thead", "tbody", "tr", "td", "th", "br"}
    first, second = csv.DictReader(io.StringIO(table.csv()))
    assert (first["name"], second["name"]) == (printable(text), "next")
    for form in (table.csv(), table.rows()):
        assert all(c.isprintable() or c == "\n" for c in form)


def test_csv_keeps_integers_exact_numbers_to_six_digits_and_nothing_empty():
    first = {"a": 2**53, "b": 1 / 3, "c": None}
    table = a_table([first, {"a": np.int64(1), "b": math.nan, "d": True}])
    assert table.csv() == "a,b,c,d\n9007199254740992,0.333333,,\n1,,,True\n"
    assert records(frame([{"a": math.nan, "b": 1}])) == [{"a": None, "b": 1}]


def test_bounds_stand_in_the_cell_of_their_value():
    rows = [{"test_accuracy": 0.98, "test_accuracy_low": 0.95, "test_accuracy_high": 1.0,
             "some_key": 0.123456}, {"test_accuracy": 0.5}]  # fmt: skip
    table = a_table(rows, columns={"some_key": Column("Own", percent)})
    assert table.heads == ["Test accuracy, %", "Own"]
    assert table.cells() == [["98 [95, 100]", "12.3"], ["50", "–"]]


@pytest.mark.parametrize(
    ("show", "value", "text"),
    [
        *((number, *each) for each in (
            (None, "–"), (0, "0"), (0.0439, "0.0439"), (441.3, "441"), (2e-5, "2.0e-05"),
            ("mixed", "mixed"), (math.inf, "∞"), (math.nan, "–"), (123_456, "1.2e+05"),
        )),
        *((two_digits, *each) for each in ((2236.1, "2200"), (0.0407, "0.041"), (99.6, "100"))),
        *((percent, *each) for each in ((-0.0004, "0"), (-0.004, "-0.4"), (None, "–"))),
    ],
)  # fmt: skip
def test_digits(show, value, text):
    assert show(value) == text
