"""Accuracy that is left under disturbances, as a table and a figure."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from experiments.reporting.columns import Column, display_name
from experiments.reporting.estimates import Estimate, mean_share
from experiments.reporting.plot import bars, errors, handle
from experiments.reporting.study import Study
from experiments.reporting.text import size

STUDY = Study(
    "robustness",
    "Robustness",
    "How much accuracy is left when the frames are disturbed after training, or bits of the stored "
    "model flip? Does hyperdimensional computing tolerate the faults it is said to tolerate?",
    9.5,
)
FLIPS = ("bit_flips", "bit_flips_int8")
# Name of a disturbance, unit of its level, and the number of units in a level of 1.
LEVELS = {
    "none": ("none", "", 1),
    "power": ("laser power ±", "%", 100),
    "dead_pixels": ("dead pixels", "%", 100),
    "shift": ("camera shifted", "px", 1),
    "bit_flips": ("bit error rate", "", 1),
    "bit_flips_int8": ("bit error rate, 8-bit numbers", "", 1),
}


def accuracies(rows: pd.DataFrame) -> pd.DataFrame:
    """Accuracy by ``disturbance``, ``level`` and ``model``, mean over seeds.

    Bounds are Student's interval over seeds. A flipped bit can ruin all predictions of a seed at
    once, so of flips they are the lowest and the highest seed.
    """
    table = []
    keys = ["disturbance", "level", "model"]
    for key, same in rows.groupby(keys, sort=False):
        shares = (same.right / same.n_test).astype(float)
        # The mean of equal shares may differ from them in the last digit.
        mean = float(np.clip(shares.mean(), shares.min(), shares.max()))
        estimate = Estimate(mean, shares.min(), shares.max())
        if key[0] not in FLIPS:
            estimate = mean_share(shares.groupby(same.seed).mean().tolist(), same.n_test.iloc[0])
        table.append({**dict(zip(keys, key, strict=True)), **estimate.columns("accuracy")})
    return pd.DataFrame(table)


NOTE = (
    "Laser power: another factor for every frame. Dead pixels read zero, the same in all frames. "
    "In brackets: Student, 95 %, over seeds; of bit error rates the lowest and the highest draw. "
    "Bit error rate: of the bytes of every stored tensor but the labels of nearest neighbour. "
    "8-bit numbers: every float32 was rounded to one of 255 equal steps before."
)


def _level(row: Mapping[str, Any]) -> str:
    """A level with its unit; nothing where there is no disturbance."""
    _, unit, units = LEVELS[row["disturbance"]]
    return "" if row["disturbance"] == "none" else f"{row['level'] * units:g} {unit}".strip()


@STUDY.table(
    "robustness", of="robustness",
    title="Test accuracy, %, when something goes wrong after training, on {frames}",
    columns={
        "disturbance": Column("Disturbance", lambda name: LEVELS[name][0]),
        "level": Column("Level", cell=_level),
    },
)  # fmt: skip
def disturbed(rows: pd.DataFrame, config: Mapping[str, Any]) -> pd.DataFrame:
    """Accuracy of each model, a column, under each disturbance."""
    columns = {f"accuracy{end}": end for end in ("", "_low", "_high")}
    wide = accuracies(rows).pivot(
        index=["disturbance", "level"], columns="model", values=list(columns)
    )
    order = list(dict.fromkeys(zip(rows.disturbance, rows.level, strict=True)))
    wide = wide.reindex(order)
    wide.columns = [f"{model}{columns[name]}" for name, model in wide.columns]
    models = list(rows.model.unique())
    table = wide[[f"{model}{end}" for model in models for end in columns.values()]].reset_index()
    sizes = rows.groupby("model", sort=False).model_bytes.first()
    stored = "; ".join(f"{display_name(str(m))} {size(int(n))}" for m, n in sizes.items())
    stops = config.get("stops", {})
    early = [m for m in models if stops.get(m, {}).get("reached_after_s") is not None]
    stopped = ", ".join(map(display_name, early)) or "none"
    table.attrs["note"] = f"{NOTE} Stored: {stored}. Stopped at 90 % in training: {stopped}."
    return table


@STUDY.figure(
    "robustness", of="robustness", size=(3.4, 4.8),
    caption="Test accuracy against the bit error rate of the stored model, on {frames}. Bars: "
    "lowest to highest seed; dashed: chance.",
)  # fmt: skip
def figure(figure: Figure, rows: pd.DataFrame, config: Mapping[str, Any]) -> None:
    """Accuracy against bit error rate, of models as they are stored and with 8 bits a number."""
    means, models = accuracies(rows), list(rows.model.unique())
    rates = sorted({0.0, *means.level[means.disturbance.isin(FLIPS)]})
    for axes, name, text in zip(
        figure.subplots(2, 1, sharex=True), FLIPS,
        ("as stored: float32, bits, counters", "the same, but 8 bits for each float32"),
        strict=True,
    ):  # fmt: skip
        for k, model in enumerate(models):
            of_model = means[means.model == model]
            # A model that stores no floating-point numbers has its bits as they are in both.
            shown = name if (of_model.disturbance == name).any() else FLIPS[0]
            flipped = (of_model.disturbance == shown) & (of_model.level > 0)
            points = of_model[flipped | (of_model.disturbance == "none")]
            values = points[["accuracy", "accuracy_low", "accuracy_high"]].to_numpy()
            y, spread = errors([Estimate(*row) for row in values], 100)
            # A place for every rate: most of what matters lies above 0.1.
            x = [rates.index(rate) + 0.06 * (k - len(models) / 2) for rate in points.level]
            bars(axes, model, x, y, spread, elinewidth=0.4)
        axes.text(0.01, 3, text, transform=axes.get_yaxis_transform(), fontsize=6)
        axes.axhline(100 / rows.n_classes.iloc[0], color="0.5", lw=0.7, ls=(0, (4, 3)), zorder=0)
        axes.set(ylabel="test accuracy (%)", ylim=(0, 104))
    labels = [f"{rate:g}" if rate >= 1e-3 or not rate else f"{rate:.0e}" for rate in rates]
    axes.set_xticks(range(len(rates)), labels, rotation=90)
    axes.set_xlabel("bit error rate of the stored model")
    figure.legend(handles=list(map(handle, models)), loc="outside lower center", ncols=2)
