"""Peak memory of one call of a route, measured in a process of its own.

A server process imports everything and runs nothing; for every request it forks a child, which
prepares the route's inputs, lets the system start its peak anew, and makes the call once.
"""

from __future__ import annotations

import atexit
import contextlib
import ctypes
import functools
import gc
import importlib
import json
import os
import subprocess
import sys
import warnings
from pathlib import Path
from typing import Any

import torch

from experiments.protocol import machine
from experiments.studies.benchmark.cases import Case
from experiments.studies.benchmark.route import Route
from experiments.studies.benchmark.routes import ROUTES

_START_PEAK_ANEW = Path("/proc/self/clear_refs")
_IMPORTED = ("torchhd", "faiss", "numba", "numkong", "sklearn.linear_model", "sklearn.neighbors")


def call_bytes(route: Route, case: Case) -> int | None:
    """The memory one call takes beyond its inputs, result included.

    On the CPU the rise of the resident set, on an accelerator of what torch has allocated there.
    None where the system does not tell (no /proc), or the call did not live to its end.
    """
    if case.device != "cpu":
        return _peak_on_accelerator(route, case)
    if not _START_PEAK_ANEW.exists() or route not in ROUTES:
        return None
    server = _server()
    assert server.stdin is not None
    assert server.stdout is not None
    sizes = [case.n, case.d, case.n_classes, "cpu", case.seed, case.kind]
    request = [ROUTES.index(route), torch.get_num_threads(), sizes]
    server.stdin.write(json.dumps(request) + "\n")
    server.stdin.flush()
    answer = server.stdout.readline()
    return json.loads(answer) if answer.strip() else None


def give_back() -> None:
    """Freed memory goes back to the system, where the C library can do that."""
    gc.collect()
    with contextlib.suppress(OSError, AttributeError):
        ctypes.CDLL(None).malloc_trim(0)


def _peak_on_accelerator(route: Route, case: Case) -> int:
    call, _ = route.build(case)
    torch.cuda.synchronize(case.device)
    torch.cuda.reset_peak_memory_stats(case.device)
    before = torch.cuda.memory_allocated(case.device)
    result = call()
    torch.cuda.synchronize(case.device)
    del result
    return torch.cuda.max_memory_allocated(case.device) - before


@functools.cache
def _server() -> subprocess.Popen[str]:
    """Started once; it ends by itself when this process does, as its input then ends."""
    server = subprocess.Popen(
        [sys.executable, "-m", "experiments.studies.benchmark.memory"],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )

    @atexit.register
    def close() -> None:
        server.communicate()

    return server


def _serve() -> None:
    for name in _IMPORTED:
        with contextlib.suppress(ImportError):
            importlib.import_module(name)
    # What routes print must not mix with the answers.
    answers = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)
    while request := sys.stdin.readline():
        child = os.fork()
        if child == 0:
            code = 1
            try:
                answers.write(json.dumps(_measure(*json.loads(request))) + "\n")
                answers.flush()
                code = 0
            finally:
                os._exit(code)
        if os.waitpid(child, 0)[1] != 0:
            answers.write("\n")
            answers.flush()


def _measure(index: int, threads: int, sizes: list[Any]) -> int:
    torch.set_num_threads(threads)
    warnings.simplefilter("ignore")  # constant frames carry no information
    route, case = ROUTES[index], Case(*sizes)
    call, _ = route.build(case)
    route.build(Case(4, 64, 2, kind=case.kind))[0]()  # thread pools and late imports are no call's
    give_back()  # so that the call cannot take it unseen
    _START_PEAK_ANEW.write_text("5")
    before = machine.resident_bytes() or 0
    result = call()
    peak = machine.peak_bytes()
    del result
    return max(0, peak - before)


if __name__ == "__main__":
    _serve()
