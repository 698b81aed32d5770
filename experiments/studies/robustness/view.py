"""Accuracy that is left under disturbances."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from functools import partial
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from experiments.records.results import by_scene
from experiments.reporting.columns import Column, display_name, scene_name
from experiments.reporting.curves import errors
from experiments.reporting.estimates import Estimate, mean_share
from experiments.reporting.measured import each_scene
from experiments.reporting.plot import head, literal, look_of, panel, wrapped
from experiments.reporting.study import Plot, Study
from experiments.reporting.table import Table
from experiments.reporting.text import percent

FLIPS = ("bit_flips", "query_flips")
# Columns of the table, by disturbance and level.
_HEADS = {
    "none_0": "Undisturbed, %",
    "dither_1": "±1 grey level, %",
    "shift_1": "Shifted by a pixel, %",
    "query_flips_0.1": "10 % of query bits flipped, %",
    "bit_flips_0.1": "10 % of stored bits flipped, %",
    "bit_flips_int8_0.1": "of 8-bit weights, %",
}
# Panels of the figure: disturbance, label of its axis, title, and the units in a level of 1.
_PANELS = (
    ("dither", "dither (± grey levels)", "rounding", 1),
    ("shift", "shift (pixels)", "camera shifted", 1),
    ("query_flips", "flipped bits (%)", "query bits flipped", 100),
    ("bit_flips", "flipped bits (%)", "stored bits flipped", 100),
)
# Models of the figure; those of HDC have one colour elsewhere. Floats are stored in 8 bits.
_COLOURS = {
    "hdc": "#E8924F",
    "hdc_levels_lda": "#D55E00",
    "bits_chosen": "#7A3600",
    "softmax_dual": "#332288",
}
_LEAST = 0.05  # percent of flipped bits, where none is drawn


def accuracies(rows: pd.DataFrame) -> pd.DataFrame:
    """Accuracy of each model, a column per disturbance and level, mean over seeds.

    Bounds are Student's interval over seeds. A flipped bit can ruin all predictions of a seed at
    once, so of flips they are the lowest and the highest seed.
    """
    table = []
    for model, of_model in rows.groupby("model", sort=False):
        line: dict[str, Any] = {"model": model}
        for name, level, estimate in _estimates(of_model):
            line |= estimate.columns(f"{name}_{level:g}")
        table.append(line)
    return pd.DataFrame(table)


def _estimates(rows: pd.DataFrame) -> Iterator[tuple[str, float, Estimate]]:
    """Each disturbance and level of a model, and the accuracy that is left."""
    by = ["disturbance", "level"]
    for (name, level), same in rows.groupby(by, sort=False):
        shares = (same.right / same.n_test).astype(float)
        # The mean of equal shares may differ from them in the last digit.
        mean = float(np.clip(shares.mean(), shares.min(), shares.max()))
        estimate = Estimate(mean, shares.min(), shares.max())
        if not name.startswith(FLIPS):
            by_seed = shares.groupby(same.seed).mean()
            estimate = mean_share(by_seed.tolist(), same.n_test.iloc[0])
        yield name, level, estimate


def _note(rows: pd.DataFrame) -> str:
    """How to read the table, and which models were stopped at 90 % in training."""
    early: dict[str, None] = {}
    for config in rows.config.drop_duplicates():
        for model, stop in (config.get("stops") or {}).items():
            if stop.get("reached_after_s") is not None:
                early[display_name(model)] = None
    return f"{_NOTE} Stopped at 90 % in training: {', '.join(early) or 'none'}."


_NOTE = (
    "±1 grey level: −1, 0 or 1 added to each pixel, as another conversion to grey may. Query bits: "
    "of the hypervector of HDC, of the pixels of a frame of others. Stored bits: of every stored "
    "tensor, of LDA except its scale and offset per class. 8-bit weights: every float32 was "
    "rounded to one of 255 equal steps before. In brackets: Student, 95 %, over seeds, Wilson for "
    "one seed; of flips the lowest and the highest seed. Forms that take long to train have fewer "
    "seeds. –: not measured yet. The CSV has every level, and another laser power for every frame "
    "and dead pixels."
)


def curves(figure: Figure, rows: pd.DataFrame) -> None:
    """A row per scene, a column per disturbance, a line per model."""
    scenes = by_scene(drawn(rows))
    figure.set_size_inches(7.0, 1.2 + 1.35 * len(scenes))
    grid = figure.subplots(len(scenes), len(_PANELS), sharey=True, squeeze=False)
    for line, (scene, of_scene) in zip(grid, scenes.items(), strict=True):
        chance = 100 / of_scene.n_classes.iloc[0]
        for axes, (kind, _, _, units) in zip(line, _PANELS, strict=True):
            for model in _COLOURS:
                of_model = of_scene[of_scene.model == model]
                _curve(axes, model, _series(of_model, kind), units)
            if not axes.lines:
                axes.text(
                    0.5, 0.5, "not measured yet", ha="center", transform=axes.transAxes
                )
            axes.axhline(chance, color="0.5", lw=0.8, ls=(0, (4, 3)), zorder=0)
            axes.set_ylim(0, 103)
            _axis(axes, kind)
        line[0].set_ylabel(f"{wrapped(scene_name(str(scene)), 22)}\naccuracy (%)")
    for top, bottom, letter, (_, label, title, _) in zip(
        grid[0], grid[-1], "abcd", _PANELS, strict=True
    ):
        panel(top, letter, title)
        bottom.set_xlabel(label)
    handles = _handles(grid.ravel())
    figure.legend(handles=handles, loc="outside lower center", ncols=len(handles))
    details = ["dashed: chance; bars: lowest to highest seed of flips, else 95 %"]
    head(figure, "Accuracy under disturbances after training, by scene", details)


def _handles(panels: Iterable[Axes]) -> list[Any]:
    """One entry of the legend per model that some panel shows."""
    found: dict[str, Any] = {}
    for axes in panels:
        handles, labels = axes.get_legend_handles_labels()
        found = dict(zip(labels, handles, strict=True)) | found
    names = [literal(display_name(model)) for model in _COLOURS]
    return [found[name] for name in names if name in found]


def _series(rows: pd.DataFrame, kind: str) -> list[tuple[str, float, Estimate]]:
    """A model without the disturbance and with each level of it; of floats, stored in 8 bits."""
    of_int8 = rows[rows.disturbance == f"{kind}_int8"]
    if len(of_int8):
        return list(_estimates(of_int8))
    return list(_estimates(rows[rows.disturbance.isin(("none", kind))]))


def drawn(rows: pd.DataFrame) -> pd.DataFrame:
    """Rows of scenes on which some model has errors without a disturbance; else of all scenes."""
    told = rows.groupby("scene").filter(lambda of_scene: not _is_full(of_scene))
    return told if len(told) else rows


def _is_full(rows: pd.DataFrame) -> bool:
    """Whether every model is right on all undisturbed frames."""
    clean = rows[rows.disturbance == "none"]
    return bool((clean.right == clean.n_test).all())


def _curve(
    axes: Axes, model: str, found: list[tuple[str, float, Estimate]], units: float
) -> None:
    """Accuracy of a model against the level of a disturbance, from none; from 0.1 % of flips."""
    found = [one for one in found if one[1] == 0 or units * one[1] >= 0.1]
    if len(found) < 2:  # undisturbed alone
        return
    places = units * np.array([level for _, level, _ in found])
    values, spread = errors([estimate for *_, estimate in found], 100)
    if units > 1:
        places = np.maximum(places, _LEAST)
    look: dict[str, Any] = {**look_of(model), "color": _COLOURS[model]}
    look |= {"mfc": None, "label": literal(display_name(model))}
    axes.errorbar(places, values, yerr=spread, lw=0.9, elinewidth=0.5, **look)


def _axis(axes: Axes, kind: str) -> None:
    """The axis of levels: whole numbers, or percent of flipped bits."""
    if kind not in FLIPS:
        axes.xaxis.set_major_locator(MaxNLocator(4, integer=True))
        return
    axes.set_xscale("log")
    axes.set_xticks([_LEAST, 0.1, 1, 10, 30], ["0", "0.1", "1", "10", "30"])
    axes.set_xticks([], minor=True)
    axes.set_xlim(_LEAST / 1.3, 40)


STUDY = Study(
    "robustness",
    "Robustness",
    "How much accuracy remains when frames are disturbed after training, or bits of the "
    "stored model flip?",
    9.5,
    tables=[
        Table(
            "robustness",
            partial(each_scene, accuracies),
            of="robustness",
            key=("scene", "model"),
            title="Test accuracy under disturbances after training",
            shown=("scene", "model", *_HEADS),
            columns={
                "scene": Column("Scene", scene_name),
                **{name: Column(head, percent) for name, head in _HEADS.items()},
            },
            note=_note,
        )
    ],
    figures=[
        Plot(
            "robustness",
            curves,
            of="robustness",
            caption="Accuracy that remains, one row per scene on which not every model is right. "
            "(a): dither of the test frames. (b): the camera has moved. (c): flips of "
            "bits of the query. (d): flips of bits of the stored model, whose weights "
            "have 8 bits. Left: undisturbed. Bars: lowest to highest seed of flips, else "
            "95 % intervals.",
        )
    ],
)
