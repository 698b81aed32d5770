"""Where results lie."""

from __future__ import annotations

import os
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
REFERENCE = ROOT / "results" / "reference"
"""The committed results; only ``make reference`` writes them."""


def results_dir() -> Path:
    """Folder of own results: $RESULTS_DIR, or results/mine of the checkout.

    Never the current directory, unless the variable says so.
    """
    own = os.environ.get("RESULTS_DIR")
    if own:
        return Path(own).expanduser().resolve()
    return ROOT / "results" / "mine"
