"""Drift and recalibration (Fig. 8(b)): accuracy recovered in the new room and kept in the old."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import pandas as pd
from matplotlib.figure import Figure

from experiments.reporting import estimates, published
from experiments.reporting.columns import Column, display_name
from experiments.reporting.plot import PAPER, line_plot, literal, panel, star, style_of
from experiments.reporting.study import Quantity, Study
from experiments.reporting.text import percent

STUDY = Study(
    "drift",
    "Drift and recalibration",
    "After 16 days the sensor has drifted. How many new samples restore its accuracy, what is "
    "forgotten of the old room, and do the old samples add anything to the new?",
    5,
)
N_NEW = 50  # at which the paper reports the recovered accuracy
PAPERS = (0.5, 0.75)  # its p
PUBLISHED = ("stored", "recovered")
ORDERS = {"time": "new samples first in time", "random": "new samples at random"}
UPDATES = {
    "stored": "not updated",
    "new": "new samples alone",
    "replace": "bits replaced, p = {:g}",
    "pooled": "old and new together",
    "balanced": "old and new, equal votes",
    "from_old": "new, from the old weights",
}
ROOMS = ("new", "old")
_SHOWN = (5, 20, N_NEW)  # N_new of the table's columns
_WAY = ["order", "model", "update"]


def accuracies(rows: pd.DataFrame) -> pd.DataFrame:
    """Accuracy of each sensor, mean over draws.

    Returns:
        DataFrame: ``order``, ``model``, ``method``, ``p``, ``update`` (both in words), ``n_new`` (0
        for the stored model), ``seed``; accuracies ``new`` and ``old`` by room.
    """
    ways = zip(rows.method, rows.p, strict=True)
    shares = rows.assign(
        new=rows.right_new / rows.n_test_new,
        old=rows.right_old / rows.n_test_old,
        update=[UPDATES[method].format(p) for method, p in ways],
    )
    keys = ["order", "model", "method", "p", "update", "n_new", "seed"]
    by_seed = shares.groupby(keys, sort=False, dropna=False)
    return by_seed[list(ROOMS)].mean().reset_index()


@STUDY.table(
    "drift",
    of="drift",
    key=_WAY,
    title="Recalibration and training again, on {frames}",
    shown=(
        "order",
        "model",
        "update",
        *(f"new_{n}" for n in _SHOWN),
        f"old_{_SHOWN[0]}",
        f"old_{N_NEW}",
    ),
    columns={
        "order": Column("Order", lambda order: ORDERS[order]),
        "update": Column("Trained on"),
        **{f"new_{n}": Column(f"New room, N_new = {n}, %", percent) for n in _SHOWN},
        **{f"old_{n}": Column(f"Old room, N_new = {n}, %", percent) for n in _SHOWN},
    },
    note="New samples alone are the paper's p = 1 for HDC. Intervals: Student, 95 %, over seeds, "
    "each a sensor. Equal votes: a new sample counts N_old/N_new times. From the old weights: the "
    "penalty is on the distance from them.",
)
def recalibration(
    rows: pd.DataFrame,
    config: Mapping[str, Any],
) -> pd.DataFrame:
    """Every model and update, in both rooms."""
    table = []
    for way, of_way in accuracies(rows).groupby(_WAY, sort=False):
        line: dict[str, Any] = dict(zip(_WAY, way, strict=True))
        for n, at in of_way.groupby("n_new"):
            for room in ROOMS:
                n_test = int(rows[f"n_test_{room}"].iloc[0])
                share = estimates.mean_share(at[room].tolist(), n_test)
                # A stored model stays what it is, however many new samples there are.
                for shown in [n] if n else _SHOWN:
                    line |= share.columns(f"{room}_{shown}")
        table.append(line)
    return pd.DataFrame(table)


# Updates of HDC: Okabe and Ito's colours; the paper's scheme from light to dark as p grows.
_OF_HDC = ("#F3C19B", "#E8924F", "#D55E00", "#7A3600", "#009E73", "0.45")
_MARKERS = "osD^vX"


def shown_ways(by_seed: pd.DataFrame) -> list[tuple[str, str]]:
    """Models and updates that the figure shows: of HDC every one, of each other model the one that
    is best in the new room after :data:`N_NEW` samples of it."""
    updated = by_seed[by_seed.method != "stored"]
    at = updated[updated.n_new == N_NEW]
    of_hdc = at[at.model == "hdc"].sort_values(["p", "update"])
    ways = [("hdc", update) for update in of_hdc["update"].unique()]
    others = at[at.model != "hdc"].groupby(["model", "update"], sort=False)
    means = others.new.mean()
    for _, of_model in means.groupby("model", sort=False):
        ways.append(of_model.idxmax())
    return ways


def _look(
    model: str,
    update: str,
    k: int,
) -> dict[str, Any]:
    """How a way is drawn, the k-th of its model."""
    label = literal(f"{display_name(model)}: {update}")
    colour, marker, line = style_of(model)
    if model == "hdc":
        colour = _OF_HDC[k % len(_OF_HDC)]
        marker = _MARKERS[k % len(_MARKERS)]
        line = "-"
    return {
        "label": label,
        "color": colour,
        "marker": marker,
        "ls": line,
    }


@STUDY.figure(
    "fig8_drift",
    of="drift",
    size=(3.4, 6.6),
    caption="Accuracy in the new and in the old room after an update with N_new samples, "
    "on {frames} (Fig. 8(b)): HDC by every update, others by their best; dashed grey: HDC, "
    "not updated; 95 % intervals over seeds.",
)
def fig8(
    figure: Figure,
    rows: pd.DataFrame,
    config: Mapping[str, Any],
) -> None:
    """(a) the new room, (b) the old one, both against N_new."""
    first_order = rows[rows.order == rows.order.iloc[0]]
    by_seed = accuracies(first_order)
    by_seed["way"] = by_seed["model"] + "; " + by_seed["update"]
    looks = {}
    for k, (model, update) in enumerate(shown_ways(by_seed)):
        looks[f"{model}; {update}"] = _look(model, update, k)
    order = list(looks)
    panels = figure.subplots(2, 1, sharex=True)
    for axes, room, letter in zip(panels, ROOMS, "ab", strict=True):
        shown = by_seed[by_seed.way.isin(looks)]
        shown = shown.assign(percent=100 * shown[room])
        shown = shown.sort_values("way", key=lambda ways: ways.map(order.index))
        handles = line_plot(
            axes,
            shown,
            "n_new",
            "percent",
            by="way",
            looks=looks,
        )
        stored = by_seed.query("model == 'hdc' and method == 'stored'")
        axes.axhline(
            100 * stored[room].mean(),
            color="0.5",
            lw=0.8,
            ls=(0, (4, 3)),
            zorder=0,
        )
        axes.set(ylim=(15, 103), ylabel="accuracy (%)")
        panel(axes, letter, f"test samples of the {room} room")
    if set(rows.origin) == {"simulated"}:  # at the left edge: with no N_new
        across = panels[0].get_yaxis_transform()
        numbers = [
            published.numbers()[f"drift/{name}_accuracy"].value for name in PUBLISHED
        ]
        panels[0].plot(
            0.015,
            numbers[0],
            zorder=5,
            transform=across,
            **PAPER,
        )
        panels[0].plot(
            N_NEW,
            numbers[1],
            zorder=5,
            **PAPER,
        )
        handles.append(star("paper: p = 0; p = 0.5 or 0.75"))
    axes.set(xscale="log", xlabel="samples of the new room, $N^{new}$")
    sizes = sorted(set(by_seed.n_new) - {0})
    axes.set_xticks(sizes, map(str, sizes))
    axes.set_xticks([], minor=True)
    figure.legend(handles=handles, loc="outside lower center", ncols=1)


@STUDY.quantities(of="drift")
def quantities(
    rows: pd.DataFrame,
    config: Mapping[str, Any],
) -> Iterator[Quantity]:
    """Fig. 8(b): accuracy of HDC in the new room before and after an update with N_new = 50, the
    mean of p = 0.5 and 0.75, for which the paper has one number."""
    order = rows.order.iloc[0]
    n_test = int(rows.n_test_new.iloc[0])
    of_hdc = rows[rows.model == "hdc"]
    by_seed = accuracies(of_hdc[of_hdc.order == order])
    after = by_seed[by_seed.n_new == N_NEW]
    found = (
        by_seed[by_seed.method == "stored"],
        after[after.p.isin(PAPERS)],
    )
    for name, ways in zip(PUBLISHED, found, strict=True):
        values = ways.groupby("seed").new.mean().tolist()
        if values:
            least = estimates.least_variance(values, n_test)
            yield Quantity.of(
                f"drift/{name}_accuracy",
                estimates.one_sensor(values, least).within(0, 1),
                estimates.ONE_SENSOR,
                100,
                n=n_test * len(values),
                seeds=len(values),
                note=ORDERS[order] if name == "recovered" else "",
            )
