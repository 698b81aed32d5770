"""What several tests do: wait for another process, and forget what a module remembers."""

from __future__ import annotations

import time


def until(condition):
    """Wait for what another process or thread does."""
    limit = time.monotonic() + 60
    while not condition():
        assert time.monotonic() < limit
        time.sleep(0.01)


def forget(module):
    """What the functions of a module looked up once."""
    for function in vars(module).values():
        if hasattr(function, "cache_clear"):
            function.cache_clear()
