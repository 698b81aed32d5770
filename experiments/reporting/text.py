"""Numbers and texts as cells show them, in plain text and Markdown."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np


def number(value: Any, digits: int = 3) -> str:
    """A number to that many significant digits, a text as it is, nothing as a dash."""
    if value is None:
        return "–"
    if isinstance(value, str | bool) or not isinstance(value, int | float | np.number):
        return str(value)
    value = value.item() if isinstance(value, np.number) else value
    if not np.isfinite(value):
        return "–" if np.isnan(value) else "∞"
    if isinstance(value, int) and abs(value) < 1e5:
        return str(value)
    if value and not 1e-3 <= abs(value) < 1e5:
        return f"{value:.{max(1, digits - 2)}e}"
    decimals = max(0, digits - 1 - int(np.floor(np.log10(abs(value))))) if value else 0
    return f"{value:.{decimals}f}"


def percent(value: float | None) -> str:
    """A fraction in percent, one decimal where it is not whole."""
    return "–" if value is None else f"{100 * value:.1f}".removesuffix(".0")


def points(difference: float | None) -> str:
    """A difference of two fractions in percentage points, with its sign; one decimal, or one digit
    of a difference that would round to zero."""
    if difference is None or difference != difference:
        return "–"
    value = 100 * difference
    if abs(value) < 1e-9:
        return "0"
    return (f"{value:+.1f}" if abs(value) >= 0.05 else f"{value:+.1g}").replace(
        "-", "−"
    )


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


def printable(text: str) -> str:
    """Text with its control characters shown, as Python would write them."""
    return "".join(c if c.isprintable() else ascii(c)[1:-1] for c in text)


def markdown_text(text: str) -> str:
    """Text in which Markdown finds no cell, tag, code or link."""
    # An underscore within a word is no markup.
    signs = r"([\\`*|~]|(?<=\])[(\[:]|(?<![^\W_])_|_(?![^\W_]))"
    text = re.sub(signs, r"\\\1", printable(" ".join(text.split())))
    return text.replace("&", "&amp;").replace("<", "&lt;")


_TEX = {
    "\\": r"\textbackslash{}", "&": r"\&", "%": r"\%", "$": r"\$", "#": r"\#", "_": r"\_",
    "{": r"\{", "}": r"\}", "~": r"\textasciitilde{}", "^": r"\textasciicircum{}",
    "×": r"$\times$", "≥": r"$\geq$", "≤": r"$\leq$", "−": "$-$", "±": r"$\pm$", "∞": r"$\infty$",
    "→": r"$\rightarrow$", "√": r"$\surd$", "Δ": r"$\Delta$", "λ": r"$\lambda$", "μ": r"$\mu$",
    "µ": r"$\mu$", "σ": r"$\sigma$", "π": r"$\pi$", "φ": r"$\varphi$",
}  # fmt: skip


def tex_text(text: str) -> str:
    """Text in which LaTeX finds no command; signs that its fonts lack are written as formulas."""
    return "".join(_TEX.get(sign, sign) for sign in printable(" ".join(text.split())))


CAPTURED, COMPUTED, SIMULATED = "captured", "computed", "simulated"


def kind_of(origin: str) -> str:
    """The kind of frames by their origin: ``captured`` by a camera, ``computed`` from measured
    matrices of a fibre, or ``simulated``."""
    return origin if origin in (COMPUTED, SIMULATED) else CAPTURED


def frames_of(rows: Iterable[Mapping[str, Any]]) -> str:
    """The kinds of the frames of some rows: ``simulated frames``, ``captured frames`` …"""
    kinds = sorted({kind_of(str(row["origin"])) for row in rows if row.get("origin")})
    words = {COMPUTED: "frames computed from measured matrices"}
    return " and ".join(words.get(kind, f"{kind} frames") for kind in kinds)
