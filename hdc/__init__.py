"""Hyperdimensional classification on packed bit tensors; needs torch and numpy only."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from hdc.classifier import HDCClassifier

__all__ = ["HDCClassifier", "__version__"]

__version__ = "0.1.0"  # pyproject.toml has it from here


def __getattr__(name: str) -> Any:
    """The classifier, imported when asked for: readers and command lines do without torch."""
    if name == "HDCClassifier":
        from hdc.classifier import HDCClassifier

        globals()[name] = HDCClassifier
        return HDCClassifier
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
