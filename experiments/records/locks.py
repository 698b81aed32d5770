"""Locks that the kernel frees when their holder ends, however it ends.

They hold among the processes of one machine on every local file system, and among machines where a
network file system is mounted with locks (NFS by default, Lustre with ``flock``).
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from filelock import FileLock, Timeout

LEFT = 75  # exit status of a command that left runs to another process (EX_TEMPFAIL)


class Held(Exception):
    """Another process has the lock."""


@contextmanager
def held(
    path: Path,
    what: str = "",
    timeout_s: float = 0,
) -> Iterator[None]:
    """Hold an exclusive lock; the empty file is left behind.

    Args:
        path: lock file; its folder is made.
        what: what it guards, for the message of :class:`Held`.
        timeout_s: how long to wait for another process; -1 for as long as it takes.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    lock = FileLock(path, timeout=timeout_s, fallback_to_soft=False)
    try:
        lock.acquire()
    except Timeout:
        raise Held(f"{what}: being run by another process") from None
    try:
        yield
    finally:
        lock.release()
