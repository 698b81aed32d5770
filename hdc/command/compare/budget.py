"""How long a comparison may take, and how long it is going to take."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from hdc.command.compare.frames import FrameBank
from hdc.selection import Frames, Method

CHOOSING = 0.6
"""Share of the budget after which no further method is tried; tests take the rest."""
TRIAL = 60
"""Frames of the timed trial."""


class Budget:
    """The time that a comparison may take, from now on.

    Args:
        minutes: None is without end.
        clock: gives seconds.
    """

    def __init__(
        self, minutes: float | None, clock: Callable[[], float] = time.monotonic
    ) -> None:
        self.seconds = None if minutes is None else 60 * minutes
        self.clock = clock
        self.start = clock()

    def is_spent(self, share: float = 1.0) -> bool:
        """Whether a share of the time has gone by."""
        if self.seconds is None:
            return False
        return self.clock() - self.start >= share * self.seconds


class Growth(NamedTuple):
    """Seconds that grow as a·n + b·n² with the number of frames n."""

    linear: float
    quadratic: float

    @classmethod
    def through(cls, n: int, half: float, whole: float) -> Growth:
        """Through the seconds for n/2 and for n frames; no part is below zero."""
        quadratic = min(max(whole - 2 * half, 0) * 2, whole) / n**2
        return cls(whole / n - quadratic * n, quadratic)

    def at(self, n: int) -> float:
        return self.linear * n + self.quadratic * n**2


def estimate(
    frames: Frames, train: np.ndarray, method: Method, first: int, later: int
) -> float:
    """Seconds that calls of a method like this one take, by two small trials.

    Args:
        frames: all frames.
        train: indices of those to try on.
        method: a usual one, which refuses no frames.
        first: calls that also have to make what later calls share, such as hypervectors.
        later: all other calls.
    """
    n = min(TRIAL, len(train)) // 2 * 2
    if n < 4:
        return 0.0
    by_class = train[np.argsort(frames.labels[train], kind="stable")]
    whole, half = (
        by_class[np.linspace(0, len(train) - 1, size).astype(int)]
        for size in (n, n // 2)
    )
    _trial(frames, method, half)  # compiles, imports
    seconds = _trial(frames, method, half), _trial(frames, method, whole)
    total = len(frames.bank)
    once, again = (Growth.through(n, *pair) for pair in zip(*seconds, strict=True))
    return first * once.at(total) + (first + later) * again.at(total)


def _trial(frames: Frames, method: Method, rows: np.ndarray) -> Sequence[float]:
    """Seconds of what later calls share, and of such a call, with these frames."""
    images = frames.bank.frames[rows].numpy()
    bank = FrameBank(images, frames.labels[rows], frames.bank.n_classes)
    values = None if frames.values is None else frames.values[rows]
    own = replace(frames, bank=bank, values=values)
    every = np.arange(len(rows))
    times = [time.perf_counter()]
    for _ in range(2):
        method.answers(own, every, every)
        times.append(time.perf_counter())
    first, later = np.diff(times).tolist()
    return max(first - later, 0), later


def in_words(seconds: float) -> str:
    """A time that is known roughly."""
    if seconds < 10:
        return "a few seconds"
    if seconds < 90:
        return f"{round(seconds, -1):.0f} seconds"
    return f"{max(2, round(seconds / 60))} minutes"
