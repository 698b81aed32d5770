"""Backends: numpy's and torch's operations, or the kernels of :mod:`hdc.compiled`; the same bits.

The kernels need numba. They are compiled once per machine and version, in some ten seconds, and
kept in numba's cache; later processes load them in about a second. A model decides for a backend
once, when it is fitted or loaded, and never in between. Functions that compute read :data:`in_use`.
"""

from __future__ import annotations

import functools
import importlib
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from contextvars import ContextVar
from types import ModuleType
from typing import Any

import torch

from hdc.parameters import not_among

BACKENDS = ("numpy", "compiled")
ENOUGH = 2**28
"""Pixels of a training from which ``"auto"`` loads the kernels: 1,000 frames of 500 × 500."""
in_use: ContextVar[ModuleType | None] = ContextVar("in_use", default=None)
"""The kernels that compute in this thread; None for numpy's and torch's operations."""


def compile_kernels() -> None:
    """Compile the kernels, or load them if they were compiled before.

    Models with ``backend="auto"`` that are fitted or loaded afterwards use them.

    Raises:
        ValueError: without numba.
    """
    kernels("compiled")


def kernels(backend: str, device: torch.device | str = "cpu") -> ModuleType | None:
    """The kernels of a backend: :mod:`hdc.compiled`, or None for numpy's and torch's operations.

    Raises:
        ValueError: for an unknown backend, or compiled kernels without CPU or numba.
    """
    if backend not in BACKENDS:
        raise ValueError(f"backend: {not_among(backend, ('auto', *BACKENDS))}")
    if backend == "numpy":
        return None
    if torch.device(device).type != "cpu":
        raise ValueError(
            f"backend: 'compiled' expects device 'cpu', found {str(device)!r}"
        )
    try:
        return _load()
    except ImportError as error:
        install = "numba (pip install 'speckle-hdc[compiled]')"
        raise ValueError(
            f"backend: 'compiled' expects {install}, found: {error}"
        ) from error


def choose_backend(backend: str, device: torch.device | str, n_pixels: int = 0) -> str:
    """The backend for a training on this number of pixels, or, with 0, for a loaded model.

    ``"auto"`` is ``"compiled"`` on the CPU if the kernels are already loaded, or if numba is
    installed and the training has at least :data:`ENOUGH` pixels, so that loading them pays.

    Raises:
        ValueError: as :func:`kernels` and :func:`check_device`.
    """
    check_device(device)
    if backend != "auto":
        kernels(backend, device)
        return backend
    if torch.device(device).type != "cpu":
        return "numpy"
    is_loaded = _load.cache_info().currsize > 0
    return "compiled" if is_loaded or (n_pixels >= ENOUGH and _loads()) else "numpy"


def check_device(device: Any) -> None:
    """Raise ValueError for a device that this machine does not have, or that holds no data."""
    try:
        if torch.empty(1, device=torch.device(device)).is_meta:
            raise ValueError("it has no memory")
    # Each kind of device has errors of its own.
    except Exception as error:
        expected = "'cpu'"
        if torch.cuda.is_available():
            expected += " or 'cuda'"
        reason = str(error).partition("\n")[0]
        raise ValueError(
            f"device: expected {expected}, found {device!r}: {reason}"
        ) from error


@contextmanager
def computing(backend: str) -> Iterator[None]:
    """Have this thread compute by a backend, one of :data:`BACKENDS`."""
    token = in_use.set(kernels(backend))
    try:
        yield
    finally:
        in_use.reset(token)


@functools.cache
def _load() -> ModuleType:
    return importlib.import_module("hdc.compiled")


@functools.cache
def _loads() -> bool:
    """Whether the kernels can be loaded."""
    # A broken numba is no error where nobody asked for it.
    with suppress(Exception):
        _load()
        return True
    return False
