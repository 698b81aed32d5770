"""README, docs, docstrings and messages are understood the first time: no banned opening, no banned
word, few words."""

import ast
import inspect
import re
from pathlib import Path

import pytest

CHECKOUT = Path(__file__).resolve().parents[2]
README = CHECKOUT / "README.md"
PAGES = [
    README,
    CHECKOUT / "CONTRIBUTING.md",
    CHECKOUT / "CHANGELOG.md",
    *sorted((CHECKOUT / "docs").glob("*.md")),
]
OPENINGS = ("Of", "By", "As", "What")
COUNTED = "bit|byte|frame|number|folder|entry|level|row|line|second|seed"
UNIT = "pixel|class|frame|image|recording|claim|seed|sensor|threshold|row|study|scene"
# Banned word → what to write.
WORDS = {
    r"mended": "extended",
    r"rivals?": "baseline",
    r"at its optimum": "converged",
    r"re-zero\w*|zero(?:es|ed|ing)? (?:it|a model|the model)\b.*?again": "re-reference",
    r"looks on": "checkpoints",
    r"(?:in|of|by) turns": "interleaved repetitions",
    r"told": "given, known, or solved by",
    r"less (?:that|its|their|those)": "minus",
    r"over (?:that|those) of": "relative to",
    rf"(?:{COUNTED})s? an? (?:{UNIT})": "per",
    "may or may not": "the number",
    r"comes? as": "is",
    "decides? nothing": "has no effect on",
    "those of": "the noun again",
    # Without what it is next to, or as a noun.
    r"(?:a|an|the|its|of) beside|beside(?= *(?:[.,;:)]|$))": "next to, and, or with",
}


def prose(text):
    """Text without code, tables and comments."""
    text = re.sub(r"^(```+|\$\$).*?^\1", "", text, flags=re.DOTALL | re.MULTILINE)
    text = re.sub(r"<!--.*?-->", "", text, flags=re.DOTALL)
    text = re.sub(r"`[^`]*`", "`", text)
    kept = [line for line in text.splitlines() if not line.startswith(("|", "    "))]
    return re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", "\n".join(kept))


def sentences(text):
    """Sentences, heads and items; a colon ends none."""
    for part in re.split(r"\n\s*\n|\n(?=#|\s*[-*] |\s*\d+\. )", prose(text)):
        joined = " ".join(part.split())
        start = re.sub(r"^(?:#+|[-*]|\d+\.|!) *", "", joined).replace("*", "")
        yield from re.split(r"(?<=[.!?]) +(?=[A-Z“])", start)


def faults(text):
    """Each banned opening or word, with the sentence where it stands."""
    found = []
    for sentence in sentences(text):
        opening = re.match(r"\w+", sentence)
        if opening and opening[0] in OPENINGS:
            found.append(f"begins with {opening[0]!r}: {sentence}")
        for word, better in WORDS.items():
            if match := re.search(rf"\b(?:{word})\b", sentence, re.IGNORECASE):
                found.append(f"{match[0]!r}, write {better}: {sentence}")
    return found


def texts_of(source):
    """Docstrings and messages of a module: strings of three words or more."""
    tree = ast.parse(source)
    parts = {id(part) for node in ast.walk(tree) if isinstance(node, ast.JoinedStr)
             for part in node.values}  # fmt: skip
    for node in ast.walk(tree):
        if isinstance(node, ast.JoinedStr):
            found = [getattr(part, "value", "x") for part in node.values]
            text = "".join(part if isinstance(part, str) else "x" for part in found)
        elif isinstance(node, ast.Constant) and id(node) not in parts:
            text = node.value if isinstance(node.value, str) else ""
        else:
            continue
        if len(text.split()) >= 3:
            lines = inspect.cleandoc(text).splitlines()
            yield re.sub("``[^`]*``", "`x`", "\n".join(map(str.strip, lines)))


MODULES = sorted(
    path.relative_to(CHECKOUT).as_posix()
    for package in ("hdc", "baselines", "scenes", "experiments")
    for path in (CHECKOUT / package).rglob("*.py")
)


@pytest.mark.parametrize("module", MODULES)
def test_no_docstring_or_message_has_a_banned_opening_or_word(module):
    source = (CHECKOUT / module).read_text("utf-8")
    assert [fault for text in texts_of(source) for fault in faults(text)] == []


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_no_sentence_has_a_banned_opening_or_word(page):
    assert faults(page.read_text("utf-8")) == []


@pytest.mark.parametrize(
    ("text", "number"),
    [
        ("Fine here. Of these, two are left.", 1),
        ("- **By rules** that were fixed.\n", 1),
        ("## What varies\n", 1),
        ("one bit a pixel,\nas published", 1),
        ("The mended form is accuracy less that of softmax.", 2),
        ("Its [rival](page.md) wins.", 1),
        (
            "Write `accuracy_mended`.\n\n```shell\nBy told\n```\n\n    mended\n\n| rival |\n",
            0,
        ),
    ],
)
def test_a_banned_opening_or_word_is_found_in_prose(text, number):
    assert len(faults(text)) == number


def outside_tables(page):
    """The lines of a page that are no rows of a table."""
    lines = page.read_text("utf-8").splitlines()
    return [line for line in lines if not line.startswith("|")]


def words(page):
    text = re.sub(r"<!--.*?-->", "", "\n".join(outside_tables(page)))
    return sum(bool(re.search(r"\w", word)) for word in text.split())


def test_readme_is_short():
    assert len(outside_tables(README)) <= 70
    assert words(README) <= 850


def test_docs_are_eleven_pages_at_most_and_short():
    pages = sorted((CHECKOUT / "docs").glob("*.md"))
    assert len(pages) <= 11
    assert sum(map(words, pages)) <= 11_000
