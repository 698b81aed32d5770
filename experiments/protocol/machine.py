"""The machine that a run is timed on: its cores, held by the run alone, its threads and memory.

A run waits until as many cores as it has threads are free, so that no two timed runs share a core,
whatever launcher or checkout started them. There is one lock a core in the machine's temporary
folder; they bind one user's runs, and no other program.
"""

from __future__ import annotations

import ctypes
import importlib
import itertools
import os
import random
import re
import resource
import sys
import tempfile
import time
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

from filelock import FileLock, Timeout

from experiments.records import revision

if TYPE_CHECKING:
    from rich.console import Console

_POLL_S = 0.2
# Options of mallopt in glibc's malloc.h (M_MMAP_MAX, M_TRIM_THRESHOLD, M_TOP_PAD), and what they
# are set to.
_MALLOPT = {
    -4: 0,
    -1: 2**31 - 1,
    -2: 64 * 2**20,
}


def keep_memory() -> bool:
    """Let glibc keep freed memory for the next allocation; False where the C library is another.

    Otherwise the system clears the pages of every large block that is allocated, which takes a
    third of the processor time of a network's training. The process keeps its peak of memory until
    it ends.
    """
    if sys.platform != "linux":
        return False
    mallopt = getattr(ctypes.CDLL(None), "mallopt", None)
    if mallopt is None:
        return False
    return all(mallopt(option, value) == 1 for option, value in _MALLOPT.items())


def available() -> list[int]:
    """Numbers of the cores that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return sorted(os.sched_getaffinity(0))
    return list(range(os.cpu_count() or 1))


def threads(wanted: Any, launcher: Any) -> int:
    """Number of torch's threads: `wanted`, or this worker's share of the cores.

    Args:
        wanted: ``threads`` of the config.
        launcher: config of Hydra's launcher, which may run several workers at once.

    Raises:
        ValueError: unless it is null or a number of cores of this machine.
    """
    cores = len(available())
    if wanted is None:
        workers = launcher.get("n_jobs") or 1  # of joblib, below zero for one per core
        of_cores = cores // workers if workers > 0 else 1
        share = launcher.get("cpus_per_task") or of_cores
        return min(cores, max(1, share))
    if type(wanted) is not int or not 1 <= wanted <= cores:
        raise ValueError(
            f"threads: expected an integer from 1 to this machine's {cores} cores, or null, "
            f"found {wanted!r}"
        )
    return wanted


@contextmanager
def held(
    n: int,
    device: str,
    console: Console,
) -> Iterator[None]:
    """Hold n cores, or all if there are fewer, and the GPU that is computed on.

    Args:
        n: number of cores.
        device: as torch names it.
        console: says it once if they are not free at once.
    """
    folder = Path(tempfile.gettempdir()) / f"optical-hdc-cores-{os.getuid()}"
    folder.mkdir(parents=True, exist_ok=True)
    cores = [FileLock(folder / f"core-{core}", timeout=0) for core in available()]
    gpus = []
    if device.startswith("cuda"):
        gpus.append(FileLock(folder / _gpu(device), timeout=0))
    for attempt in itertools.count():
        with ExitStack() as stack:
            if _locked(stack, gpus, 1) and _locked(stack, cores, n):
                yield
                return
        # All were given back, so that two runs that wait for each other's cores cannot lock up;
        # at random times, so that they do not go on meeting.
        if attempt == 0:
            from experiments.records.console import say  # no model needs rich

            text = f"waiting for {n} free cores: another run is timed"
            say(console, f"{text} (exclusive=false runs beside it)", "yellow")
        time.sleep(_POLL_S * random.uniform(0.5, 1.5))


def _locked(
    stack: ExitStack,
    locks: list[FileLock],
    n: int,
) -> bool:
    """Whether n of these locks were free, or all if there are fewer; the stack holds them."""
    missing = min(n, len(locks))
    for lock in locks:
        with suppress(Timeout):
            if missing:
                stack.enter_context(lock)
                missing -= 1
    return not missing


def _gpu(device: str) -> str:
    import torch

    return f"gpu-{torch.cuda.get_device_properties(device).uuid}"


@contextmanager
def limited(config: Mapping[str, Any], threads: int) -> Iterator[None]:
    """Limit the numerical libraries of numpy, scipy and scikit-learn to this many threads.

    They bring OpenBLAS and OpenMP libraries of their own, with a thread a core each.
    """
    from threadpoolctl import threadpool_limits

    # A limit binds the libraries loaded so far, and none loaded later.
    for target, _ in revision.targets(config):
        if target.startswith("sklearn."):
            importlib.import_module(target.rpartition(".")[0])
    with threadpool_limits(threads):
        yield


def peak_bytes() -> int:
    """The most memory this process has held so far.

    On Linux it excludes the memory of the parent process, which ``getrusage`` includes.
    """
    status = Path("/proc/self/status")
    if status.exists():
        found = re.search(r"^VmHWM:\s+(\d+)", status.read_text(), re.MULTILINE)
        if found:  # not every kernel says it
            return 1024 * int(found[1])
    unit = 1 if sys.platform == "darwin" else 1024
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * unit
