"""Calibration error of probabilities, and how often answers of each probability are right."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from numpy.typing import NDArray

from experiments.records.rows import unpack_labels
from experiments.reporting.columns import Column, display_name, scene_name
from experiments.reporting.measured import (
    ENDS,
    models_of,
    over_units,
)
from experiments.reporting.plot import LETTERS, literal, panel, style_of, wrapped
from experiments.reporting.study import Plot
from experiments.reporting.table import Table
from experiments.reporting.text import percent, points
from experiments.studies.promises.calibration.measure import STEPS

Shares = NDArray[np.float64]

BINS = 10
FEWEST = 20
"""Answers of a bin that the figure shows."""
PERFECT = 200
"""Random choices of which answers are right, for the error of perfect probabilities."""
COLUMNS = {
    "recording": Column("Frames", scene_name),
    "split": Column(
        "Split", lambda split: "as recorded" if split == "counts" else split
    ),
    "n": Column("n of each class"),
    "model": Column("Model", display_name),
    "accuracy": Column("Right, %", percent),
    "sure": Column("Mean probability of the answer, %", percent),
    "error": Column("Calibration error, points", points),
    "perfect": Column("that of perfect probabilities, points", points),
}


def calibration_error(sure: Shares, right: NDArray[np.bool_]) -> float:
    """Expected calibration error: Σ_b n_b/n·|right answers − probabilities|, means of bin b.

    Ten bins of equal width (Guo et al., ICML 2017).

    Args:
        sure: probability of each answer.
        right: whether it is right.
    """
    place = _bins(sure)
    excess = np.bincount(place, sure - right, minlength=BINS)
    return float(np.abs(excess).sum() / len(sure))


def perfect_error(sure: Shares) -> float:
    """The calibration error that so many answers have on average if probabilities are perfect."""
    rng = np.random.default_rng(0)
    drawn = rng.random((PERFECT, len(sure))) < sure
    return float(np.mean([calibration_error(sure, right) for right in drawn]))


def _bins(sure: Shares) -> NDArray[np.int64]:
    return np.minimum((BINS * sure).astype(np.int64), BINS - 1)


def _unpacked(row: Any) -> tuple[Shares, NDArray[np.bool_]]:
    """Probability of each answer of a row, and whether it is right."""
    right = unpack_labels(row.predicted) == unpack_labels(row.labels)
    return unpack_labels(row.sure) / STEPS, right


def summary(rows: pd.DataFrame) -> Iterator[dict[str, Any]]:
    """A line for each split, n and model, with intervals over seeds or draws."""
    seeds = rows.seed.nunique() > 1
    for (split, n), at in rows.groupby(["split", "n"], sort=False):
        for model in models_of(at):
            units: dict[str, list[float]] = {
                name: [] for name in ("accuracy", "sure", "error", "perfect")
            }
            own = at[at.model == model]
            for _, unit in own.groupby("seed" if seeds else "draw"):
                parts = [_unpacked(row) for row in unit.itertuples()]
                sure, right = (
                    np.concatenate(part) for part in zip(*parts, strict=True)
                )
                units["accuracy"].append(float(right.mean()))
                units["sure"].append(float(sure.mean()))
                units["error"].append(calibration_error(sure, right))
                units["perfect"].append(perfect_error(sure))
            line = {"split": split, "n": n, "model": model}
            for name, values in units.items():
                estimate = over_units(values, seeds)
                line |= estimate.within(0, 1).columns(name)
            yield line


def table(frame: pd.DataFrame) -> pd.DataFrame:
    """A row for each scene, split, n and model."""
    lines = []
    for scene, rows in frame.groupby("scene", sort=False):
        lines += [{"recording": scene, **line} for line in summary(rows)]
    data = pd.DataFrame(lines)
    names = [name + end for name in COLUMNS for end in ENDS]
    return data[[name for name in names if name in data]]


def draw(figure: Figure, frame: pd.DataFrame) -> None:
    """A panel a scene and split, a line a model."""
    frames = dict(list(frame.groupby("scene", sort=False)))
    splits = list(frame.split.unique())
    models = models_of(frame)
    looks = {model: _look(model, place) for place, model in enumerate(models)}
    panels = figure.subplots(
        len(splits), len(frames), sharex=True, sharey=True, squeeze=False
    )
    for axes, letter, scene in zip(panels[0], LETTERS, frames, strict=False):
        panel(axes, letter, wrapped(scene_name(str(scene)), 20))
    for line, split in zip(panels, splits, strict=True):
        words = "as recorded" if split == "counts" else split
        line[0].set_ylabel(f"split {words}\nright (%)")
        for axes, rows in zip(line, frames.values(), strict=True):
            _draw(axes, rows[rows.split == split], looks)
    for axes in panels[-1]:
        axes.set_xlabel("probability (%)")
    handles = [
        Line2D([], [], label=literal(display_name(model)), **look)
        for model, look in looks.items()
    ]
    figure.legend(handles=handles, loc="outside lower center", ncols=4)


# Okabe and Ito's.
_COLOURS = ("#D55E00", "#0072B2", "#E69F00", "#009E73", "#56B4E9", "#CC79A7", "black")


def _look(model: str, place: int) -> dict[str, Any]:
    """All models are HDC, and of one colour elsewhere: here each has a colour of its own."""
    _, marker, _ = style_of(model)
    return {
        "color": _COLOURS[place % len(_COLOURS)],
        "marker": marker,
        "ms": 3,
        "lw": 0.8,
    }


def _draw(axes: Axes, rows: pd.DataFrame, looks: dict[str, dict[str, Any]]) -> None:
    """The panel of one scene and split."""
    axes.plot([0, 100], [0, 100], color="0.6", lw=0.8)
    most = rows[rows.n == rows.n.max()]
    for model, own in most.groupby("model", sort=False):
        x, y = _reliability(own)
        axes.plot(x, y, **looks[str(model)])
    axes.set(xlim=(0, 103), ylim=(0, 103))


def _reliability(rows: pd.DataFrame) -> tuple[Shares, Shares]:
    """Mean probability and share of right answers, in %, of each bin with enough answers."""
    parts = [_unpacked(row) for row in rows.itertuples()]
    sure, right = (np.concatenate(part) for part in zip(*parts, strict=True))
    place = _bins(sure)
    counts = np.bincount(place, minlength=BINS)
    kept = counts >= FEWEST
    x = np.bincount(place, sure, minlength=BINS)[kept] / counts[kept]
    y = np.bincount(place, right, minlength=BINS)[kept] / counts[kept]
    return 100 * x, 100 * y


TABLES = [
    Table(
        "calibration",
        table,
        of="calibration",
        title="How far probabilities of classes are from the share of right answers",
        key=("recording", "split", "n", "model"),
        note="Calibration error: the expected one, over ten bins of equal width (Guo et al., "
        "ICML 2017). By chance alone it is above zero: the last column has what it would be for "
        "perfect probabilities of so many test frames. Probabilities are fitted to the training "
        "frames, each scored as if it had not been learnt. As recorded: split by time, session "
        "or position. Brackets: Student over sensors or input fields; of one camera or sensor, "
        "the central 95 % of draws, none of fewer than ten.",
        columns=COLUMNS,
        shown=tuple(COLUMNS),
    )
]
FIGURES = [
    Plot(
        "calibration",
        draw,
        of="calibration",
        caption="Share of right answers against their probability, after most training frames; "
        "a row of panels a split, a column a recording. On the grey diagonal probabilities are "
        f"perfect; below it they promise too much. Points of fewer than {FEWEST} answers are "
        "left out.",
        size=(7.0, 4.2),
    )
]
