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
        cpu_s: processor time of this process in it, of all its threads.
    """

    def __init__(self, device: str = "cpu"):
        self.device = device
        self.seconds = self.cpu_s = 0.0
        self._started: tuple[float, float] | None = None

    @contextmanager
    def running(self) -> Iterator[None]:
        """Count the time inside."""
        synchronise(self.device)
        self._started = _now()
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
            self._started = _now()

    def _hold(self) -> None:
        synchronise(self.device)
        if self._started is not None:
            seconds, cpu_s = _now()
            self.seconds += seconds - self._started[0]
            self.cpu_s += cpu_s - self._started[1]
        self._started = None


def _now() -> tuple[float, float]:
    """Seconds of the clock on the wall and of the processor."""
    return time.perf_counter(), time.process_time()


def timed(call: Callable[[], object], device: str) -> float:
    """Seconds that one call takes."""
    clock = Clock(device)
    with clock.running():
        call()
    return clock.seconds
