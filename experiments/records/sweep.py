"""What the workers of a sweep tell the process that it was started from, through files.

A launcher's workers may be other processes, or on other machines; Hydra hands back the first of
their errors only, and nothing of a run that was left to another process. Each therefore leaves a
note in a folder of the sweep, which its name in the environment leads them to.
"""

from __future__ import annotations

import os
import platform
import shutil
import tempfile
from pathlib import Path

from experiments.records import files

_VARIABLE = "OPTICAL_HDC_SWEEP"
FAILED, LEFT = "failed", "left"


def begin() -> None:
    """Called by the process that was given the command line."""
    name = f"{platform.node()}-{os.getpid()}"
    os.environ[_VARIABLE] = str(files.results_dir() / "cache" / "hydra" / name)


def note(kind: str, text: str) -> bool:
    """Leave a note; False where there is no sweep to leave it for, or no way to."""
    if _VARIABLE not in os.environ:
        return False
    folder = Path(os.environ[_VARIABLE])
    try:
        folder.mkdir(parents=True, exist_ok=True)
        handle, temporary = tempfile.mkstemp(dir=folder)
        with os.fdopen(handle, "w", encoding="utf-8") as file:
            file.write(text)
        os.replace(temporary, f"{temporary}.{kind}")
    except OSError:
        return False
    return True


def notes(kind: str) -> list[str]:
    """The notes of a kind, in the order in which they were left."""
    folder = Path(os.environ.get(_VARIABLE, ""))
    files = sorted(folder.glob(f"*.{kind}"), key=lambda path: path.stat().st_mtime_ns)
    return [path.read_text(encoding="utf-8") for path in files]


def end() -> None:
    """Forget the notes."""
    shutil.rmtree(os.environ.pop(_VARIABLE), ignore_errors=True)
