"""Hyperdimensional classification and regression on packed bits; needs torch and numpy only."""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from hdc.backends import compile_kernels
    from hdc.classifier import HDCClassifier
    from hdc.regressor import HDCRegressor

__all__ = ["HDCClassifier", "HDCRegressor", "__version__", "compile_kernels"]

_MODULES = {
    "HDCClassifier": "hdc.classifier",
    "HDCRegressor": "hdc.regressor",
    "compile_kernels": "hdc.backends",
}
REVISION = 1
"""Version of the shared arithmetic (bits, planes, prototypes), raised by hand in the commit
that changes a number of theirs. Encoders and read-outs have revisions of their own."""
__version__ = "4.0.0"  # pyproject.toml has it from here


def __getattr__(name: str) -> Any:
    """Import a name when it is asked for: readers and command lines do without torch."""
    if name in _MODULES:
        globals()[name] = found = getattr(importlib.import_module(_MODULES[name]), name)
        return found
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
