"""Every figure of the paper that has data, drawn from records and measurements.

A function gives a matplotlib figure, or None where its record is missing; :func:`write` writes all
there are. Nothing here trains or makes frames.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib import pyplot as plt
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine

from experiments.class_correlations import KINDS, REDUCED
from experiments.figures import STYLE, WIDTH, save
from experiments.measurement import Measured
from experiments.paper_confusions import confusion, spatial
from experiments.paper_data import finished, matrices, mean_interval, origin_of
from experiments.paper_drift import drift
from experiments.paper_style import PAPER, changed, errors, head, matrix, panel, seeds_of, star
from experiments.selection import Records
from experiments.tables import published
from scenes.sensor.statistics import contrast

SYMBOLS = {"speckle": "$C^s$", "hypervector": "$C^b$", "prototype": "$C^p$"}


def write(results: Path, device: str = "cpu") -> list[Path]:
    """Write every figure there are records for into ``figures/`` of a results folder.

    Returns:
        list: the files, ``fig*.svg`` and ``fig*.pdf``.
    """
    records = Records(results, device)
    written = []
    for name, figure in {
        "fig4_images": speckle_images(results),
        "fig4_correlations": correlations(results),
        "fig5_confusion": confusion(records, "touch"),
        "fig6_confusion": confusion(records, "finger"),
        "fig7_spatial": spatial(records, results),
        "fig8_drift": drift(results),
        "fig9_confusion": confusion(records, "tactile"),
    }.items():
        if figure is None:
            continue
        (results / "figures").mkdir(parents=True, exist_ok=True)
        for kind in ("svg", "pdf"):
            path = results / "figures" / f"{name}.{kind}"
            path.write_bytes(save(figure, kind))
            written.append(path)
        plt.close(figure)
    return written


def speckle_images(results: Path) -> Figure | None:
    """Fig. 4(a): speckle, hypervector and prototype of each class; None without pictures."""
    measured = finished(results, "correlation")
    if measured is None or measured.record["config"]["crop"] is None:
        return None
    classes, _, _ = matrices(measured, "speckle", "all")
    config = measured.record["config"]
    edge = config["crop"][2]
    rows = {
        "speckle": "speckle",
        "hypervector": "hypervector",
        "prototype": "prototype",
        "whole": "prototype,\nwhole frame",
    }
    folder = results / "measured" / "correlation"
    with plt.rc_context(STYLE):
        figure, axes = plt.subplots(
            len(rows), len(classes), figsize=(WIDTH, 3.2), squeeze=False,
            layout=ConstrainedLayoutEngine(w_pad=0.01, h_pad=0.01, wspace=0, hspace=0),
        )  # fmt: skip
        for line, (what, label) in zip(axes, rows.items(), strict=True):
            for place, name in zip(line, classes, strict=True):
                image = plt.imread(folder / f"{name}-{what}.png")
                # Speckle: from dark to 0.6 of the camera's range, above which few pixels are.
                place.imshow(
                    image, cmap="gray", vmin=0, vmax=0.6 if what == "speckle" else 1,
                    interpolation="nearest" if what != "whole" else "auto",
                )  # fmt: skip
                place.set(xticks=[], yticks=[])
                place.spines[:].set_visible(False)
            line[0].set_ylabel(label, fontsize=6)
        for place, name in zip(axes[0], classes, strict=True):
            place.set_title(name, fontsize=7, pad=2)
        head(figure, "Speckle, hypervector and prototype of each class (Fig. 4(a))", [
            f"{origin_of(measured)} frames, seed {config['seeds'][0]}; {edge} × {edge} pixels of a "
            f"frame, the same place in each row; last row: whole, averaged over {REDUCED} × "
            f"{REDUCED} pixels; white: 1, black: 0",
            *changed(measured),
        ])  # fmt: skip
    return figure


def correlations(results: Path) -> Figure | None:
    """Fig. 4(b) to (e): the three correlation matrices, and their contrasts with the paper's."""
    measured = finished(results, "correlation")
    if measured is None:
        return None
    samples = {"speckle": "all", "hypervector": "all", "prototype": "held-out"}
    titles = ("speckle", "hypervectors", "prototypes")
    with plt.rc_context(STYLE):
        figure, axes = plt.subplots(2, 2, figsize=(WIDTH, 3.9), layout="constrained")
        for place, kind, letter, title in zip(axes.flat, KINDS, "bcd", titles, strict=False):
            classes, values, _ = matrices(measured, kind, samples[kind])
            mean = values.mean(0)
            cells = [[f"{value:.3f}".removeprefix("0") for value in row] for row in mean]
            matrix(place, mean, classes, cells)
            panel(place, letter, f"{SYMBOLS[kind]}: {title}")
        _contrasts(axes[1, 1], measured)
        _, values, n = matrices(measured, "speckle", "all")
        held_out = matrices(measured, "prototype", "held-out")[2]
        diagonal = mean_interval([float(np.diag(c).max()) for c in values]).value
        known = published()["correlation/max_same_class_speckle"]
        head(figure, "Mean correlations within and between classes (Fig. 4(b–e))", [
            f"{origin_of(measured)} frames, mean over {seeds_of(len(values))}; (b, c) {n} samples "
            f"a class, (d) prototypes of {n - held_out} (rows) with the other {held_out} "
            f"(columns); (e) 95 % intervals over seeds",
            f"largest $C^s_{{ll}}$ {diagonal:.3f}, paper {known:g}",
            *changed(measured),
        ])  # fmt: skip
    return figure


def _contrasts(axes: Axes, measured: Measured) -> None:
    """ΔC of speckle, hypervectors and prototypes; the last for three choices of samples."""
    bars = [
        ("speckle", "all", "$ΔC^s$"),
        ("hypervector", "all", "$ΔC^b$"),
        ("prototype", "held-out", "$ΔC^p$\nheld\nout"),
        ("prototype", "training", "$ΔC^p$\ntrain"),
        ("prototype", "all", "$ΔC^p$\nall"),
    ]
    found = [
        mean_interval([contrast(c) for c in matrices(measured, kind, samples)[1]])
        for kind, samples, _ in bars
    ]
    x = np.arange(len(bars))
    value, spread = errors(found)
    axes.bar(x, value, yerr=spread, color="#56B4E9", width=0.7, error_kw={"elinewidth": 0.7})
    known = [published()[f"correlation/contrast_{kind}"] for kind, _, _ in bars]
    axes.plot(x, known, zorder=4, **PAPER)
    axes.set_xticks(x, [label for _, _, label in bars], fontsize=5.5)
    axes.tick_params(axis="y", labelsize=5.5)
    axes.set_ylim(0, 1.3 * axes.get_ylim()[1])
    axes.legend(handles=[star("paper")], loc="upper left", handlelength=1)
    panel(axes, "e", "contrast $ΔC$")
