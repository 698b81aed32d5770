"""Lines on the terminal, exactly as they are: names and messages are the user's."""

from __future__ import annotations

from rich.console import Console
from rich.text import Text


def say(console: Console, text: str, style: str = "") -> None:
    """Print a line in which no markup and no emoji code is read."""
    console.print(Text(printable(text), style), soft_wrap=True)


def printable(text: str) -> str:
    """Text with its control characters shown, as Python would write them."""
    shown = [sign if sign.isprintable() else ascii(sign)[1:-1] for sign in text]
    return "".join(shown)
