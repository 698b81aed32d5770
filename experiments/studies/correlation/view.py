"""Correlations within and between classes (Figs. 4 and 7(a)), and their contrasts."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial

import numpy as np
from matplotlib import pyplot as plt
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine
from numpy.typing import NDArray

from experiments.records.measurement import Measured
from experiments.records.results import Results
from experiments.reporting import published
from experiments.reporting.estimates import ONE_SENSOR, Estimate, mean_interval, one_sensor
from experiments.reporting.measured import with_places
from experiments.reporting.plot import (
    PAPER,
    STYLE,
    WIDTH,
    errors,
    head,
    matrix,
    panel,
    seeds_of,
    star,
)
from experiments.reporting.rows import frames_of
from experiments.reporting.study import Plot, Quantity, Study
from experiments.studies.correlation.kinds import KINDS, REDUCED

SYMBOLS = {"speckle": "$C^s$", "hypervector": "$C^b$", "prototype": "$C^p$"}


def plots(results: Results) -> Iterator[Plot]:
    """Fig. 4, of the experiment's own scene and of any other that was measured."""
    for place, one in with_places(results, "correlation"):
        if one.record.config.get("crop") is not None:
            yield Plot(
                f"fig4_images{place}",
                "Speckle, hypervector and prototype of each class (Fig. 4(a)).",
                partial(speckle_images, one),
                [one.record.command],
                kind="webp",
            )
        yield Plot(
            f"fig4_correlations{place}",
            "Correlations within and between classes (Fig. 4(b) to (e)).",
            partial(correlations, one),
            [one.record.command],
        )


def quantities(results: Results) -> Iterator[Quantity]:
    """Fig. 4: the largest C^s_ll and the contrasts ΔC."""
    measured = results.measured("correlation")
    if measured is None:
        return
    for quantity, kind, of in (
        ("max_same_class_speckle", "speckle", lambda c: float(np.diag(c).max())),
        ("contrast_speckle", "speckle", contrast),
        ("contrast_hypervector", "hypervector", contrast),
        ("contrast_prototype", "prototype", contrast),
    ):
        classes, values, n = matrices(measured, kind, "all")
        yield Quantity.of(
            f"correlation/{quantity}",
            one_sensor([of(c) for c in values]),
            ONE_SENSOR,
            n=len(values) * len(classes) * n,
            seeds=len(values),
            made_by=measured.record.command,
            note=_readings(measured) if kind == "prototype" else "",
        )


def mean_contrast(measured: Measured, kind: str, samples: str) -> Estimate:
    """ΔC, mean over seeds: of ``training``, ``held-out`` or ``all`` samples."""
    return mean_interval([contrast(c) for c in matrices(measured, kind, samples)[1]])


def _readings(measured: Measured) -> str:
    """What Eq. 6 gives for other samples than all: the paper has N_s = 100 in Eq. 4, and 80 in the
    prototypes."""
    training, held_out = (
        mean_contrast(measured, "prototype", samples).value for samples in ("training", "held-out")
    )
    return (
        f"of all samples, as Eq. 4; of those in the prototypes {training:.3g}, of the others "
        f"{held_out:.3g}"
    )


def contrast(correlation: NDArray[np.float64]) -> float:
    """ΔC = max_ll′ |C_ll − C_ll′| of a matrix [L, L]."""
    return float(np.abs(np.diag(correlation)[:, None] - correlation).max())


def matrices(
    measured: Measured, kind: str, samples: str
) -> tuple[list[str], NDArray[np.float64], int]:
    """Correlation matrices of a measurement: classes, C [seeds, L, L], samples a class.

    Raises:
        ValueError: if the measurement has none of this kind and these samples.
    """
    rows = [r for r in measured.rows if (r["kind"], r["samples"]) == (kind, samples)]
    if not rows:
        path = measured.folder / "rows.csv"
        raise ValueError(f"{path}: expected rows {kind}, {samples}, found none")
    classes = list(dict.fromkeys(row["class_i"] for row in rows))
    seeds = list(dict.fromkeys(row["seed"] for row in rows))
    values = np.full((len(seeds), len(classes), len(classes)), np.nan)
    for row in rows:
        place = seeds.index(row["seed"]), *(classes.index(row[k]) for k in ("class_i", "class_j"))
        values[place] = float(row["value"])
    return classes, values, int(rows[0]["n"])


def speckle_images(measured: Measured) -> Figure:
    """Fig. 4(a): speckle, hypervector and prototype of each class."""
    classes, _, _ = matrices(measured, "speckle", "all")
    config = measured.record.config
    edge = config["crop"][2]
    rows = {
        "speckle": "speckle",
        "hypervector": "hypervector",
        "prototype": "prototype",
        "whole": "prototype,\nwhole frame",
    }
    with plt.rc_context(STYLE):
        figure, axes = plt.subplots(
            len(rows),
            len(classes),
            figsize=(WIDTH, 3.2),
            squeeze=False,
            layout=ConstrainedLayoutEngine(w_pad=0.01, h_pad=0.01, wspace=0, hspace=0),
        )
        for line, (what, label) in zip(axes, rows.items(), strict=True):
            for place, name in zip(line, classes, strict=True):
                image = plt.imread(measured.folder / f"{name}-{what}.png")
                # Speckle: from dark to 0.6 of the camera's range, above which few pixels are.
                place.imshow(
                    image,
                    cmap="gray",
                    vmin=0,
                    vmax=0.6 if what == "speckle" else 1,
                    interpolation="nearest" if what != "whole" else "auto",
                )
                place.set(xticks=[], yticks=[])
                place.spines[:].set_visible(False)
            line[0].set_ylabel(label, fontsize=6)
        for place, name in zip(axes[0], classes, strict=True):
            place.set_title(name, fontsize=7, pad=2)
        head(
            figure,
            "Speckle, hypervector and prototype of each class (Fig. 4(a))",
            [
                f"{frames_of(measured.rows)}, seed {config['seeds'][0]}; {edge} × {edge} pixels of "
                f"a frame, the same place in each row; last row: whole, averaged over {REDUCED} × "
                f"{REDUCED} pixels; white: 1, black: 0",
            ],
        )
    return figure


def correlations(measured: Measured) -> Figure:
    """Fig. 4(b) to (e): the three correlation matrices, and their contrasts with the paper's."""
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
        known = published.value("correlation/max_same_class_speckle")
        head(
            figure,
            "Mean correlations within and between classes (Fig. 4(b–e))",
            [
                f"{frames_of(measured.rows)}, mean over {seeds_of(len(values))}; (b, c) {n} "
                f"samples a class, (d) prototypes of {n - held_out} (rows) with the other "
                f"{held_out} (columns); (e) 95 % intervals over seeds",
                f"largest $C^s_{{ll}}$ {diagonal:.3f}, paper {known:g}",
            ],
        )
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
    found = [mean_contrast(measured, kind, samples) for kind, samples, _ in bars]
    x = np.arange(len(bars))
    value, spread = errors(found)
    axes.bar(x, value, yerr=spread, color="#56B4E9", width=0.7, error_kw={"elinewidth": 0.7})
    known = [published.numbers()[f"correlation/contrast_{kind}"].value for kind, _, _ in bars]
    axes.plot(x, known, zorder=4, **PAPER)
    axes.set_xticks(x, [label for _, _, label in bars], fontsize=5.5)
    axes.tick_params(axis="y", labelsize=5.5)
    axes.set_ylim(0, 1.3 * axes.get_ylim()[1])
    axes.legend(handles=[star("paper")], loc="upper left", handlelength=1)
    panel(axes, "e", "contrast $ΔC$")


STUDY = Study(
    "correlation",
    "Correlations",
    "How much more alike are the speckles, hypervectors and prototypes of one touch than of two? "
    "Eqs. 4 to 6, Fig. 4.",
    4,
    plots=plots,
    quantities=quantities,
)
