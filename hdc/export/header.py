"""The header, and its test program, by the templates in the folder ``c``."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from functools import cache

import jinja2
import numpy as np

from hdc.export.plan import Plan
from hdc.rejection import VERSION

MARK = "Made by hdc export"
"""Text near the beginning of the files of an export; no others are replaced."""
WIDTH = 88
"""Characters of a line of C."""


def header(plan: Plan, file: str, origin: str) -> str:
    """The text of the header.

    Args:
        plan: what it is made of.
        file: its name.
        origin: where the model is from, in words.
    """
    return filled("model.h.j2", plan, file=file, origin=origin)


def filled(template: str, plan: Plan, **words: object) -> str:
    """A template with a plan and other words filled in."""
    return (
        _templates()
        .get_template(template)
        .render(
            vars(plan),
            plan=plan,
            N=plan.name.upper(),
            mark=MARK,
            rejection=VERSION,
            **words,
        )
    )


@cache
def _templates() -> jinja2.Environment:
    made = jinja2.Environment(
        loader=jinja2.PackageLoader("hdc.export", "c"),
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
        undefined=jinja2.StrictUndefined,
    )
    made.filters |= {
        "aligned": aligned,
        "nested": nested,
        "paragraph": paragraph,
        "quoted": quoted,
        "rows": rows_of,
    }
    return made


# Filters of the templates ------------------------------------------------------------------------


def paragraph(text: str, start: str = " *") -> str:
    """Lines of a comment, with text that ends none and begins none."""
    printable = "".join(c if c.isprintable() else "?" for c in " ".join(text.split()))
    safe = printable.replace("*/", "* /").replace("/*", "/ *")
    return textwrap.fill(
        safe,
        WIDTH,
        initial_indent=f"{start} ",
        subsequent_indent=" * ",
        break_long_words=False,
    )


def aligned(text: str, width: int = 0) -> str:
    """Lines of C before their comments, which a bar parts, with the comments below each other."""
    pairs = [line.split("|") for line in text.splitlines()]
    width = width or max(len(code) for code, _ in pairs)
    lines = [f"{code:<{width}} /* {meaning} */\n" for code, meaning in pairs]
    return "".join(lines)


def rows_of(numbers: Sequence[str], indent: int = 4) -> str:
    """Numbers, as many on a line as there is room for."""
    return textwrap.fill(
        ", ".join(numbers),
        WIDTH,
        initial_indent=" " * indent,
        subsequent_indent=" " * indent,
    )


def nested(table: np.ndarray, depth: int = 1) -> str:
    """Rows of a table between braces, as deep as it has axes."""
    if table.ndim > 1:
        blank = " " * (4 * depth)
        inner = [nested(part, depth + 1) for part in table]
        return ",\n".join(f"{blank}{{\n{text}\n{blank}}}" for text in inner)
    if table.dtype == np.uint64:
        numbers = [f"0x{word:016x}" for word in table.tolist()]
    else:
        numbers = [str(number) for number in table.tolist()]
    return rows_of(numbers, 4 * depth)


def quoted(text: str) -> str:
    """A string of C; other than plain characters as the octal numbers of their UTF-8 bytes."""
    characters = []
    for byte in text.encode():
        plain = 32 <= byte < 127 and chr(byte) not in '"\\?'
        characters.append(chr(byte) if plain else f"\\{byte:03o}")
    return f'"{"".join(characters)}"'
