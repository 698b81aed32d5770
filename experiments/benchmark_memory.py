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
from pathlib import Path

import torch

from experiments.benchmark_cases import Case
from experiments.benchmark_routes import ROUTES, Route

_PROC = Path("/proc/self")
_IMPORTED = ("torchhd", "faiss", "numba", "numkong", "sklearn.linear_model", "sklearn.neighbors")


def peak_bytes(route: Route, case: Case) -> int | None:
    """The memory one call takes beyond its inputs, result included.

    On the CPU the rise of the resident set, on an accelerator of what torch has allocated there.
    None where the system does not tell (no /proc), or the call did not live to its end.
    """
    if case.device != "cpu":
        return _peak_on_accelerator(route, case)
    if not (_PROC / "clear_refs").exists() or route not in ROUTES:
        return None
    server = _server()
    assert server.stdin is not None
    assert server.stdout is not None
    request = [ROUTES.index(route), case.n, case.d, case.n_classes, case.seed,
               torch.get_num_threads()]  # fmt: skip
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
        [sys.executable, "-m", "experiments.benchmark_memory"],
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


def _measure(index: int, n: int, d: int, n_classes: int, seed: int, threads: int) -> int:
    torch.set_num_threads(threads)
    route = ROUTES[index]
    call, _ = route.build(Case(n, d, n_classes, seed=seed))
    route.build(Case(4, 64, 2))[0]()  # thread pools and late imports belong to no call
    give_back()  # so that the call cannot take it unseen
    (_PROC / "clear_refs").write_text("5")  # the peak starts from here
    before = _status("VmRSS")
    result = call()
    peak = _status("VmHWM")
    del result
    return max(0, peak - before)


def _status(key: str) -> int:
    for line in (_PROC / "status").read_text().splitlines():
        if line.startswith(key + ":"):
            return int(line.split()[1]) * 1024
    raise ValueError(f"/proc/self/status: expected a line {key}, found none")


if __name__ == "__main__":
    _serve()
