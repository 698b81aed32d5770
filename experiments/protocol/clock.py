"""The clock of a run: time inside the model counts, acquiring frames and testing do not."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import torch


def synchronise(device: str) -> None:
    """Wait until the device has finished its queue, so that a time covers all of it."""
    if device.startswith("cuda"):
        torch.cuda.synchronize(device)


class Clock:
    """A stopwatch that can be held while frames are acquired.

    Args:
        device: synchronised before and after each timed block.

    Attributes:
        seconds: time counted so far.
    """

    def __init__(self, device: str = "cpu"):
        self.device = device
        self.seconds = 0.0
        self._started: float | None = None

    @contextmanager
    def running(self) -> Iterator[None]:
        """Count the time inside."""
        synchronise(self.device)
        self._started = time.perf_counter()
        try:
            yield
        finally:
            self._hold()

    @contextmanager
    def held(self) -> Iterator[None]:
        """Do not count the time inside (acquiring frames); harmless when not running."""
        if self._started is None:
            yield
            return
        self._hold()
        try:
            yield
        finally:
            self._started = time.perf_counter()

    def _hold(self) -> None:
        synchronise(self.device)
        if self._started is not None:
            self.seconds += time.perf_counter() - self._started
        self._started = None


def timed(call: Callable[[], object], device: str = "cpu") -> float:
    """Seconds that one call takes."""
    clock = Clock(device)
    with clock.running():
        call()
    return clock.seconds
