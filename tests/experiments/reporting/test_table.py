"""A table says the same in CSV, Markdown, LaTeX and HTML, whatever a record quotes."""

import csv
import io
import math
import re
from html.parser import HTMLParser

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from markdown_it import MarkdownIt

from experiments.reporting import table
from experiments.reporting.table import Table, beside, frame, interval, number, percent, size

HOSTILE = [
    "</script><script>alert(1)</script>",
    "<img src=x onerror=alert(2)>",
    "a | b",
    "ends in a backslash \\",
    "`code` \\` *em* __strong__ ~~gone~~ # no head",
    "[a link](http://example.org) ![x](y) [z]: http://example.org <http://example.org>",
    "&lt;b&gt; & &amp;",
    "- a list\n\n> a quote\n\n    a block\n---",
    "line\nbreak\r\nand\ttab\v\f\x85\u2028",
    "\x1b[31mred\x1b]0;title\x07 \x00 \x7f \x9b \u202e \ufeff",
    "\\textbf{50% of {a_b} & #1} \\x ~ ^ $ \\end{tabular} \\\\",
    "“quoted” “×” – … ∞ é ΔC 漢",
    '=cmd|"/c calc"!A1, comma; "quote"',
]


def a_table(cells, note=""):
    rows = [{"name": text, "value": k} for k, text in enumerate(cells)]
    columns = {"Name": lambda row: row["name"], "Value": lambda row: number(row["value"])}
    return Table("t", "A title", frame(rows), columns, note, key=("Name",))


class Cells(HTMLParser):
    """Text of every cell; every other tag."""

    def __init__(self, text):
        super().__init__()
        self.rows, self.other, self._open = [], [], False
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        if tag == "tr":
            self.rows.append([])
        elif tag in ("td", "th"):
            self.rows[-1].append("")
            self._open = True
        elif tag not in ("table", "thead", "tbody", "p", "strong"):
            self.other.append(tag)

    def handle_endtag(self, tag):
        self._open = self._open and tag not in ("td", "th")

    def handle_data(self, data):
        if self._open:
            self.rows[-1][-1] += data


def render(markdown):
    return MarkdownIt("gfm-like", {"linkify": False, "html": True}).render(markdown)


# What records quote -------------------------------------------------------------------------------


@pytest.mark.parametrize("text", HOSTILE)
def test_markdown_shows_what_is_quoted_and_nothing_comes_of_it(text):
    made = a_table([text, "next"], note=f"Note: {text}")
    shown = Cells(render(made.markdown()))
    plain = table.printable(" ".join(text.split()))
    assert shown.rows == [["Name", "Value"], [plain, "0"], ["next", "1"]]
    assert shown.other == []
    assert all(c.isprintable() or c == "\n" for c in made.markdown())


@pytest.mark.parametrize("text", HOSTILE)
def test_latex_is_balanced_whatever_is_quoted(text):
    made = a_table([text, "next"], note=text)
    code = made.latex()
    assert re.findall(r"\\begin\{(\S+?)\}", code) == re.findall(r"\\end\{(\S+?)\}", code)[::-1]
    bare = re.sub(r"\\[{}&%#$_]", "", code)
    assert bare.count("{") == bare.count("}")
    assert bare.count("$") % 2 == 0
    assert "%" not in bare.split("\n", 1)[1]
    body = bare[bare.index("\\midrule") : bare.index("\\bottomrule")].strip().splitlines()[1:]
    assert [line.count("&") for line in body] == [1, 1]
    assert all(line.endswith(r" \\") for line in body)
    assert set(re.findall(r"\\([a-z]+)", bare)) <= {
        "begin", "end", "centering", "scriptsize", "caption", "label", "toprule", "midrule",
        "bottomrule", "medskip", "raggedright", "shortstack", "textbackslash", "textasciitilde",
        "textasciicircum", "times", "infty", "usepackage",
    }  # fmt: skip
    assert all(c.isprintable() or c == "\n" for c in code)


@pytest.mark.parametrize("text", HOSTILE)
def test_csv_reads_back_and_holds_no_control_characters(text):
    code = a_table([text, "next"]).csv()
    assert all(c.isprintable() or c == "\n" for c in code)
    assert code.count("\n") == 3
    first, second = csv.DictReader(io.StringIO(code))
    assert first["name"] == "".join(c if c.isprintable() else ascii(c)[1:-1] for c in text)
    assert (first["value"], second["name"]) == ("0", "next")


@given(st.text(min_size=1, max_size=40))
def test_no_text_makes_another_row_or_column_of_markdown(text):
    _, shown, following = Cells(render(a_table([text, "next"]).markdown())).rows
    assert (len(shown), following) == (2, ["next", "1"])


# Values -------------------------------------------------------------------------------------------


def test_csv_keeps_integers_exact_numbers_to_six_digits_and_nothing_empty():
    rows = [{"a": 2**53, "b": 1 / 3, "c": None}, {"a": np.int64(1), "b": math.nan, "d": True}]
    lines = list(csv.reader(io.StringIO(Table("t", "T", frame(rows)).csv())))
    assert lines == [
        ["a", "b", "c", "d"],
        ["9007199254740992", "0.333333", "", ""],
        ["1", "", "", "True"],
    ]


def test_without_columns_every_value_is_shown_rounded():
    made = Table("t", "T", frame([{"some_key": 0.123456, "n": 5}, {"n": None}]))
    assert (made.heads, made.cells()) == (["some key", "n"], [["0.1235", "5"], ["–", "–"]])


def test_a_table_without_rows_has_its_heads():
    made = Table("t", "T", frame([], ["a", "b"]))
    assert made.csv() == "a,b\n"
    assert made.cells() == []
    assert "| a | b |" in made.markdown()
    assert "\\midrule" in made.latex()


def test_records_are_the_rows_with_none_for_nan():
    assert table.records(frame([{"a": math.nan, "b": 1}, {"b": "x"}])) == [
        {"a": None, "b": 1},
        {"a": None, "b": "x"},
    ]


@pytest.mark.parametrize(
    ("value", "text"),
    [(None, "–"), (0, "0"), (0.0439, "0.0439"), (1.24, "1.24"), (441.3, "441"), (1574.0, "1574"),
     (2e-5, "2.0e-05"), ("mixed", "mixed"), (np.float64(0.5), "0.500"), (math.inf, "∞"),
     (math.nan, "–"), (99_999, "99999"), (123_456, "1.2e+05"), (-0.0123, "-0.0123"),
     (True, "True")],
)  # fmt: skip
def test_three_digits(value, text):
    assert number(value) == text


def test_percents_sizes_and_intervals():
    assert [percent(x) for x in (None, 0.992, 1.0, 0.25)] == ["–", "99.2", "100", "25"]
    sizes = [size(x) for x in (None, 80, 156_000, 20e6)]
    assert sizes == ["unknown", "80 B", "156 kB", "20.0 MB"]
    assert interval("1", "0", "2") == "1 [0, 2]"
    assert interval("1", "–", "2") == "1"


# Two sets of results ------------------------------------------------------------------------------


def test_each_value_stands_beside_its_other():
    def made(**times):
        rows = [{"model": model, "paper": "1", "time": t} for model, t in times.items()]
        columns = {"Model": lambda row: row["model"], "Paper": lambda row: row["paper"],
                   "Time": lambda row: number(row["time"])}  # fmt: skip
        return Table(
            "t", "T", frame(rows), columns, "How.", ["make"], key=("Model",), common=("Paper",)
        )

    both = beside(made(hdc=1, own=2), made(hdc=3, cnn=4))
    assert both.heads == ["Model", "Paper", "Time, reference", "Time, mine"]
    assert both.cells() == [
        ["hdc", "1", "3", "1"], ["cnn", "1", "4", "–"], ["own", "1", "–", "2"],
    ]  # fmt: skip
    assert (both.name, both.title, both.note, both.commands) == ("t", "T", "How.", ["make"])
    assert beside(made(), made(hdc=3)).cells() == [["hdc", "1", "3", "–"]]
