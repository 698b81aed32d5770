"""The figure of a scene's frames, from the measurement ``sensor_pictures``."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib import pyplot as plt
from matplotlib.figure import Figure

from experiments.records.measurement import Measured
from experiments.reporting.plot import STYLE, WIDTH, head
from experiments.studies.sensor.kinds import LARGEST, REDUCED


def pictures(measured: Measured, scene: str) -> Figure:
    """One scene, a column a class: whole, enlarged, hypervector, change by the touch."""
    rows = [row for row in measured.rows if row["scene"] == scene]
    with np.load(measured.folder / f"{scene}.npz", allow_pickle=False) as stored:
        arrays: dict[str, np.ndarray] = dict(stored)
    edge = arrays["part"].shape[1]
    several = len({row["session"] for row in rows}) > 1
    shown: dict[str, tuple[str, dict[str, Any]]] = {
        "frame": ("frame", {"cmap": "gray", "vmin": 0, "vmax": 160}),
        "part": ("enlarged", {"cmap": "gray", "vmin": 0, "vmax": 160}),
        "ones": ("hypervector", {"cmap": "gray"}),
        "change": ("change by\nthe touch", {"cmap": "RdBu_r", "vmin": -127, "vmax": 127}),
    }
    with plt.rc_context(STYLE):
        width = max(WIDTH, 0.62 * len(rows) + 0.6)
        figure, axes = plt.subplots(
            len(shown), len(rows), figsize=(width, 3.1), squeeze=False, layout="compressed"
        )
        for line, (key, (label, options)) in zip(axes, shown.items(), strict=True):
            for place, image in zip(line, arrays[key], strict=True):
                last = place.imshow(image, interpolation="nearest", **options)
                place.set(xticks=[], yticks=[])
                place.spines[:].set_visible(False)
            line[0].set_ylabel(label, fontsize=6)
        for place, row in zip(axes[0], rows, strict=True):
            day = f"\nday {1 + 16 * int(row['session'])}" if several else ""
            place.set_title(row["class"] + day, fontsize=6, pad=2)
        bar = figure.colorbar(last, ax=list(axes[-1]), shrink=0.9, pad=0.01, ticks=[-127, 0, 127])
        bar.ax.set_yticklabels([f"{k * LARGEST:g}" for k in (-1, 0, 1)], fontsize=5)
        bar.set_label("of the mean", fontsize=5)
        head(figure, f"Simulated frames of the scene {scene}", [
            f"seed {measured.record.config['seed']}; top row averaged over {REDUCED} × {REDUCED} "
            f"pixels, the others {edge} × {edge} pixels of the same place, white: 1, black: 0; "
            "blue to red: noiseless intensity with minus without the touch",
        ])  # fmt: skip
    return figure
