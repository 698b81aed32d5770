"""Correlations within and between classes (Fig. 4), and their contrasts."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from experiments.records.results import own_frames
from experiments.reporting import published
from experiments.reporting.estimates import (
    Estimate,
    mean_interval,
    one_sensor,
)
from experiments.reporting.facets import matrix, spread
from experiments.reporting.plot import PAPER, entry, panel
from experiments.reporting.resamples import matrices, mean_matrix
from experiments.reporting.study import Figure, Quantity, Study
from experiments.reporting.table import Table
from experiments.reporting.trained import split_of
from experiments.studies.correlation.pairs import contrast

if TYPE_CHECKING:
    from matplotlib.figure import Figure as Canvas

# Signs of Fig. 4 by kind; and kinds and samples of its bars, of which the first are matrices.
SIGNS = {"speckle": "s", "hypervector": "b", "prototype": "p"}
CONTRASTS = (
    ("speckle", "all"),
    ("hypervector", "all"),
    ("prototype", "held-out"),
    ("prototype", "training"),
    ("prototype", "all"),
)
MATRICES = CONTRASTS[:3]


def mean_contrast(lines: pd.DataFrame, kind: str, samples: str) -> Estimate:
    """ΔC, mean over seeds: of ``training``, ``held-out`` or ``all`` samples."""
    return mean_interval([contrast(c) for c in matrices(lines, kind, samples)])


def quantities(lines: pd.DataFrame) -> Iterator[Quantity]:
    """Fig. 4: the largest C^s_ll and the contrasts ΔC, of all samples, as Eq. 4 has them."""
    training, held_out = (
        mean_contrast(lines, "prototype", samples).value
        for samples in ("training", "held-out")
    )
    note = f"samples in the prototypes alone {training:.3g}, the others alone {held_out:.3g}"
    of_all = lines[lines.samples == "all"]
    for quantity, kind, of in (
        ("max_same_class_speckle", "speckle", lambda c: float(np.diag(c).max())),
        ("contrast_speckle", "speckle", contrast),
        ("contrast_hypervector", "hypervector", contrast),
        ("contrast_prototype", "prototype", contrast),
    ):
        values = matrices(of_all, kind, "all")
        seeds, n_classes, _ = values.shape
        yield Quantity(
            f"correlation/{quantity}",
            one_sensor([of(c) for c in values]),
            n=seeds * n_classes * int(of_all.n.iloc[0]),
            seeds=seeds,
            note=note if kind == "prototype" else "",
        )


def correlations(frame: pd.DataFrame) -> pd.DataFrame | None:
    """Fig. 4 on the experiment's own scene, which is the paper's, mean over seeds.

    Returns:
        DataFrame: ``kind``, ``samples`` and ``value``: the correlation of ``class_i`` with
        ``class_j``, or the contrast, without classes, with its interval and the ``published`` one.
    """
    own = own_frames(frame)
    if not set(SIGNS) <= set(own.kind):
        return None
    parts = [mean_matrix(own, *of).assign(kind=of[0], samples=of[1]) for of in MATRICES]
    numbers = published.numbers()
    contrasts = [
        {
            "kind": kind,
            "samples": samples,
            "published": numbers[f"correlation/contrast_{kind}"].value,
            **mean_contrast(own, kind, samples).columns("value"),
        }
        for kind, samples in CONTRASTS
    ]
    first = own.iloc[0]
    about = {"scene": first.scene, "split": split_of(own), "seeds": own.seed.nunique()}
    return pd.concat([*parts, pd.DataFrame(contrasts)]).assign(**about)


def draw_correlations(figure: Canvas, data: pd.DataFrame) -> None:
    """The three correlation matrices, and their contrasts with the paper's."""
    *squares, last = figure.subplots(2, 2).flat
    of_pairs = data[data.class_i.notna()]
    for axes, letter, (kind, sign) in zip(squares, "bcd", SIGNS.items(), strict=True):
        of_kind = of_pairs[of_pairs.kind == kind]
        names = of_kind.class_i.unique()
        values = of_kind.pivot(index="class_i", columns="class_j", values="value")
        matrix(axes, values.loc[names, names], _without_zero)
        panel(axes, letter, f"$C^{sign}$: {kind}")
    contrasts = data[data.class_i.isna()]
    values, distances = spread(contrasts, "value")
    names = "$ΔC^" + contrasts.kind.map(SIGNS) + "$,\n" + contrasts.samples
    last.barh(names, values, 0.7, xerr=distances, color="#56B4E9")
    last.plot(contrasts.published, names, zorder=4, **PAPER)
    last.tick_params(labelsize=6)
    last.invert_yaxis()
    last.legend(handles=[entry("paper", **PAPER)], handlelength=1, loc="upper right")
    panel(last, "e", "contrast $ΔC$")


def _without_zero(value: float) -> str:
    """Three decimals, without the zero before the point."""
    return f"{value:.3f}".removeprefix("0")


STUDY = Study(
    "correlation",
    "Correlations",
    "How much more alike are speckles, hypervectors and prototypes within a touch than "
    "between touches? Eqs. 4 to 6, Fig. 4.",
    4,
    figures=[
        Figure(
            "fig4_correlations",
            Table("fig4_correlations", correlations, of="correlation"),
            draw_correlations,
            title="Correlations within and between classes (Fig. 4)",
            caption="Correlations within and between classes, on the paper's scene, mean over "
            "seeds; letters as in the paper (Fig. 4(b) to (e)). (d): prototypes (rows) with "
            "held-out samples (columns). (e): contrasts with 95 % intervals over seeds; stars: the "
            "paper.",
            size=(4.6, 4.2),
        ),
    ],
    numbers={"correlation": quantities},
)
