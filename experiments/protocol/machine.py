"""The machine that a run is timed on: its cores, held by the run alone, and its threads.

A run waits until as many cores as it has threads are free, so that workers of any launcher, sweeps
started at once and runs of other checkouts never share a core while a clock runs: too many workers
cost patience, not truth. There is one lock a core; they lie in the machine's temporary folder,
whatever the results lie on, and bind one user's runs. Programs that know nothing of them are not
kept away.
"""

from __future__ import annotations

import importlib
import os
import random
import resource
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

from experiments.records import locks, sources

_POLL_S = 0.2


def available() -> list[int]:
    """Numbers of the cores that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return sorted(os.sched_getaffinity(0))
    return list(range(os.cpu_count() or 1))


def threads(wanted: Any, launcher: Any) -> int:
    """Number of torch's threads: what is asked for, or this worker's share of the cores.

    Args:
        wanted: ``threads`` of the config.
        launcher: config of Hydra's launcher, which may run several workers at once.

    Raises:
        ValueError: unless it is null or a number of cores that there are.
    """
    cores = len(available())
    if wanted is None:
        n = cores
        workers = launcher.get("n_jobs") or 1  # of joblib, below zero for one a core
        share = launcher.get("cpus_per_task") or (n // workers if workers > 0 else 1)
        return min(n, max(1, share))
    if not isinstance(wanted, int) or isinstance(wanted, bool) or not 1 <= wanted <= cores:
        raise ValueError(
            f"threads: expected an integer from 1 to this machine's {cores} cores, or null, "
            f"found {wanted!r}"
        )
    return wanted


@contextmanager
def held(n: int, device: str, waiting: Callable[[], None]) -> Iterator[None]:
    """Hold n cores, or all there are if those are fewer, and the GPU that is computed on.

    Args:
        n: number of cores.
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
    try:
        stack.enter_context(locks.held(folder / name))
    except locks.Held:
        return False
    return True


def _gpu(device: str) -> str:
    import torch

    return f"gpu-{torch.cuda.get_device_properties(device).uuid}"


@contextmanager
def libraries(model: Mapping[str, Any], threads: int) -> Iterator[list[dict[str, Any]]]:
    """Give the numerical libraries of a scikit-learn model this many threads; gives what they have.

    numpy, scipy and scikit-learn bring OpenBLAS and OpenMP libraries of their own, with a thread a
    core each. Only scikit-learn's estimators compute with them, so that no other run imports
    threadpoolctl.

    Args:
        model: its resolved configuration.
        threads: number of each library's threads.
    """
    estimators = [name for name in sources.targets(model) if name.startswith("sklearn.")]
    if not estimators:
        yield []
        return
    from threadpoolctl import threadpool_info, threadpool_limits

    for name in estimators:  # a limit binds what is loaded, and nothing that comes later
        importlib.import_module(name.rpartition(".")[0])
    with threadpool_limits(threads):
        yield [
            {
                "library": library["prefix"],
                "version": library["version"],
                "threads": library["num_threads"],
            }
            for library in threadpool_info()
        ]


def peak_bytes() -> int:
    """The most memory this process has held so far.

    Where the system tells (Linux), without what its parent held, which ``getrusage`` passes on when
    a process is started; and since it was last made to start anew, by a 5 in
    ``/proc/self/clear_refs``.
    """
    if (found := _of_status("VmHWM")) is not None:
        return found
    unit = 1 if sys.platform == "darwin" else 1024
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * unit


def resident_bytes() -> int | None:
    """The memory that this process holds now; None where the system does not tell."""
    return _of_status("VmRSS")


def _of_status(key: str) -> int | None:
    """A number of kilobytes of Linux's ``/proc/self/status``, in bytes."""
    status = Path("/proc/self/status")
    if not status.exists():
        return None
    lines = (line.split() for line in status.read_text().splitlines())
    return next((1024 * int(words[1]) for words in lines if words[0] == f"{key}:"), None)
