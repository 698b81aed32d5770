"""The command ``hdc``: train, evaluate, ask and adapt a model without writing Python.

docs/tutorial.md shows each command, and docs/api.md what a recording may be. Nothing is written
but the file named by ``-o``.

It exits with 0; with 1 after an error in a file, in one line that names the file, what was expected
and what was found; or with 2 if the command line is not as ``--help`` says.
"""

from __future__ import annotations

import io
import os
import re
import sys
import warnings
from collections.abc import Callable, Sequence
from typing import Any

from hdc.readers.files import LIBRARIES

EXTRAS = {
    "sklearn": "compare",
    **dict.fromkeys(("nicegui", "fastapi", "starlette", "socketio", "uvicorn"), "live"),
    **LIBRARIES,
}
"""Packages and the extra of this distribution that brings them; ``command`` brings the others."""


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command with these words after its name (default: those typed) and exit."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            # A file may have a name that is no text.
            stream.reconfigure(errors="backslashreplace")
    with warnings.catch_warnings():
        warnings.showwarning = _once()
        sys.exit(_status(arguments))


def _status(arguments: Sequence[str] | None) -> int:
    try:
        return _run(arguments)
    except ModuleNotFoundError as error:
        package = (error.name or "").partition(".")[0]
        if package == "hdc":
            raise
        install = f"pip install 'speckle-hdc[{EXTRAS.get(package, 'command')}]'"
        return _say(f"error: expected the package {package}, found none; {install}", 1)
    except BrokenPipeError:  # the reader of the output has seen enough
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, sys.stdout.fileno())
        return 1
    except (ValueError, OSError) as error:
        return _say(f"error: {error}", 1)
    except MemoryError as error:
        advice = "--crop and --subsample make frames smaller"
        return _say(f"error: expected more memory: {error} ({advice})", 1)


def _run(arguments: Sequence[str] | None) -> int:
    import click

    from hdc.command.cli import cli
    from hdc.command.options import LEFT

    try:
        status = cli.main(arguments, prog_name="hdc", standalone_mode=False) or 0
        if sys.stdout:  # closed by the caller: none
            sys.stdout.flush()
        return status
    except click.exceptions.NoArgsIsHelpError as error:
        error.show()
        return error.exit_code
    except click.Abort:
        return _say("interrupted", 130)
    except click.NoSuchOption as error:
        command = error.ctx.info_name if error.ctx else ""
        instead = LEFT.get(f"{command} {error.option_name}")
        why = f"{error.option_name}: this option left; {instead}"
        said = why if instead else error.format_message()
        return _say(f"error: {said}", error.exit_code)
    except click.ClickException as error:
        return _say(f"error: {error.format_message()}", error.exit_code)


def _say(text: str, status: int) -> int:
    print(printable(" ".join(text.splitlines())), file=sys.stderr)
    return status


def printable(text: str) -> str:
    """A text without the codes that a terminal obeys, which the name of a file may hold: tabs, line
    feeds and the like are written as escapes."""
    return "".join(c if c.isprintable() else repr(c)[1:-1] for c in text)


def _once() -> Callable[..., None]:
    """Says a warning in one line, once: not again with another share, fold after fold."""
    before: set[str] = set()

    def say(message: Warning | str, *_: Any, **__: Any) -> None:
        but_for_shares = re.sub(r"\d+ %", "", str(message))
        if but_for_shares not in before:
            before.add(but_for_shares)
            _say(f"warning: {message}", 0)

    return say
