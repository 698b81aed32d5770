"""Matplotlib settings of every figure; it is drawn without a display."""

from __future__ import annotations

from typing import Any

import matplotlib

matplotlib.use("Agg")

STYLE: dict[Any, Any] = {
    "font.family": "DejaVu Sans",
    "font.size": 7,
    "axes.titlesize": 7,
    "axes.linewidth": 0.6,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "lines.linewidth": 1.1,
    "lines.markersize": 3.5,
    "legend.fontsize": 6,
    "legend.frameon": False,
    "legend.handlelength": 3.0,
    "svg.fonttype": "none",  # text stays text: smaller, and it can be searched and copied
    "svg.hashsalt": "optical-hdc",
    "pdf.fonttype": 42,
}
