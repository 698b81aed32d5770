"""Backends: numpy's and torch's operations, or the kernels of :mod:`hdc.compiled`; the same bits.

The kernels need numba. They are compiled once per machine and version, in some ten seconds, and
kept in numba's cache; later processes load them in about a second. :func:`compile_kernels` has that
done when it suits; else a process loads them when it has encoded so many pixels that they pay.
"""

from __future__ import annotations

import functools
import importlib
from contextlib import suppress
from types import ModuleType

import torch

from hdc.parameters import not_among

BACKENDS = ("numpy", "compiled")
ENOUGH = 2**28
"""Pixels that a process encodes by numpy before it loads the kernels: 1,000 of 500 × 500."""

_encoded = 0  # pixels so far, by ``"auto"``


def compile_kernels() -> None:
    """Compile the kernels, or load what was compiled; ``backend="auto"`` then means them.

    Raises:
        ValueError: without numba.
    """
    kernels("compiled", "cpu")


def kernels(backend: str, device: torch.device | str) -> ModuleType | None:
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
    """The backend for so many pixels (frames × pixels of each); errors as of :func:`kernels`.

    ``"auto"`` is ``"compiled"`` on the CPU where the kernels are loaded, or where numba is there
    and they pay: after :data:`ENOUGH` pixels.
    """
    global _encoded
    if backend != "auto":
        kernels(backend, device)
        return backend
    if torch.device(device).type != "cpu":
        return "numpy"
    _encoded += n_pixels
    is_loaded = _load.cache_info().currsize > 0
    if is_loaded or (_encoded >= ENOUGH and _loads()):
        return "compiled"
    return "numpy"


@functools.cache
def _load() -> ModuleType:
    return importlib.import_module("hdc.compiled")


@functools.cache
def _loads() -> bool:
    """Whether the kernels can be used, tried once."""
    # A broken numba is no error where nobody asked for it.
    with suppress(Exception):
        _load()
        return True
    return False
