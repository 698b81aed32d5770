"""Compiled kernels without a stall: compiled ahead by a process of their own, loaded once they pay.

Compiling takes some ten seconds, once a machine and version; loading what was compiled half a
second, once a process. A process that has encoded enough frames loads them. Where nothing was
compiled yet, it starts another Python that does so and goes on with numpy meanwhile.
"""

from __future__ import annotations

import functools
import hashlib
import importlib.metadata
import importlib.util
import os
import subprocess
import sys
from contextlib import suppress
from pathlib import Path

ENOUGH = 2**26
"""Pixels that a process encodes by numpy before it loads the kernels: a batch of large frames."""
AT_ONCE = 2**30
"""Pixels of one call that are worth loading them at once: they save as long as loading takes."""

_encoded = 0  # pixels


def are_due(n_pixels: int) -> bool:
    """Whether a call that encodes so many pixels is to use the kernels, after all calls before."""
    global _encoded
    if "hdc.compiled" in sys.modules:
        return True
    if importlib.util.find_spec("numba") is None:
        return False
    pays = _encoded >= ENOUGH or n_pixels > AT_ONCE
    _encoded += n_pixels
    if not pays:
        return False
    if _mark().exists():
        return True
    _compile_in_background()
    return False


def say_compiled() -> None:
    """Leave a mark that the kernels of this version were compiled, for the processes to come."""
    mark = _mark()
    with suppress(OSError):
        mark.parent.mkdir(parents=True, exist_ok=True)
        mark.touch()


@functools.cache
def _mark() -> Path:
    """The file that says so: beside the kernels, or in the user's cache."""
    folder = Path(__file__).parent / "compiled"
    stamp = hashlib.sha256(importlib.metadata.version("numba").encode())
    stamp.update(repr((sys.version, os.environ.get("NUMBA_CACHE_DIR"))).encode())
    for source in sorted(folder.glob("*.py")):
        status = source.stat()
        stamp.update(repr((source.name, status.st_mtime_ns, status.st_size)).encode())
    beside = folder / "__pycache__"
    if not os.access(beside if beside.exists() else folder, os.W_OK):
        beside = Path.home() / ".cache" / "speckle-hdc"
    return beside / f"compiled-{stamp.hexdigest()[:16]}"


@functools.cache
def _compile_in_background() -> None:
    """Have another Python compile and keep the kernels, at low priority; once a process."""
    if not sys.executable or getattr(sys, "frozen", False):
        return
    folder = str(Path(__file__).parent.parent)
    paths = [folder, os.environ.get("PYTHONPATH", "")]
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, paths))}
    with suppress(OSError):
        subprocess.Popen(
            [sys.executable, "-c", "import os; os.nice(10); import hdc.compiled"],
            env=environment,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            start_new_session=True,
        )
