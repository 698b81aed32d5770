"""Correlations within and between classes (Fig. 4), and their contrasts."""

from __future__ import annotations

import base64
import io
from collections.abc import Iterable, Iterator

import numpy as np
import pandas as pd
from matplotlib import pyplot as plt
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from experiments.reporting import published
from experiments.reporting.columns import scene_name
from experiments.reporting.curves import errors
from experiments.reporting.estimates import (
    ONE_SENSOR,
    Estimate,
    mean_interval,
    one_sensor,
)
from experiments.reporting.matrices import matrix
from experiments.reporting.measured import matrices
from experiments.reporting.plot import PAPER, head, literal, panel, star
from experiments.reporting.study import Numbers, Plot, Quantity, Study
from experiments.reporting.text import kind_of
from experiments.studies.correlation.pairs import contrast

PICTURES = ("speckle", "hypervector", "prototype")
# Pixels of the pictures that are lit evenly: elsewhere the lamp's edge is the clearest pattern.
EVEN = (slice(48, 88), slice(32, 72))
SYMBOLS = {"speckle": "$C^s$", "hypervector": "$C^b$", "prototype": "$C^p$"}


def own_frames(rows: pd.DataFrame) -> pd.DataFrame:
    """The rows on the experiment's own scene, which is the paper's."""
    return rows[~rows.elsewhere.astype(bool)]


def mean_contrast(
    rows: pd.DataFrame,
    kind: str,
    samples: str,
) -> Estimate:
    """ΔC, mean over seeds: of ``training``, ``held-out`` or ``all`` samples."""
    _, values, _ = matrices(rows, kind, samples)
    return mean_interval([contrast(matrix) for matrix in values])


def quantities(
    rows: pd.DataFrame,
) -> Iterator[Quantity]:
    """Fig. 4: the largest C^s_ll and the contrasts ΔC, of all samples, as Eq. 4 has them."""
    training, held_out = (
        mean_contrast(rows, "prototype", samples).value
        for samples in ("training", "held-out")
    )
    note = f"samples in the prototypes alone {training:.3g}, the others alone {held_out:.3g}"
    for quantity, kind, of in (
        ("max_same_class_speckle", "speckle", lambda c: float(np.diag(c).max())),
        ("contrast_speckle", "speckle", contrast),
        ("contrast_hypervector", "hypervector", contrast),
        ("contrast_prototype", "prototype", contrast),
    ):
        classes, values, n = matrices(rows, kind, "all")
        yield Quantity.of(
            f"correlation/{quantity}",
            one_sensor([of(c) for c in values]),
            ONE_SENSOR,
            n=len(values) * len(classes) * n,
            seeds=len(values),
            note=note if kind == "prototype" else "",
        )


def images(figure: Figure, rows: pd.DataFrame) -> None:
    """The same part of a frame, its hypervector and the prototype, a column per class."""
    seen = _pictures(rows)
    classes = list(dict.fromkeys(name for name, _ in seen))
    figure.set_layout_engine("constrained", w_pad=0.01, h_pad=0.01)
    axes = figure.subplots(len(PICTURES), len(classes), squeeze=False)
    for line, picture in zip(axes, PICTURES, strict=True):
        for place, name in zip(line, classes, strict=True):
            _show(place, seen[name, picture], picture)
        line[0].set_ylabel(picture)
    for place, name in zip(axes[0], classes, strict=True):
        place.set_title(name, pad=2)


def method(figure: Figure, rows: pd.DataFrame) -> None:
    """Speckle, hypervector and prototype of the first class, and how far that hypervector is from
    the prototype of each class."""
    seen = _pictures(rows)
    classes = list(dict.fromkeys(name for name, _ in seen))
    first = classes[0]
    panels = figure.subplots(1, 4)
    titles = (
        f"1  speckle, touch {first}",
        "2  above its median",
        "3  majority of its class",
    )
    for axes, picture, text in zip(panels, PICTURES, titles, strict=False):
        _show(axes, seen[first, picture], picture)
        axes.set_title(text, fontsize=8, loc="left")
    query = seen[first, "hypervector"] > 0.5
    distances = []
    for name in classes:
        differ = query != (seen[name, "prototype"] > 0.5)
        distances.append(100 * differ.mean())
    axes = panels[3]
    colours = ["#D55E00" if name == first else "0.7" for name in classes]
    axes.barh(classes, distances, color=colours)
    axes.invert_yaxis()
    axes.axvline(50, color="0.4", lw=0.7, ls="--")
    axes.set_xlabel("bits that differ (%); 50: unrelated")
    axes.set_title("4  nearest prototype", fontsize=8, loc="left")


def _pictures(rows: pd.DataFrame) -> dict[tuple[str, str], NDArray[np.float64]]:
    """The evenly lit part, from 0 to 1, by class and picture."""
    shown = own_frames(rows).dropna(subset="png")
    pictures = {}
    for name, picture, png in zip(
        shown["class"], shown.picture, shown.png, strict=True
    ):
        pictures[name, picture] = plt.imread(io.BytesIO(base64.b64decode(png)))[EVEN]
    return pictures


def _show(axes: Axes, image: NDArray[np.float64], picture: str) -> None:
    """A picture without axes; speckle from dark to 0.6 of the camera's range, above which few
    pixels are."""
    brightest = 0.6 if picture == "speckle" else 1
    axes.imshow(image, cmap="gray", vmin=0, vmax=brightest, interpolation="nearest")
    axes.set(xticks=[], yticks=[])
    axes.spines[:].set_visible(False)


def fig4(
    figure: Figure,
    rows: pd.DataFrame,
) -> None:
    """The three correlation matrices, and their contrasts with the paper's."""
    rows = own_frames(rows)
    panels = figure.subplots(2, 2).flat
    for axes, letter, kind in zip(panels, "bcd", SYMBOLS, strict=False):
        samples = "held-out" if kind == "prototype" else "all"
        classes, values, _ = matrices(rows, kind, samples)
        mean = values.mean(0)
        matrix(axes, mean, classes, [_without_zero(line) for line in mean])
        several = kind if kind == "speckle" else f"{kind}s"
        panel(axes, letter, f"{SYMBOLS[kind]}: {several}")
    _contrasts(figure.axes[3], rows)
    first = rows.iloc[0]
    scene = literal(f"{scene_name(first.scene)}, {kind_of(first.origin)}")
    head(figure, f"Correlations: {scene}", ["mean over seeds"])


def _without_zero(values: Iterable[float]) -> list[str]:
    """Three decimals each, without the zero before the point."""
    return [f"{value:.3f}".removeprefix("0") for value in values]


def _contrasts(axes: Axes, rows: pd.DataFrame) -> None:
    """ΔC of speckle, hypervectors and prototypes; the last for three choices of samples."""
    bars = {
        "$ΔC^s$": ("speckle", "all"),
        "$ΔC^b$": ("hypervector", "all"),
        "$ΔC^p$, held out": ("prototype", "held-out"),
        "$ΔC^p$, training": ("prototype", "training"),
        "$ΔC^p$, all": ("prototype", "all"),
    }
    x = np.arange(len(bars))
    value, spread = errors([mean_contrast(rows, *of) for of in bars.values()])
    axes.bar(
        x,
        value,
        yerr=spread,
        color="#56B4E9",
        width=0.7,
        error_kw={"elinewidth": 0.7},
    )
    numbers = published.numbers()
    names = [f"correlation/contrast_{kind}" for kind, _ in bars.values()]
    known = [numbers[name].value for name in names]
    axes.plot(x, known, zorder=4, **PAPER)
    axes.set_xticks(x, list(bars), fontsize=5.5, rotation=90)
    axes.tick_params(axis="y", labelsize=5.5)
    axes.set_ylim(0, 1.3 * axes.get_ylim()[1])
    axes.legend(handles=[star("paper")], loc="upper left", handlelength=1)
    panel(axes, "e", "contrast $ΔC$")


def _has_pictures(rows: pd.DataFrame) -> bool:
    own = own_frames(rows)
    return "png" in own and bool(own.png.notna().any())


STUDY = Study(
    "correlation",
    "Correlations",
    "How much more alike are speckles, hypervectors and prototypes within a touch than "
    "between touches? Eqs. 4 to 6, Fig. 4.",
    4,
    figures=[
        Plot(
            "fig4_images",
            images,
            of="correlation",
            needs=_has_pictures,
            size=(3.4, 2.1),
            kind="webp",
            caption="Speckle, hypervector and prototype of each class, on the paper's scene (Fig. "
            "4(a)). Each row shows the same part of a frame: white 1, black 0.",
        ),
        Plot(
            "method",
            method,
            of="correlation",
            needs=_has_pictures,
            size=(7.0, 1.75),
            kind="webp",
            caption="The method in four pictures, on part of a frame of the paper's scene. A "
            "touch makes a speckle. The pixels above the median are its hypervector. The "
            "majority of a class's hypervectors is its prototype. The nearest prototype "
            "is the answer.",
        ),
        Plot(
            "fig4_correlations",
            fig4,
            of="correlation",
            size=(3.4, 4.2),
            caption="Correlations within and between classes, on the paper's scene, mean over "
            "seeds (Fig. 4(b) to (e)). (d): prototypes (rows) with held-out samples "
            "(columns). (e): 95 % intervals over seeds.",
            needs=lambda rows: set(SYMBOLS) == set(own_frames(rows).kind.dropna()),
        ),
    ],
    numbers=[Numbers(quantities, of="correlation")],
)
