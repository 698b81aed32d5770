"""Drift and recalibration (Fig. 8(b)): what was recovered and forgotten, and what the old samples
add to the new ones; how far the environment may change."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from matplotlib import pyplot as plt
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FixedLocator, NullLocator
from numpy.typing import NDArray

from experiments.records.measurement import Measured
from experiments.records.results import Results
from experiments.reporting import published
from experiments.reporting.estimates import (
    ONE_SENSOR,
    Estimate,
    least_variance,
    mean_difference,
    mean_share,
    one_sensor,
)
from experiments.reporting.measured import with_places
from experiments.reporting.plot import (
    PAPER,
    STYLE,
    WIDTH,
    bars,
    errors,
    handle,
    head,
    panel,
    seeds_of,
    star,
)
from experiments.reporting.rows import display_name, frames_of
from experiments.reporting.study import Plot, Quantity, Study
from experiments.reporting.table import Table, bounded, frame, percent, points

N_NEW = 50  # at which the paper reports the recovered accuracy
PAPERS = ("0.5", "0.75")  # its p, as rows have them
_SHOWN = (5, 20, N_NEW)  # columns of the table
ORDERS = {
    "time": "new samples first in time",
    "random": "new samples at random",
}
METHODS = {
    "new": "new samples alone",
    "replace": "bits replaced, p = {:g}",
    "pooled": "old and new together",
    "balanced": "old and new, equal votes",
    "from_old": "new, from the old weights",
}


class Key(NamedTuple):
    """Which accuracies belong together; the parameter, of ``replace`` only, as the row has it."""

    order: str
    model: str
    method: str
    parameter: str = ""

    @property
    def label(self) -> str:
        """``bits replaced, p = 0.5``."""
        if (self.model, self.method) == ("hdc", "new"):
            return f"{METHODS['new']}, p = 1"
        return METHODS[self.method].format(float(self.parameter or "nan"))


# Accuracies in the new and in the old environment [seeds, 2], means of draws, by N_new: the samples
# of a seed share sensor and stored model.
Accuracies = Mapping[Key, Mapping[int, NDArray[np.float64]]]


def accuracies(measured: Measured) -> Accuracies:
    """What was measured of updates; N_new is 0 for the stored model."""
    found: dict[Key, dict[int, dict[str, list[tuple[float, ...]]]]] = {}
    for row in measured.rows:
        if "offset" not in row:
            key = Key(row["order"], row["model"], row["method"], row.get("parameter", ""))
            by_seed = found.setdefault(key, {}).setdefault(int(row["n_new"]), {})
            pair = tuple(int(row[f"right_{s}"]) / int(row[f"n_test_{s}"]) for s in ("new", "old"))
            by_seed.setdefault(row["seed"], []).append(pair)
    return {
        key: {
            n: np.array([np.mean(draws, axis=0) for draws in by_seed.values()])
            for n, by_seed in sorted(by_n.items())
        }
        for key, by_n in found.items()
    }


def n_tested(measured: Measured, session: str = "new") -> int:
    """Test samples of a seed."""
    return int(measured.rows[0][f"n_test_{session}"])


def gains(measured: Measured, found: Accuracies, key: Key) -> dict[int, Estimate]:
    """Accuracy in the new environment above that of the new samples alone, by N_new; the same
    sensors and samples on both sides."""
    alone = found.get(key._replace(method="new", parameter=""), {})
    return {
        n: mean_difference((values - alone[n])[:, 0].tolist(), n_tested(measured))
        for n, values in found[key].items()
        if n in alone
    }


def _mean(measured: Measured, values: NDArray[np.float64], session: str) -> Estimate:
    """Over sensors."""
    column = values[:, ("new", "old").index(session)]
    return mean_share(column.tolist(), n_tested(measured, session))


# Table --------------------------------------------------------------------------------------------


def tables(results: Results) -> Iterator[Table]:
    """Every model and update, and where the old samples add something."""
    for place, measured in with_places(results, "drift"):
        found = accuracies(measured)
        rows = [_row(measured, found, key) for key in found if key.method != "stored"]
        first = measured.rows[0]
        shown = [n for n in _SHOWN if any(f"new_{n}" in row for row in rows)]
        yield Table(
            f"drift{place}",
            f"Recalibration and training again, on {_frames(measured)}",
            frame(rows),
            {
                "Order": lambda row: ORDERS[row["order"]],
                "Model": lambda row: display_name(row["model"]),
                "Trained on": lambda row: row["update"],
                **{f"New environment, N_new = {n}, %": partial(bounded, f"new_{n}") for n in shown},
                **{f"Old environment, N_new = {n}, %": partial(bounded, f"old_{n}")
                   for n in shown[-1:]},
                **{f"Above new alone, N_new = {n}, points": partial(
                    bounded, f"gain_{n}", show=points)
                   for n in shown[-1:]},
                "Old samples add at N_new =": lambda row: row["adds"],
                "Old samples cost at N_new =": lambda row: row["costs"],
            },
            f"Old: {first['n_old']} samples of the first session. {_stored(found)}. Intervals: "
            "Student, 95 %, over seeds, each a sensor; differences from the new samples alone are "
            "paired by seed. Add, cost: the interval of the difference is above, below zero, at "
            "each N_new by itself. Equal votes: a new sample counts N_old/N_new times. From the "
            "old weights: the penalty is on the distance from them.",
            [measured.record.command],
        )  # fmt: skip


def _row(measured: Measured, found: Accuracies, key: Key) -> dict[str, Any]:
    row: dict[str, Any] = {"order": key.order, "model": key.model, "update": key.label}
    for n, values in found[key].items():
        for session in ("new", "old"):
            row |= _mean(measured, values, session).columns(f"{session}_{n}")
    above = {} if key.method == "new" else gains(measured, found, key)
    for n, gain in above.items():
        row |= gain.columns(f"gain_{n}")
    for name, holds in (
        ("adds", lambda gain: gain.low > 0),
        ("costs", lambda gain: gain.high < 0),
    ):
        known = {n: gain for n, gain in above.items() if not np.isnan(gain.low)}
        where = ", ".join(str(n) for n, gain in known.items() if holds(gain))
        row[name] = where or ("none" if known else "–")
    return row


def _stored(found: Accuracies) -> str:
    """Accuracies of the stored models, of the first order."""
    first = next(iter(found)).order
    said = [
        f"{display_name(key.model)} {percent(values[0][:, 0].mean())} %"
        for key, values in found.items()
        if key.method == "stored" and key.order == first
    ]
    return f"Stored models in the new environment: {', '.join(said)}"


def _frames(measured: Measured) -> str:
    return f"{frames_of(measured.rows)}, {_seeds(measured)}"


def _seeds(measured: Measured) -> str:
    return seeds_of(len({row["seed"] for row in measured.rows}))


# Figures ------------------------------------------------------------------------------------------

# The paper's scheme from light to dark as p grows; Okabe and Ito's blue and green for the others.
_HDC: dict[tuple[str, str], tuple[str, str, str, str]] = {
    ("replace", "0.25"): ("p = 0.25", "#F3C19B", "o", "-"),
    ("replace", "0.5"): ("p = 0.5", "#E8924F", "s", "-"),
    ("replace", "0.75"): ("p = 0.75", "#D55E00", "D", "-"),
    ("new", ""): ("p = 1: new alone", "#7A3600", "^", "-"),
    ("balanced", ""): ("counters, equal votes", "#0072B2", "v", "--"),
    ("pooled", ""): ("counters, counting on", "#009E73", "P", ":"),
}
# What other models make of the old samples, beside the paper's scheme.
_OTHERS: dict[tuple[str, str], tuple[str, str, str, str]] = {
    ("ridge", "from_old"): ("ridge, from old weights", "#56B4E9", "P", "-"),
    ("softmax_dual", "from_old"): ("softmax, from old weights", "#000000", "D", "--"),
    ("correlation", "balanced"): ("correlation, equal votes", "#E69F00", "X", "-"),
}


def recalibration(measured: Measured) -> Figure:
    """Accuracy against N_new in both environments, and what the old samples add."""
    found = accuracies(measured)
    order = next(iter(found)).order
    first = measured.rows[0]
    hdc = [
        (Key(order, "hdc", *key), look) for key, look in _HDC.items()
        if Key(order, "hdc", *key) in found
    ]  # fmt: skip
    others = [
        (Key(order, *key), look) for key, look in _OTHERS.items() if Key(order, *key) in found
    ]
    with plt.rc_context(STYLE):
        figure, (new, old, added) = plt.subplots(
            3, 1, figsize=(WIDTH, 6.9), sharex=True, layout="constrained"
        )
        stored = found.get(Key(order, "hdc", "stored"))
        for axes, session, letter, title in (
            (new, "new", "a", "HDC, recovered: accuracy in the new environment"),
            (old, "old", "b", "HDC, remembered: accuracy in the old environment"),
        ):
            for k, (key, look) in enumerate(hdc):
                values = {n: _mean(measured, v, session) for n, v in found[key].items()}
                _curve(axes, values, look, k - len(hdc) // 2)
            if stored:
                before = 100 * _mean(measured, stored[0], session).value
                axes.axhline(before, color="0.5", lw=0.8, ls=(0, (4, 3)), zorder=0)
            axes.set_ylim(15, 103)
            axes.set_ylabel("accuracy (%)")
            panel(axes, letter, title)
        of_hdc = [(key, look) for key, look in hdc if key.method in ("replace", "balanced")]
        shown = of_hdc + others
        for k, (key, look) in enumerate(shown):
            _curve(added, gains(measured, found, key), look, k - len(shown) // 2)
        added.axhline(0, color="0.5", lw=0.8, ls=(0, (4, 3)), zorder=0)
        added.set_ylabel("above the same model,\nnew samples alone (points)")
        panel(added, "c", "what the old samples add in the new environment")
        added.set_xlabel("samples of the new environment, $N^{new}$")
        paper = _paper(new) if not measured.of_other_frames else []
        added.set_xscale("log")
        added.xaxis.set_major_locator(FixedLocator([5, 10, 20, 30, 50, 100, 200]))
        added.xaxis.set_minor_locator(NullLocator())
        added.xaxis.set_major_formatter(lambda n, _: f"{n:g}")
        handles = [*new.get_legend_handles_labels()[0]]
        handles += added.get_legend_handles_labels()[0][len(of_hdc) :]
        figure.legend(handles=[*handles, *paper], loc="outside lower center", ncols=2)
        head(
            figure,
            "Recalibration after drift (Fig. 8(b))",
            [
                f"{_frames(measured)}, {ORDERS[order]}; {first['n_old']} old samples; "
                f"{first['n_test_new']} new and {first['n_test_old']} old test samples a seed; "
                "dashed grey: stored model, or no difference; 95 % intervals over seeds",
            ],
        )
    return figure


def _curve(
    axes: Axes, values: Mapping[int, Estimate], look: tuple[str, str, str, str], place: int
) -> None:
    """Percent against N_new, a little aside so that bars do not cover each other."""
    label, colour, marker, line = look
    y, spread = errors(list(values.values()), 100)
    x = np.array(list(values)) * 1.015**place
    axes.errorbar(
        x, y, yerr=spread, label=label, color=colour, marker=marker, ls=line, lw=0.9,
        elinewidth=0.5,
    )  # fmt: skip


def _paper(axes: Axes) -> list[Any]:
    """The published accuracies before and after, and their entry in the legend."""
    known = published.numbers()
    across = axes.get_yaxis_transform()  # the stored model is at no N_new: in parts of the width
    for x, name, where in (
        (0.015, "stored_accuracy", across),
        (N_NEW, "recovered_accuracy", axes.transData),
    ):
        axes.plot(x, known[f"drift/{name}"].value, zorder=5, transform=where, **PAPER)
    return [star("paper: p = 0; p = 0.5 or 0.75")]


Sweep = Mapping[tuple[str, str], Mapping[float, Estimate]]


def sweep(measured: Measured) -> Sweep:
    """Accuracy by (method, model) and offset in K, over seeds."""
    found: dict[tuple[str, str], dict[float, list[float]]] = {}
    rows = [row for row in measured.rows if "offset" in row]
    for row in rows:
        by_offset = found.setdefault((row["method"], row["model"]), {})
        share = int(row["right_new"]) / int(row["n_test_new"])
        by_offset.setdefault(float(row["offset"]), []).append(share)
    n = int(rows[0]["n_test_new"])
    return {
        key: {offset: mean_share(shares, n) for offset, shares in by_offset.items()}
        for key, by_offset in found.items()
    }


def drift_size(measured: Measured) -> Figure:
    """Accuracy of models that are not recalibrated against the change of temperature."""
    found = sweep(measured)
    models = list(dict.fromkeys(model for _, model in found))
    first = next(row for row in measured.rows if "offset" in row)
    two = next(row for row in measured.rows if row["method"] == "two_sessions")
    own = measured.record.config["scene"]["sessions"][1]["offset"]
    with plt.rc_context(STYLE):
        figure, panels = plt.subplots(
            2, 1, figsize=(WIDTH, 4.6), sharex=True, sharey=True, layout="constrained"
        )
        for axes, letter, method, title in zip(
            panels,
            "ab",
            ("stored", "two_sessions"),
            (f"trained on {first['n_old']} samples of the first session",
             f"on {two['n_old']} of the first and {two['n_new']} of the second, at {own:g} K"),
            strict=True,
        ):  # fmt: skip
            for model in models:
                values = found[method, model]
                y, spread = errors(list(values.values()), 100)
                bars(axes, model, list(values), y, spread, elinewidth=0.5)
            axes.axvline(own, color="0.5", lw=0.7, ls=(0, (4, 3)), zorder=0)
            axes.set_ylabel("accuracy (%)")
            panel(axes, letter, title)
        axes.set_xscale("symlog", linthresh=0.05, linscale=0.4)
        offsets = [0, 0.05, 0.1, 0.2, 0.5, 1, 2]
        axes.xaxis.set_major_locator(FixedLocator(offsets))
        axes.xaxis.set_minor_locator(NullLocator())
        axes.xaxis.set_major_formatter(lambda x, _: f"{x:g}")
        axes.set_xlabel("room warmer than in the first session by (K)")
        axes.set_xlim(-0.01, 2.3)
        axes.set_ylim(10, 103)
        figure.legend(handles=[*map(handle, models)], loc="outside lower center", ncols=2)
        head(
            figure,
            "How far the environment may change without recalibration",
            [
                f"{_frames(measured)}, {first['n_test_new']} test samples each; dashed: the change "
                "of Fig. 8, fitted; 95 % intervals over seeds",
            ],
        )
    return figure


def plots(results: Results) -> Iterator[Plot]:
    """Fig. 8(b) and the size of the drift, of the experiment's own scene and of any other."""
    for place, one in with_places(results, "drift"):
        yield Plot(
            f"fig8_drift{place}",
            "Accuracy after recalibration with N_new samples, in the new and in the old "
            "environment, and what the old samples add (Fig. 8(b)).",
            partial(recalibration, one),
            [one.record.command],
        )
        if any("offset" in row for row in one.rows):
            yield Plot(
                f"drift_size{place}",
                "Accuracy without recalibration against the change of the room temperature, of "
                "models trained in one session and in two.",
                partial(drift_size, one),
                [one.record.command],
            )


def quantities(results: Results) -> Iterator[Quantity]:
    """Fig. 8(b): accuracy of HDC before and after an update with N_new = 50, the mean of p = 0.5
    and 0.75, for which the paper has one number; the new samples first in time if there are such.
    """
    measured = results.measured("drift")
    if measured is None:
        return
    found = accuracies(measured)
    n_test = n_tested(measured)
    for name, ways, n in (
        ("stored_accuracy", [("stored", "")], 0),
        ("recovered_accuracy", [("replace", p) for p in PAPERS], N_NEW),
    ):
        by_order: dict[str, NDArray[np.float64]] = {}
        for order in ORDERS:
            each = [found.get(Key(order, "hdc", *way), {}).get(n) for way in ways]
            known = [values[:, 0] for values in each if values is not None]
            if len(known) == len(ways):
                by_order[order] = np.mean(known, axis=0)
        if by_order:
            (order, values), *others = by_order.items()
            said = [ORDERS[order], *(f"{ORDERS[o]}: {100 * v.mean():.3g} %" for o, v in others)]
            yield Quantity.of(
                f"drift/{name}",
                one_sensor(values.tolist(), least_variance(values.tolist(), n_test)).within(0, 1),
                ONE_SENSOR,
                100,
                n=n_test * len(values),
                seeds=len(values),
                made_by=measured.record.command,
                note="; ".join(said) if n else "",
            )


STUDY = Study(
    "drift",
    "Drift and recalibration",
    "After 16 days the sensor has drifted. How many new samples does it take to be right again, "
    "what is forgotten, and do the old samples add anything to the new?",
    5,
    tables,
    plots,
    quantities,
)
