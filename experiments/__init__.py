"""Experiments: compose a scene and a model, time the run, write the record, draw the results."""

from __future__ import annotations

import importlib
from typing import Any

REVISION = 2
"""Code version of :mod:`experiments.protocol`: raised when its numbers change."""


def __getattr__(name: str) -> Any:
    """Functions for notebooks, imported on first use."""
    if name in ("compare", "results"):
        return getattr(importlib.import_module("experiments.notebook"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
