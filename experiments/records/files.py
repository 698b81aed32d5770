"""Where results lie, and files that are written whole or not at all."""

from __future__ import annotations

import os
import secrets
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
REFERENCE = ROOT / "results" / "reference"
"""The committed results; only ``make reference`` writes them."""


def results_dir() -> Path:
    """Folder of own results: $RESULTS_DIR, or results/mine of the checkout.

    Never the current directory, unless the variable says so.
    """
    own = os.environ.get("RESULTS_DIR")
    return Path(own).expanduser().resolve() if own else ROOT / "results" / "mine"


def write_atomically(path: Path, text: str) -> None:
    """Write a file whole or not at all: temporary file beside it, flush to disk, rename.

    Raises:
        OSError: naming the file; what was there before is untouched.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    temporary = path.with_name(f".{path.name}.{os.getpid()}.{secrets.token_hex(4)}")
    try:
        with temporary.open("x", encoding="utf-8", newline="") as file:
            file.write(text)
            file.flush()
            os.fsync(file.fileno())
        os.replace(temporary, path)
    except BaseException as error:
        temporary.unlink(missing_ok=True)
        if isinstance(error, OSError) and error.filename is None:  # a full disk
            raise OSError(error.errno, error.strerror, str(path)) from error
        raise


def remove_leftovers(folder: Path) -> None:
    """Remove temporary files that a kill left here; only while the folder's lock is held."""
    for path in folder.glob(".*.*.*"):
        path.unlink(missing_ok=True)
