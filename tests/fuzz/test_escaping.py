"""Names and errors from outside are shown as they are: in Markdown, LaTeX and on the terminal."""

from __future__ import annotations

import io
import json

import pytest
from rich.console import Console

from experiments import fuzz_records, run, table_text, tables
from experiments.summary import summarise

HOSTILE = (
    "x|y \\| `c` <img src=x> [a](javascript:b) *c* &amp; \n| row | \x1b[31m \\input{/etc/passwd} $"
)


@pytest.fixture
def rows():
    line = {
        "model": "hdc", "n_train": None, "pixels": None, "seeds": 0, "status": HOSTILE,
        "scene": HOSTILE, "cpu": HOSTILE, "threads": 2, "origin": "recorded",
        **tables.published_row("hdc"),
    }  # fmt: skip
    return [line]


def test_markdown(rows):
    text = table_text.to_markdown(rows, table_text.TABLE1_COLUMNS, "t")
    lines = text.splitlines()
    assert len(lines) == 7  # caption, head, rule, row, notes and what is between
    unescaped = [i for i, c in enumerate(lines[4]) if c == "|" and not _escaped(lines[4], i)]
    assert len(unescaped) == len(table_text.TABLE1_COLUMNS) + 1
    for what in ("<", "](", " `c`", " *c*", "&amp; |"):
        assert what not in text
    assert "&lt;img src=x>" in text


def _escaped(text: str, i: int) -> bool:
    """Whether an odd number of backslashes stands before it."""
    before = text[:i]
    return (len(before) - len(before.rstrip("\\"))) % 2 == 1


def test_what_tables_hold_already_is_left_as_it_is():
    for cell in ("100 [96.3, 100]", "0.5 (0.4…> 30)", "ok, plateau", "1.0e-6", "CNN, 1 layer"):
        assert table_text._markdown(cell) == cell


def test_latex(rows):
    text = table_text.to_latex(rows, table_text.TABLE1_COLUMNS, "t", "t")
    assert r"\input" not in text
    assert r"\textbackslash{}input\{/etc/passwd\} \$" in text
    assert "\x1b" not in text
    assert all(c.isprintable() or c == "\n" for c in text)


def shown(print_it):
    console = Console(file=io.StringIO(), width=200, highlight=False, force_terminal=False)
    print_it(console)
    return console.file.getvalue()


@pytest.mark.parametrize("name", ["[red]a[/red]", ":smile:", "a\\", "[/]"])
def test_class_names_on_the_terminal(name, tmp_path):
    entry = json.loads(fuzz_records.run_record())
    entry["scene"] |= {"classes": [name, "b"], "origin": name}
    text = shown(lambda console: summarise(console, entry, tmp_path))
    assert text.count(name) == 3  # origin, column and row
    assert "skipped" not in text


def test_skipped_frames_are_counted_on_the_terminal(tmp_path):
    entry = json.loads(fuzz_records.run_record())
    entry["scene"]["skipped"] = ["/f/[bold]1.png: expected", "/f/2.png: expected"]
    text = shown(lambda console: summarise(console, entry, tmp_path))
    assert "2 frames skipped, listed in the record; the first: /f/[bold]1.png: expected\n" in text


def test_errors_on_the_terminal(monkeypatch):
    text = shown(
        lambda console: (
            monkeypatch.setattr(run, "stderr", console),
            run._complain(ValueError("/a/[b]:smile:\x1b[31m\u202e.png: expected\nmore")),
        )
    )
    assert text == "error: /a/[b]:smile:\\x1b[31m\\u202e.png: expected\nmore\n"
