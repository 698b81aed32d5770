"""The cores that a run is timed on, held by it alone: one lock a core of this machine.

A run waits until as many cores as it has threads are free, so that workers of any launcher, sweeps
started at once and runs of other checkouts never share a core while a clock runs: too many workers
cost patience, not truth. The locks lie in the machine's temporary folder, whatever the results lie
on, and bind one user's runs; programs that know nothing of them are not kept away.
"""

from __future__ import annotations

import os
import random
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

from experiments import locks

_POLL_S = 0.2


def available() -> list[int]:
    """Numbers of the cores that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return sorted(os.sched_getaffinity(0))
    return list(range(os.cpu_count() or 1))


@contextmanager
def held(n: int, device: str, waiting: Callable[[], None]) -> Iterator[None]:
    """Hold n cores, or all there are if those are fewer, and the GPU that is computed on.

    Args:
        n: of cores.
        device: as torch names it.
        waiting: called once if they are not free at once.
    """
    wanted = [f"core-{core}" for core in available()]
    gpus = [_gpu(device)] if device.startswith("cuda") else []
    told = False
    while True:
        with ExitStack() as stack:
            if all(_taken(stack, gpu) for gpu in gpus) and _some(stack, wanted, n):
                yield
                return
        # All were given back, so that two runs that wait for each other's cores cannot lock up;
        # at random times, so that they do not go on meeting.
        if not told:
            waiting()
            told = True
        time.sleep(_POLL_S * random.uniform(0.5, 1.5))


def _some(stack: ExitStack, names: list[str], n: int) -> bool:
    """Take n of these locks, or all if those are fewer."""
    missing = min(n, len(names))
    for name in names:
        if missing and _taken(stack, name):
            missing -= 1
    return not missing


def _taken(stack: ExitStack, name: str) -> bool:
    folder = Path(tempfile.gettempdir()) / f"optical-hdc-cores-{os.getuid()}"
    folder.mkdir(exist_ok=True)
    file = locks.take(folder / name)
    if file is None:
        return False
    stack.callback(locks.release, file)
    return True


def _gpu(device: str) -> str:
    import torch

    return f"gpu-{torch.cuda.get_device_properties(device).uuid}"
