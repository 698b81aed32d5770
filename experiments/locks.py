"""Locks that the kernel frees when their holder ends, however it ends (flock).

They hold among the processes of one machine on every local file system, and among machines where a
network file system is mounted with locks: NFS by default since Linux 2.6.12, Lustre with ``flock``.
Mounted with ``nolock`` or ``local_lock``, a lock holds on its own machine only; without any locks,
taking one is an error.
"""

from __future__ import annotations

import fcntl
import os
import platform
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO

FILE = ".lock"  # in the folder that it guards


class Held(Exception):
    """Another process has the lock.

    Args:
        what: of it is guarded.
        holder: who has it.
    """

    def __init__(self, what: str, holder: str):
        super().__init__(f"{what}: being run by another process ({holder})")
        self.what = what


@contextmanager
def held(path: Path, what: str | None = None) -> Iterator[None]:
    """Have a lock file to oneself; it is gone afterwards, and harmless where a kill leaves it.

    Args:
        path: of the lock file; its folder is made.
        what: it guards, for the message; the name of its folder if not given.

    Raises:
        Held: at once, if another process has it.
        OSError: if it cannot be made, or the file system keeps no locks; it is named.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    while True:
        file = take(path)
        if file is None:
            raise Held(what or path.parent.name, _holder(path))
        try:
            if not _is_at(file, path):
                continue  # the last holder removed it while we opened it
            file.truncate(0)
            file.write(f"process {os.getpid()} on {platform.node()}".encode())
            file.flush()
            try:
                yield
            finally:
                path.unlink(missing_ok=True)  # while we hold it: nobody else can have this one
            return
        finally:
            release(file)


@contextmanager
def shared(path: Path, alone: Callable[[], None]) -> Iterator[None]:
    """Hold a lock together with others; `alone` is called first if nobody else holds it then."""
    path.parent.mkdir(parents=True, exist_ok=True)
    file = take(path)
    try:
        if file is None:
            file = path.open("a+b")
        else:
            alone()
        fcntl.flock(file, fcntl.LOCK_SH)
        yield
    finally:
        if file is not None:
            release(file)


def take(path: Path) -> IO[bytes] | None:
    """The lock file, open and locked, or None if another process's lock is in the way."""
    file = path.open("a+b")
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        file.close()
        return None
    except OSError as error:
        file.close()
        raise OSError(
            error.errno, f"{path}: expected a file system with locks, found {error.strerror}"
        ) from error
    return file


def release(file: IO[bytes]) -> None:
    """Give a lock back, also where a forked process still has the file open."""
    fcntl.flock(file, fcntl.LOCK_UN)
    file.close()


def _is_at(file: IO[bytes], path: Path) -> bool:
    try:
        return os.path.samestat(os.fstat(file.fileno()), path.stat())
    except FileNotFoundError:
        return False


def _holder(path: Path) -> str:
    try:
        return path.read_text() or "starting"
    except FileNotFoundError:
        return "just done"
