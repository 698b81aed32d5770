"""Compiled kernels without a stall: compiled by a process of their own, loaded by a thread.

Compiling takes some ten seconds, once a machine and version; loading what was compiled most of a
second, once a process. A process that has encoded enough frames loads them while it goes on with
numpy, and uses them from the chunk of frames after. Where nothing was compiled yet, it starts
another Python that does so.
"""

from __future__ import annotations

import functools
import hashlib
import importlib.metadata
import importlib.util
import os
import platform
import subprocess
import sys
import tempfile
import threading
import time
from contextlib import suppress
from pathlib import Path

ENOUGH = 2**26
"""Pixels that a process encodes by numpy before it loads the kernels: a batch of large frames."""
AT_ONCE = 2**30
"""Pixels of one call that are worth waiting for them: they save as long as loading takes."""
AGAIN = 24 * 3600
"""Seconds until what was not compiled is tried again, by whichever process."""

_encoded = 0  # pixels
_loaded = threading.Event()
_compiler: subprocess.Popen[bytes] | None = None
"""Kept, so that one that has ended can be cleared away."""


def are_due(n_pixels: int) -> bool:
    """Whether a call that encodes so many pixels is to use the kernels, after all calls before."""
    global _encoded
    if _loaded.is_set():
        return True
    if importlib.util.find_spec("numba") is None:
        return False
    _encoded += n_pixels
    if _encoded < ENOUGH:
        return False
    if not _is_there(_mark()):
        _compile_in_background()
        return False
    if n_pixels > AT_ONCE:
        return _load()
    _load_in_background()
    return False


def say_loaded() -> None:
    """The kernels can be used; leave a mark that they were compiled, for the processes to come."""
    if not _loaded.is_set():
        _loaded.set()
        _leave(_mark())


def _leave(mark: Path) -> None:
    with suppress(OSError):
        mark.parent.mkdir(parents=True, exist_ok=True)
        mark.touch()


def _is_there(mark: Path) -> bool:
    """Whether a mark was left; not where nobody may look into its folder."""
    with suppress(OSError):
        return mark.exists()
    return False


@functools.cache
def _load_in_background() -> None:
    """Load the kernels in a thread, once a process."""
    # At the very end of a program no thread starts any more.
    with suppress(RuntimeError):
        threading.Thread(target=_load, name="hdc.ahead").start()


def _load() -> bool:
    """Load the kernels, in two steps: a program that has ended waits for one of them at most.

    Returns:
        Whether they can be used.
    """
    # A broken numba is no error where nobody asked for it: numpy goes on.
    with suppress(Exception):
        importlib.import_module("numba")
        if threading.main_thread().is_alive():
            importlib.import_module("hdc.compiled")
            say_loaded()
            return True
    return False


@functools.cache
def _mark() -> Path:
    """The file that says so: beside the kernels, or in the user's cache."""
    folder = Path(__file__).parent / "compiled"
    stamp = hashlib.sha256(importlib.metadata.version("numba").encode())
    # A folder may be shared between machines, and kernels are compiled for a processor.
    here = sys.version, platform.node(), os.environ.get("NUMBA_CACHE_DIR")
    stamp.update(repr(here).encode())
    for source in sorted(folder.glob("*.py")):
        status = source.stat()
        stamp.update(repr((source.name, status.st_mtime_ns, status.st_size)).encode())
    beside = folder / "__pycache__"
    if not os.access(beside if beside.exists() else folder, os.W_OK):
        beside = _home() / ".cache" / "speckle-hdc"
    return beside / f"compiled-{stamp.hexdigest()[:16]}"


def _home() -> Path:
    """The user's folder; that of temporary files for a user without one, as in containers."""
    with suppress(RuntimeError):
        return Path.home()
    return Path(tempfile.gettempdir())


def _compile_in_background() -> None:
    """Have another Python compile and keep the kernels, at low priority; once a day at most."""
    global _compiler
    if _compiler is not None:
        _compiler.poll()
        return
    if not sys.executable or getattr(sys, "frozen", False):
        return
    tried = _mark().with_suffix(".tried")
    with suppress(OSError):
        if time.time() - tried.stat().st_mtime < AGAIN:
            return
    _leave(tried)
    if not _is_there(tried):
        return  # nor could a mark be left that they were compiled
    folder = str(Path(__file__).parent.parent)
    paths = [folder, os.environ.get("PYTHONPATH", "")]
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, paths))}
    code = "import os; os.nice(10); from hdc import ahead; ahead._load()"
    with suppress(OSError):
        _compiler = subprocess.Popen(
            # -P: no module of the folder that the user happens to be in
            [sys.executable, "-P", "-c", code],
            env=environment,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            start_new_session=True,
        )
