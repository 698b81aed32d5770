"""Warnings that point at the line of the user's program that called this package."""

from __future__ import annotations

import os
import sys
import warnings
from types import FrameType

_HERE = os.path.join(os.path.dirname(__file__), "")


def warn(text: str, kind: type[Warning] = UserWarning) -> None:
    """Warn at the innermost line outside this package, however deep inside it this is called.

    From Python 3.12 on, ``skip_file_prefixes`` of :func:`warnings.warn` does this.
    """
    level = 1
    frame: FrameType | None = sys._getframe()
    while frame is not None and frame.f_code.co_filename.startswith(_HERE):
        frame = frame.f_back
        level += 1
    warnings.warn(text, kind, stacklevel=level)
