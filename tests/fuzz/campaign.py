"""Damaged and hostile files, each read twice: ``python tests/fuzz/campaign.py NAME SEED CASES``.

Reading has to end in the result of the sound file, in another one (a flipped pixel is a pixel), or
in a ValueError that names the file. Whatever else happens ends the process with a code other than
0: an error with its traceback, a hang with that of every thread, a crash by itself; what was being
read stands on the last line of its output.
"""

from __future__ import annotations

import faulthandler
import functools
import itertools
import os
import resource
import sys
import tempfile
from pathlib import Path
from typing import Any

import fuzz_files
import fuzz_records
import hypothesis
from fuzz_bombs import BOMBS
from fuzz_damage import edited
from fuzz_files import Kind, write

from experiments.records.measurement import peak_bytes

KINDS = {kind.kind: kind for kind in (*fuzz_records.kinds(), *fuzz_files.kinds())}
LIMIT_S = 60
MOST_BYTES = 10**9  # of memory, with the libraries
# Address space is not memory: a thread reserves some 70 MB that it never touches.
_ADDRESS_SPACE = 8 * MOST_BYTES


def damaged(kind: Kind) -> Any:
    """Strategy for the bytes of a file of this kind."""
    edits = edited(kind.make()).map(lambda data: _mended(kind, data))
    return edits | kind.replace(kind.make()) if kind.replace else edits


def read_case(kind: Kind, data: bytes) -> str:
    """Read a file: ``"correct"``, ``"changed"`` or ``"named"``.

    Raises:
        RuntimeError: if two readings differ, or an error does not name the file.
        Exception: whatever reading raises but a ValueError.
    """
    with tempfile.TemporaryDirectory() as name:
        write({**kind.around(), kind.name: data}, Path(name))
        try:
            first, second = kind.read(Path(name)), kind.read(Path(name))
        except ValueError as error:
            if name in str(error):
                return "named"
            raise RuntimeError("an error that names no file") from error
    if first != second:
        raise RuntimeError("differs when read again")
    return "correct" if first == _sound(kind.kind) else "changed"


@functools.cache
def _sound(name: str) -> str:
    kind = KINDS[name]
    with tempfile.TemporaryDirectory() as folder:
        write({**kind.around(), kind.name: _mended(kind, kind.make())}, Path(folder))
        return kind.read(Path(folder))


def _mended(kind: Kind, data: bytes) -> bytes:
    return kind.mend(data) if kind.mend else data


def bomb(name: str) -> str:
    """Read a small file that asks for much: a result, or a ValueError that names it."""
    files, read = BOMBS[name]
    with tempfile.TemporaryDirectory() as folder:
        write(files(), Path(folder))
        return read(Path(folder))


def main(name: str, seed: int, cases: int) -> None:
    """So many damaged files of a kind, or one bomb."""
    resource.setrlimit(resource.RLIMIT_AS, (_ADDRESS_SPACE, _ADDRESS_SPACE))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    complaints = os.dup(2)
    os.dup2(os.open(os.devnull, os.O_WRONLY), 2)  # decoders complain there in thousands of lines
    sys.stderr = os.fdopen(complaints, "w")
    if name in BOMBS:
        faulthandler.dump_traceback_later(LIMIT_S, exit=True, file=sys.stderr)
        try:
            bomb(name)
        except ValueError as error:
            print("refused:", str(error)[:200])
    else:
        numbers = itertools.count()

        @hypothesis.seed(seed)
        @hypothesis.settings(max_examples=cases, deadline=None, database=None)
        @hypothesis.given(damaged(KINDS[name]))
        def attempt(data: bytes) -> None:
            print(name, next(numbers), flush=True)
            faulthandler.dump_traceback_later(LIMIT_S, exit=True, file=sys.stderr)
            read_case(KINDS[name], data)

        attempt()
    faulthandler.cancel_dump_traceback_later()
    if peak_bytes() > MOST_BYTES:
        raise MemoryError(f"expected at most {MOST_BYTES} bytes, found {peak_bytes()}")


if __name__ == "__main__":
    main(sys.argv[1], int(sys.argv[2]), int(sys.argv[3]))
