"""Drift and recalibration (Fig. 8(b)): accuracy regained in the new session, kept in the old."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import partial
from typing import Any

import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from experiments.records.rows import unpack_labels
from experiments.reporting import estimates, published
from experiments.reporting.columns import Column, display_name, scene_name
from experiments.reporting.curves import errors, line_plot
from experiments.reporting.measured import ENDS, each_scene
from experiments.reporting.plot import (
    LETTERS,
    PAPER,
    literal,
    panel,
    star,
    style_of,
    wrapped,
)
from experiments.reporting.study import (
    WIDTH,
    FigureOf,
    NumbersOf,
    Quantity,
    Study,
    TableOf,
)
from experiments.reporting.text import percent, points
from experiments.studies.drift.numbers import (
    N_NEW,
    UNLABELLED,
    best_updates,
    regained,
)
from experiments.studies.drift.sessions import SESSIONS, accuracies

PAPERS = (0.5, 0.75)  # its p
PUBLISHED = ("stored", "recovered")
ORDERS = {"time": "new samples first in time", "random": "new samples at random"}
_SHOWN = (5, 20, N_NEW)  # N_new of the table's columns
_ZEROED = (1, 10, 30, 100)  # unlabelled frames
_WAY = ["order", "model", "update"]


def recalibration(rows: pd.DataFrame) -> pd.DataFrame:
    """Every model and update with labels, in both sessions of a scene."""
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


def zeroed(rows: pd.DataFrame) -> pd.DataFrame:
    """Every model and choice of unlabelled frames of a scene; empty without any."""
    by_seed = accuracies(rows)
    unlabelled = by_seed[by_seed.method.isin(UNLABELLED)]
    if not len(unlabelled):
        return unlabelled
    table = _by_size(rows, unlabelled, ())
    stored = _by_size(rows, by_seed[by_seed.method == "stored"], (0,))
    stored = stored.set_index(["order", "model"])
    for end in ENDS:
        of_way = zip(table.order, table.model, strict=True)
        table[f"stored{end}"] = [stored.loc[way, f"new_0{end}"] for way in of_way]
    return table


def _shown_of_zeroed(table: pd.DataFrame) -> tuple[str, ...]:
    sizes = [f"new_{n}" for n in _ZEROED if f"new_{n}" in table]
    return ("scene", "model", "update", "stored", *sizes)


def best(rows: pd.DataFrame) -> pd.DataFrame:
    """A row a model of a scene, with labels and without."""
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


def fig8(
    figure: Figure,
    rows: pd.DataFrame,
) -> None:
    """(a) the new session, (b) the old one, both against N_new; of the paper's scene."""
    rows = paper_scene(rows)
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


def paper_scene(rows: pd.DataFrame) -> pd.DataFrame:
    """The rows on the experiment's own scene, which is the paper's; of the first one without."""
    own = rows[~rows.elsewhere.astype(bool)]
    return own if len(own) else rows[rows.scene == rows.scene.iloc[0]]


# How the figure of re-referencing shows an update: its method, the share of one class among the
# frames (None: all classes alike), marker, and whether the marker is filled.
_WAYS = (
    ("stored", None, "o", False),
    ("zeroed", None, "o", True),
    ("zeroed", 0.6, "^", True),
    ("zeroed", 1.0, "x", True),
    ("untouched", None, "s", True),
    ("new", None, "*", True),
)
_AT = {"zeroed": 30, "untouched": 10, "new": N_NEW, "stored": 0}  # new frames


def draw_zeroed(figure: Figure, rows: pd.DataFrame) -> None:
    """A panel a scene, a row a model, a marker an update."""
    found = {}
    for scene, of_scene in rows.groupby("scene", sort=False):
        every = accuracies(of_scene)
        every = every[every.order == "time"]
        if (every.method == "zeroed").any():
            found[str(scene)] = every
    panels = figure.subplots(len(found), 1, squeeze=False, sharex=True)[:, 0]
    figure.set_size_inches(WIDTH, 0.9 + 1.35 * len(found))
    handles: dict[str, Line2D] = {}
    for axes, letter, (scene, every) in zip(
        panels, LETTERS, found.items(), strict=False
    ):
        handles |= _draw_updates(axes, every)
        panel(axes, letter, literal(scene_name(scene)))
        labels = unpack_labels(rows[rows.scene == scene].labels.dropna().iloc[0])
        chance = 100 / len(set(labels.tolist()))
        axes.axvline(chance, color="0.5", lw=0.8, ls=(0, (4, 3)), zorder=0)
    panels[-1].set(xlim=(0, 102), xlabel="accuracy in the new session (%)")
    where: Any = {"loc": "outside lower center", "ncols": 2}
    look: Any = {"color": "0.5", "lw": 0.8, "ls": (0, (4, 3))}
    chance_of_all = Line2D([], [], label="chance", **look)
    figure.legend(handles=[*handles.values(), chance_of_all], **where)


def _draw_updates(axes: Axes, every: pd.DataFrame) -> dict[str, Line2D]:
    """Accuracies of the models of one scene after each update; entries of a legend by update."""
    models = list(every[every.method == "zeroed"].model.unique())
    handles = {}
    for k, (method, share, marker, filled) in enumerate(_WAYS):
        of_share = every.share.isna() if share is None else every.share == share
        of_way = every[
            (every.method == method) & of_share & (every.n_new == _AT[method])
        ]
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
        update = str(of_way["update"].iloc[0])
        handles[update] = Line2D([], [], ls="", label=update, **look)
    names = [wrapped(display_name(model), 22) for model in models]
    axes.set_yticks(range(len(models)), names)
    axes.invert_yaxis()
    return handles


def quantities(
    rows: pd.DataFrame,
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


STUDY = Study(
    "drift",
    "Drift and recalibration",
    "The sensor has drifted. How many new samples restore its accuracy, with labels and without, "
    "what is forgotten of the old session, and do the old samples add anything to the new?",
    5,
    tables=[
        TableOf(
            "drift",
            partial(each_scene, recalibration),
            of="drift",
            key=["scene", *_WAY],
            title="Recalibration and training again",
            shown=(
                "scene",
                "order",
                "model",
                "update",
                *(f"new_{n}" for n in _SHOWN),
                f"old_{_SHOWN[0]}",
                f"old_{N_NEW}",
            ),
            columns={
                "scene": Column("Scene", scene_name),
                "order": Column("Order", lambda order: ORDERS[order]),
                "update": Column("Trained on"),
                **{
                    f"new_{n}": Column(f"New session, N_new = {n}, %", percent)
                    for n in _SHOWN
                },
                **{
                    f"old_{n}": Column(f"Old session, N_new = {n}, %", percent)
                    for n in _SHOWN
                },
            },
            note="New samples alone are the paper's p = 1 for HDC. Intervals: Student, 95 %, "
            "over seeds, each a sensor. Equal votes: a new sample counts N_old/N_new times. From "
            "the old weights: the penalty is on the distance from them.",
        ),
        TableOf(
            "drift_zeroed",
            partial(each_scene, zeroed),
            of="drift",
            key=["scene", *_WAY],
            title="Re-zeroing without labels",
            columns={
                "scene": Column("Scene", scene_name),
                "update": Column("Unlabelled frames"),
                "stored": Column("Not updated, %", percent),
                **{f"new_{n}": Column(f"{n} frames, %", percent) for n in _ZEROED},
            },
            note="Accuracy in the new session. Every frame is standardised and a reference frame "
            "is subtracted: of the training, the mean of its frames; after the drift, the mean "
            "of unlabelled new frames, which come before those tested; or both times the mean of "
            "frames in which nobody touches. Of HDC by its own recalibrate, of others alike. "
            "Intervals: Student, 95 %, over seeds.",
            shown=_shown_of_zeroed,
        ),
        TableOf(
            "drift_regained",
            partial(each_scene, best),
            of="drift",
            key=("scene", "model", "labels"),
            title="What the drift costs, and what every model's best update regains",
            shown=(
                "scene",
                "model",
                "labels",
                "update",
                "n_new",
                "before",
                "stored",
                "updated",
                "lost",
                "regained",
            ),
            columns={
                "scene": Column("Scene", scene_name),
                "labels": Column("Labels", lambda needed: "yes" if needed else "no"),
                "update": Column("Update"),
                "n_new": Column("New frames"),
                "before": Column("Before the drift, %", percent),
                "stored": Column("After it, %", percent),
                "updated": Column("Updated, %", percent),
                "lost": Column("Lost, points", points),
                "regained": Column("Regained of it, %", percent),
            },
            note="Best: the highest mean on the test frames, which favours it, with at most "
            f"{N_NEW} labelled frames, or without labels and with all classes alike or nobody "
            "touching. New frames come before those tested. Regained: gain over loss, a ratio "
            "of means. Intervals: Student, 95 %, over seeds.",
        ),
    ],
    figures=[
        FigureOf(
            "fig8_drift",
            fig8,
            of="drift",
            size=(3.4, 6.6),
            caption="Accuracy in the new and in the old session after an update with N_new "
            "samples, on the scene of the paper (Fig. 8(b)): HDC by every update, others by the "
            f"one that is best on these test frames of the new session after {N_NEW} samples, "
            "which favours them; bars: 95 % over seeds.",
        ),
        FigureOf(
            "drift_zeroed",
            draw_zeroed,
            of="drift",
            needs=lambda rows: bool(rows.method.isin(UNLABELLED).any()),
            caption="Accuracy in the new session without and with an update that needs no "
            f"labels, a panel a scene: {_AT['zeroed']} unlabelled frames, {_AT['untouched']} "
            f"frames in which nobody touches; beside them {N_NEW} labelled frames alone. Bars: "
            "95 % over seeds.",
        ),
    ],
    numbers=[NumbersOf(quantities, of="drift")],
)
