"""The load of the machine while something is timed, and whether the times can be trusted.

Two measurements accompany a group of repetitions of a few seconds. The share of the processor time
that other processes took comes from the system's counters. It does not see a neighbour on the same
physical processor, so a fixed piece of work, the yardstick, is timed before and after as well.
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, TypeVar

import msgspec
import torch

T = TypeVar("T")
STAT = Path("/proc/stat")
NOT_MEASURED = "load not measured"
SIDE = 700
"""Side of the matrices whose product is the yardstick, about 20 ms on one core."""
_PARTS = 5  # yardsticks at a time, of which the least counts
_WARM_UP = 10


class Load(msgspec.Struct, frozen=True):
    """The load of the machine during a group of repetitions.

    Attributes:
        others: share of the machine's processor time that other processes took, with time stolen
            by other virtual machines; None where the system does not say.
        yardstick: seconds of the yardstick by threads, over the least of this process, the larger
            of before and after; at least 1.
    """

    others: float | None
    yardstick: dict[int, float]


class Limits(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """From where on a group counts as disturbed: ``disturbed`` of a config.

    Attributes:
        others: share of the processor time of the machine.
        yardstick: times the least of this process.
    """

    others: float
    yardstick: float

    def reason(self, load: Load) -> str:
        """Why a group with this load is disturbed; empty where it is not."""
        if load.others is None:
            return NOT_MEASURED
        if load.others > self.others:
            return f"others took {load.others:.0%} of the processor time"
        worst = max(load.yardstick.values())
        if worst > self.yardstick:
            return f"a fixed piece of work took {worst:.2f} times its least"
        return ""

    def columns(self, load: Load) -> dict[str, Any]:
        """The load and the reason as cells of a row."""
        yardsticks = {f"yardstick_{n}": times for n, times in load.yardstick.items()}
        return {"others": load.others, **yardsticks, "disturbed": self.reason(load)}


class Retries:
    """Measures again what was disturbed, within a budget for all that is measured.

    Args:
        most: how often one thing is measured again.
        budget_s: seconds that all of it may take in all.
    """

    def __init__(self, most: int, budget_s: float) -> None:
        self._most, self._left_s = most, budget_s

    def attempts(
        self,
        measure: Callable[[int], T],
        reason: Callable[[T], str],
        expected_s: float = 0.0,
    ) -> Iterator[T]:
        """The result of each attempt; the last one counts.

        A disturbed attempt is repeated if the budget has room for as long as it took.

        Args:
            measure: called with the number of the attempt, from 0.
            reason: why an attempt is disturbed; empty where it is not.
            expected_s: least that an attempt is expected to take.
        """
        for attempt in range(1 + self._most):
            start = time.perf_counter()
            made = measure(attempt)
            took = time.perf_counter() - start
            yield made
            if attempt:
                self._left_s -= took
            undisturbed = reason(made) in ("", NOT_MEASURED)
            if undisturbed or max(took, expected_s) > self._left_s:
                return


class Watch:
    """Watches the machine; one for all groups of a process.

    Args:
        threads: numbers of threads that the yardstick is timed with.
    """

    def __init__(self, threads: tuple[int, ...] = (1, 2)) -> None:
        cores = os.cpu_count() or 1
        self._threads = tuple(n for n in threads if n <= cores) or (1,)
        self._least: dict[int, float] = {}
        for _ in range(_WARM_UP):
            self._yardsticks()
        self.load = Load(None, {})

    @contextmanager
    def watching(self) -> Iterator[None]:
        """Measure the load of the machine during the block; it is in ``load`` afterwards."""
        before = self._yardsticks()
        counters, own, start = _counters(), _own_seconds(), time.perf_counter()
        yield
        elapsed = time.perf_counter() - start
        busy, used = _counters(), _own_seconds() - own
        after = self._yardsticks()
        others = None
        if counters is not None and busy is not None:
            share = (busy - counters - used) / (elapsed * (os.cpu_count() or 1))
            others = max(0.0, share)
        worst = {n: max(before[n], after[n]) / self._least[n] for n in self._threads}
        self.load = Load(others, worst)

    def _yardsticks(self) -> dict[int, float]:
        """Seconds by number of threads; the least of all is kept."""
        found = {}
        given = torch.get_num_threads()
        for n in self._threads:
            torch.set_num_threads(n)
            found[n] = min(_yardstick() for _ in range(_PARTS))
            self._least[n] = min(found[n], self._least.get(n, found[n]))
        torch.set_num_threads(given)
        return found


def _yardstick() -> float:
    ones = torch.ones((SIDE, SIDE), dtype=torch.float64)
    start = time.perf_counter()
    ones @ ones
    return time.perf_counter() - start


def _counters() -> float | None:
    """Seconds that the machine's processors were busy or stolen so far."""
    if not STAT.exists():
        return None
    fields = STAT.read_text().split("\n", 1)[0].split()[1:]
    user, nice, system, _, _, irq, soft, steal = map(int, fields[:8])
    ticks = user + nice + system + irq + soft + steal
    return ticks / os.sysconf("SC_CLK_TCK")


def _own_seconds() -> float:
    """Seconds of processor time of this process, its threads and the processes it waited for."""
    times = os.times()
    return times.user + times.system + times.children_user + times.children_system
