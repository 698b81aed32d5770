"""Drift and recalibration (Fig. 8(b)): accuracy regained in the new session, kept in the old."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import pandas as pd
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from experiments.records.rows import unpack_labels
from experiments.reporting import estimates, published
from experiments.reporting.columns import Column, display_name
from experiments.reporting.curves import errors, line_plot
from experiments.reporting.measured import ENDS
from experiments.reporting.plot import PAPER, literal, panel, star, style_of, wrapped
from experiments.reporting.study import Quantity, Study
from experiments.reporting.text import percent, points
from experiments.studies.drift.numbers import (
    N_NEW,
    UNLABELLED,
    best_updates,
    regained,
)
from experiments.studies.drift.sessions import SESSIONS, accuracies

STUDY = Study(
    "drift",
    "Drift and recalibration",
    "The sensor has drifted. How many new samples restore its accuracy, with labels and without, "
    "what is forgotten of the old session, and do the old samples add anything to the new?",
    5,
)
PAPERS = (0.5, 0.75)  # its p
PUBLISHED = ("stored", "recovered")
ORDERS = {"time": "new samples first in time", "random": "new samples at random"}
_SHOWN = (5, 20, N_NEW)  # N_new of the table's columns
_ZEROED = (1, 10, 30, 100)  # unlabelled frames
_WAY = ["order", "model", "update"]


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
        **{f"new_{n}": Column(f"New session, N_new = {n}, %", percent) for n in _SHOWN},
        **{f"old_{n}": Column(f"Old session, N_new = {n}, %", percent) for n in _SHOWN},
    },
    note="New samples alone are the paper's p = 1 for HDC. Intervals: Student, 95 %, over seeds, "
    "each a sensor. Equal votes: a new sample counts N_old/N_new times. From the old weights: the "
    "penalty is on the distance from them.",
)
def recalibration(
    rows: pd.DataFrame,
    config: Mapping[str, Any],
) -> pd.DataFrame:
    """Every model and update with labels, in both sessions."""
    by_seed = accuracies(rows)
    labelled = by_seed[~by_seed.method.isin(UNLABELLED)]
    return _by_size(rows, labelled, _SHOWN)


def _by_size(
    rows: pd.DataFrame, by_seed: pd.DataFrame, sizes: Sequence[int]
) -> pd.DataFrame:
    """A line for each way, with accuracies in both sessions for each N_new."""
    table = []
    for way, of_way in by_seed.groupby(_WAY, sort=False):
        line: dict[str, Any] = dict(zip(_WAY, way, strict=True))
        for n, at in of_way.groupby("n_new"):
            for session in SESSIONS:
                n_test = int(rows[f"n_test_{session}"].iloc[0])
                share = estimates.mean_share(at[session].tolist(), n_test)
                # A stored model stays what it is, however many new samples there are.
                for shown in [n] if n else sizes:
                    line |= share.columns(f"{session}_{shown}")
        table.append(line)
    return pd.DataFrame(table)


@STUDY.table(
    "drift_zeroed",
    of="drift",
    key=_WAY,
    title="Re-zeroing without labels, on {frames}",
    columns={
        "update": Column("Unlabelled frames"),
        "stored": Column("Not updated, %", percent),
        **{f"new_{n}": Column(f"{n} frames, %", percent) for n in _ZEROED},
    },
    note="Accuracy in the new session. Every frame is standardised and a reference frame is "
    "subtracted: of the training, the mean of its frames; after the drift, the mean of unlabelled "
    "new frames, which come before those tested; or both times the mean of frames in which nobody "
    "touches. Of HDC by its own recalibrate, of others alike. Intervals: Student, 95 %, over "
    "seeds.",
)
def zeroed(rows: pd.DataFrame, config: Mapping[str, Any]) -> pd.DataFrame | None:
    """Every model and choice of unlabelled frames; None of records without any."""
    by_seed = accuracies(rows)
    unlabelled = by_seed[by_seed.method.isin(UNLABELLED)]
    if not len(unlabelled):
        return None
    table = _by_size(rows, unlabelled, ())
    stored = _by_size(rows, by_seed[by_seed.method == "stored"], (0,))
    stored = stored.set_index(["order", "model"])
    for end in ENDS:
        of_way = zip(table.order, table.model, strict=True)
        table[f"stored{end}"] = [stored.loc[way, f"new_0{end}"] for way in of_way]
    sizes = [f"new_{n}" for n in _ZEROED if f"new_{n}" in table]
    table.attrs["shown"] = ("model", "update", "stored", *sizes)
    return table


@STUDY.table(
    "drift_regained",
    of="drift",
    key=("model", "labels"),
    title="What the drift costs, and what every model's best update regains, on {frames}",
    shown=(
        "model", "labels", "update", "n_new", "before", "stored", "updated", "lost", "regained",
    ),
    columns={
        "labels": Column("Labels", lambda needed: "yes" if needed else "no"),
        "update": Column("Update"),
        "n_new": Column("New frames"),
        "before": Column("Before the drift, %", percent),
        "stored": Column("After it, %", percent),
        "updated": Column("Updated, %", percent),
        "lost": Column("Lost, points", points),
        "regained": Column("Regained of it, %", percent),
    },
    note=f"Best: the highest mean on the test frames, which favours it, with at most {N_NEW} "
    "labelled frames, or without labels and with all classes alike or nobody touching. New frames "
    "come before those tested. Regained: gain over loss, a ratio of means. Intervals: Student, "
    "95 %, over seeds.",
)  # fmt: skip
def best(rows: pd.DataFrame, config: Mapping[str, Any]) -> pd.DataFrame:
    """A row a model, with labels and without."""
    return best_updates(regained(rows))


# Updates of HDC: Okabe and Ito's colours; the paper's scheme from light to dark as p grows.
_OF_HDC = ("#F3C19B", "#E8924F", "#D55E00", "#7A3600", "#009E73", "0.45")
_MARKERS = "osD^vX"
_NOT_UPDATED: Any = {"color": "0.5", "lw": 0.8, "ls": (0, (4, 3))}


def shown_ways(by_seed: pd.DataFrame) -> list[tuple[str, str]]:
    """Models and updates that the figure shows: of HDC every one, of each other model the one that
    is best in the new session after N_NEW samples of it; none of those updated without labels."""
    without = by_seed[by_seed.method.isin(UNLABELLED)].model.unique()
    updated = by_seed[(by_seed.method != "stored") & ~by_seed.model.isin(without)]
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
    caption="Accuracy in the new and in the old session after an update with N_new samples, "
    "on {frames} (Fig. 8(b)): HDC by every update, others by the one that is best on "
    f"these test frames of the new session after {N_NEW} samples, which favours them; bars: 95 % "
    "over seeds.",
)
def fig8(
    figure: Figure,
    rows: pd.DataFrame,
    config: Mapping[str, Any],
) -> None:
    """(a) the new session, (b) the old one, both against N_new."""
    first_order = rows[rows.order == rows.order.iloc[0]]
    by_seed = accuracies(first_order)
    by_seed["way"] = by_seed["model"] + "; " + by_seed["update"]
    looks = {}
    for k, (model, update) in enumerate(shown_ways(by_seed)):
        looks[f"{model}; {update}"] = _look(model, update, k)
    order = list(looks)
    panels = figure.subplots(2, 1, sharex=True)
    for axes, session, letter in zip(panels, SESSIONS, "ab", strict=True):
        shown = by_seed[by_seed.way.isin(looks)]
        shown = shown.assign(percent=100 * shown[session])
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
            100 * stored[session].mean(),
            zorder=0,
            **_NOT_UPDATED,
        )
        lowest = min(shown.percent.min(), 100 * stored[session].min())
        axes.set(ylim=(lowest - 4, 103), ylabel="accuracy (%)")
        panel(axes, letter, f"test samples of the {session} session")
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
    handles.append(Line2D([], [], label="HDC: not updated", **_NOT_UPDATED))
    axes.set(xscale="log", xlabel="samples of the new session, $N^{new}$")
    sizes = sorted(set(by_seed[by_seed.way.isin(looks)].n_new) - {0})
    axes.set_xticks(sizes, map(str, sizes))
    axes.set_xticks([], minor=True)
    figure.legend(handles=handles, loc="outside lower center", ncols=1)


# How the figure of re-zeroing shows a way: marker and whether it is filled.
_WAYS = {
    ("stored", "not updated"): ("o", False),
    ("zeroed", "re-zeroed, all classes alike"): ("o", True),
    ("zeroed", "re-zeroed, 60 % of one class"): ("^", True),
    ("zeroed", "re-zeroed, one class only"): ("x", True),
    ("untouched", "re-zeroed, nobody touches"): ("s", True),
    ("new", "new samples alone"): ("*", True),
}
_AT = {"zeroed": 30, "untouched": 10, "new": N_NEW, "stored": 0}  # new frames


_FRAMES = {
    "zeroed": "unlabelled frames by which it is re-zeroed",
    "untouched": "frames in which nobody touches",
    "new": "labelled frames of the new samples alone",
}


def _caption_of_zeroed(rows: pd.DataFrame, config: Mapping[str, Any]) -> str:
    """What is drawn, with the number of frames of each update that was measured."""
    counts = [
        f"{_AT[method]} {words}"
        for method, words in _FRAMES.items()
        if (rows.method == method).any()
    ]
    return (
        "Accuracy in the new session without and with an update that needs no labels, on "
        f"{{frames}}: {', '.join(counts)}. Dashed: chance; bars: 95 % over seeds."
    )


@STUDY.figure(
    "drift_zeroed",
    of="drift",
    size=(3.4, 3.4),
    needs=lambda rows, config: bool(rows.method.isin(UNLABELLED).any()),
    caption=_caption_of_zeroed,
)
def fig_zeroed(
    figure: Figure,
    rows: pd.DataFrame,
    config: Mapping[str, Any],
) -> None:
    """A row a model, a marker an update."""
    every = accuracies(rows)
    every = every[every.order == "time"]
    models = list(every[every.method == "zeroed"].model.unique())
    axes = figure.subplots()
    handles = []
    for k, ((method, update), (marker, filled)) in enumerate(_WAYS.items()):
        of_way = every[(every.method == method) & (every["update"] == update)]
        of_way = of_way[of_way.n_new == _AT[method]]
        shown = [model for model in models if model in set(of_way.model)]
        if not shown:
            continue
        found = []
        for model in shown:
            shares = of_way[of_way.model == model].new.tolist()
            found.append(estimates.mean_interval(shares).within(0, 1))
        values, spread = errors(found, 100)
        colour = _OF_HDC[k] if k else "0.3"
        look: dict[str, Any] = {"color": colour, "marker": marker, "ms": 4}
        look["mfc"] = colour if filled else "white"
        apart = 0.1 * (k - len(_WAYS) / 2)
        places = [models.index(model) + apart for model in shown]
        axes.errorbar(values, places, xerr=spread, ls="", elinewidth=0.5, **look)
        handles.append(Line2D([], [], ls="", label=update, **look))
    names = [wrapped(display_name(model), 22) for model in models]
    axes.set_yticks(range(len(models)), names)
    axes.invert_yaxis()
    labels = unpack_labels(rows.labels.dropna().iloc[0])
    chance = 100 / len(set(labels.tolist()))
    axes.axvline(chance, color="0.5", lw=0.8, ls=(0, (4, 3)), zorder=0)
    axes.text(chance, -0.45, " chance", fontsize=5.5, color="0.4")
    axes.set(xlim=(0, 102), xlabel="accuracy in the new session (%)")
    figure.legend(handles=handles, loc="outside lower center", ncols=2)


@STUDY.quantities(of="drift")
def quantities(
    rows: pd.DataFrame,
    config: Mapping[str, Any],
) -> Iterator[Quantity]:
    """Fig. 8(b): accuracy of HDC in the new session before and after an update with N_new = 50, the
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
