"""Numbers and texts as cells show them, in plain text and Markdown."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from experiments.records.console import printable


def number(value: Any, digits: int = 3) -> str:
    """A number to that many significant digits, a text as it is, nothing as a dash."""
    if value is None:
        return "–"
    if isinstance(value, np.number):
        value = value.item()
    if isinstance(value, bool) or not isinstance(value, int | float):
        return str(value)
    if not np.isfinite(value):
        return "–" if np.isnan(value) else "∞"
    if isinstance(value, int) and abs(value) < 1e5:
        return str(value)
    return _significant(value, digits)


def _significant(value: float, digits: int) -> str:
    size = abs(value)
    if size == 0:
        return f"{value:.0f}"
    if not 1e-3 <= size < 1e5:
        return f"{value:.{max(1, digits - 2)}e}"
    before_point = 1 + int(np.floor(np.log10(size)))
    return f"{value:.{max(0, digits - before_point)}f}"


def two_digits(value: Any) -> str:
    """A number to two significant digits: 2236 as 2200; a text as it is."""
    if isinstance(value, int | float) and np.isfinite(value):
        return number(float(f"{value:.2g}"), 2)
    return number(value)


def percent(value: float | None) -> str:
    """A fraction in percent, one decimal where it is not whole."""
    if value is None:
        return "–"
    text = f"{100 * value:.1f}".removesuffix(".0")
    return "0" if text == "-0" else text


def points(difference: float | None) -> str:
    """A difference of two fractions in percentage points, with its sign; one decimal, or one digit
    of a difference that would round to zero."""
    if difference is None or difference != difference:
        return "–"
    value = 100 * difference
    if abs(value) < 1e-9:
        return "0"
    text = f"{value:+.1f}" if abs(value) >= 0.05 else f"{value:+.1g}"
    return text.replace("-", "−")


def interval(
    value: str,
    low: str,
    high: str,
) -> str:
    """``value [low, high]``; the value alone where the bounds are unknown."""
    return value if "–" in (value, low, high) else f"{value} [{low}, {high}]"


def size(value: Any) -> str:
    """Bytes in B, kB or MB; a text as it is."""
    if value is None or isinstance(value, str):
        return value or "unknown"
    if value < 1e3:
        return f"{value} B"
    return f"{number(value / 1e3)} kB" if value < 1e6 else f"{number(value / 1e6)} MB"


def counted(count: int, name: str) -> str:
    """``1 thread``, ``2 threads``: so many of what takes an s."""
    return f"{count} {name}" if count == 1 else f"{count} {name}s"


def one_line(text: str) -> str:
    """Text without line feeds and control characters."""
    return printable(" ".join(text.split()))


def markdown_text(text: str) -> str:
    """Text in which Markdown finds no cell, tag, code or link."""
    # An underscore within a word is no markup.
    signs = r"([\\`*|~]|(?<=\])[(\[:]|(?<![^\W_])_|_(?![^\W_]))"
    text = re.sub(signs, r"\\\1", one_line(text))
    return text.replace("&", "&amp;").replace("<", "&lt;")


def markdown_table(heads: Sequence[str], *rows: Sequence[str]) -> str:
    """A table in Markdown, of texts as they are."""
    lines = (heads, ["---"] * len(heads), *rows)
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


# Signs that the fonts of LaTeX lack.
TEX = str.maketrans({
    "×": r"$\times$", "≥": r"$\geq$", "≤": r"$\leq$", "−": "$-$", "±": r"$\pm$", "∞": r"$\infty$",
    "→": r"$\rightarrow$", "√": r"$\surd$", "Δ": r"$\Delta$", "λ": r"$\lambda$", "μ": r"$\mu$",
    "µ": r"$\mu$", "σ": r"$\sigma$", "π": r"$\pi$", "φ": r"$\varphi$",
})  # fmt: skip


CAPTURED, COMPUTED, SIMULATED = "captured", "computed", "simulated"


def kind_of(origin: str) -> str:
    """The kind of frames by their origin: ``captured`` by a camera, ``computed`` from measured
    matrices of a fibre, or ``simulated``."""
    return origin if origin in (COMPUTED, SIMULATED) else CAPTURED


_SPLITS = {
    "random": "random split",
    "ordered": "split by time",
    "session": "split by session",
    "leave_group_out": "one group of each class tests",
}


def split_name(split: Mapping[str, Any]) -> str:
    """A split of a config in words: ``random split, 20 % test``; nothing where it is unknown."""
    kind = split.get("kind")
    if not isinstance(kind, str):
        return ""
    name = _SPLITS.get(kind, f"split by {split.get('group')}")
    if kind in ("session", "leave_group_out"):  # no share of the frames tests
        return name
    return f"{name}, {100 * split['test_fraction']:.0f} % test"


def frames_of(origins: Iterable[str]) -> str:
    """The kinds of frames by their origins: ``simulated frames``, ``captured frames`` …"""
    kinds = sorted(set(map(kind_of, origins)))
    words = {COMPUTED: "frames computed from measured matrices"}
    return " and ".join(words.get(kind, f"{kind} frames") for kind in kinds)
