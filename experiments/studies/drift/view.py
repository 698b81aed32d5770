"""Drift and recalibration (Fig. 8(b)): accuracy in the new and in the old environment."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import partial
from typing import NamedTuple

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
    mean_interval,
    one_sensor,
)
from experiments.reporting.measured import with_places
from experiments.reporting.plot import (
    PAPER,
    STYLE,
    WIDTH,
    errors,
    head,
    panel,
    seeds_of,
    star,
)
from experiments.reporting.study import Plot, Quantity, Study

N_NEW = 50  # at which the paper reports the recovered accuracy
Key = tuple[str, float | None]


class Update(NamedTuple):
    """Accuracies after an update: in the new environment, in the old one, and their mean."""

    new: Estimate
    old: Estimate
    both: Estimate


Updates = Mapping[Key, Mapping[int, Update]]

# The paper's scheme from light to dark as p grows; Okabe and Ito's blue and green for the others.
_CURVES: dict[Key, tuple[str, str, str, str]] = {
    ("replace", 0.25): ("p = 0.25", "#F3C19B", "o", "-"),
    ("replace", 0.5): ("p = 0.5", "#E8924F", "s", "-"),
    ("replace", 0.75): ("p = 0.75", "#D55E00", "D", "-"),
    ("replace", 1.0): ("p = 1", "#7A3600", "^", "-"),
    ("balance", 1.0): ("counters, equal votes", "#0072B2", "v", "--"),
    ("weight", 1.0): ("counters, counting on", "#009E73", "P", ":"),
    ("both", None): ("both prototypes kept", "#000000", "x", ":"),
}
_TITLES = (
    "recovered: accuracy in the new environment",
    "remembered: accuracy in the old environment",
    "mean of both",
)


def drift(measured: Measured) -> Figure:
    """Accuracy against N_new in the new and in the old environment."""
    found = updates(measured)
    stored = found["stored", None][0]
    first = next(row for row in measured.rows if row["method"] == "stored")
    with plt.rc_context(STYLE):
        figure, panels = plt.subplots(
            3, 1, figsize=(WIDTH, 6.2), sharex=True, sharey=True, layout="constrained"
        )
        for axes, letter, session, title in zip(
            panels, "abc", Update._fields, _TITLES, strict=True
        ):
            _curves(axes, found, session)
            before = 100 * getattr(stored, session).value
            axes.axhline(before, color="0.5", lw=0.8, ls=(0, (4, 3)), zorder=0)
            axes.set_ylabel("accuracy (%)")
            panel(axes, letter, title)
        axes = panels[0]
        # Not at an N_new: placed in parts of the width.
        across = axes.get_yaxis_transform()
        axes.text(
            0.97,
            100 * stored.new.value - 2,
            "stored prototypes, p = 0",
            ha="right",
            va="top",
            color="0.3",
            fontsize=6,
            transform=across,
        )
        paper = []
        if not measured.of_other_frames:
            for x, name, where in (
                (0.015, "stored_accuracy", across),
                (N_NEW, "recovered_accuracy", axes.transData),
            ):
                known = published.numbers()[f"drift/{name}"].value
                axes.plot(x, known, zorder=5, transform=where, **PAPER)
            paper = [star("paper: p = 0; p = 0.5 or 0.75")]
        panels[-1].set_xlabel("samples of the new environment, $N^{new}$")
        handles = [*panels[0].get_legend_handles_labels()[0], *paper]
        figure.legend(handles=handles, loc="outside lower center", ncols=2)
        draws = len({row["draw"] for row in measured.rows if "draw" in row})
        seeds = len({row["seed"] for row in measured.rows})
        head(
            figure,
            "Recalibration after drift (Fig. 8(b))",
            [
                f"{first['origin']} frames, {seeds_of(seeds)}, {draws} choices of the new samples "
                f"each; old prototypes of {first['n_old']} samples; {first['n_test_new']} new and "
                f"{first['n_test_old']} old test samples a seed; 95 % intervals over seeds",
            ],
        )
    return figure


def _curves(axes: Axes, found: Updates, session: str) -> None:
    axes.set_xscale("log")
    shown = [key for key in _CURVES if key in found]
    for k, key in enumerate(shown):
        label, colour, marker, line = _CURVES[key]
        n = np.array(list(found[key])) * 1.015 ** (k - len(shown) // 2)
        y, spread = errors([getattr(update, session) for update in found[key].values()], 100)
        axes.errorbar(
            n,
            y,
            yerr=spread,
            label=label,
            color=colour,
            marker=marker,
            ls=line,
            elinewidth=0.5,
            lw=0.9,
        )
    axes.xaxis.set_major_locator(FixedLocator([5, 10, 20, 30, 50, 100, 200]))
    axes.xaxis.set_minor_locator(NullLocator())
    axes.xaxis.set_major_formatter(lambda n, _: f"{n:g}")
    axes.set_ylim(20, 103)


def plots(results: Results) -> Iterator[Plot]:
    """Fig. 8(b), of the experiment's own scene and of any other that was measured."""
    for place, one in with_places(results, "drift"):
        yield Plot(
            f"fig8_drift{place}",
            "Accuracy after recalibration with N_new samples, in the new and in the old "
            "environment (Fig. 8(b)).",
            partial(drift, one),
            [one.record.command],
        )


def quantities(results: Results) -> Iterator[Quantity]:
    """Fig. 8(b): accuracy before and after an update with N_new = 50, and what was forgotten."""
    measured = results.measured("drift")
    if measured is None:
        return
    found = accuracies(measured)
    stored = [row for row in measured.rows if row["method"] == "stored"]  # one of each seed
    replaced = [("replace", 0.5), ("replace", 0.75)]  # the paper has one number for both
    for keys, names, condition, n in (
        ([("stored", None)], ("stored_accuracy", "stored_accuracy_old"), "", 0),
        (replaced, ("recovered_accuracy", "remembered_accuracy"), "", N_NEW),
        (
            [("balance", 1.0)],
            ("recovered_accuracy_balanced", "remembered_accuracy_balanced"),
            "counters of both, equal votes",
            N_NEW,
        ),
    ):
        each = [found[key][n] for key in keys if n in found.get(key, {})]
        if len(each) < len(keys):
            continue
        for k, (session, name) in enumerate(zip(("new", "old"), names, strict=True)):
            of_seeds = np.mean(each, axis=0)[:, k]
            tested = [int(row[f"n_test_{session}"]) for row in stored]
            least = least_variance(of_seeds, float(np.mean(tested)))
            means = [
                f"{100 * one[:, k].mean():.3g} % at p = {key[1]}"
                for key, one in zip(keys, each, strict=True)
            ]
            yield Quantity.of(
                f"drift/{name}",
                one_sensor(of_seeds, least).within(0, 1),
                ONE_SENSOR,
                100,
                condition=condition,
                n=sum(tested),
                seeds=len(stored),
                made_by=measured.record.command,
                note=f"mean of {' and '.join(means)}" if len(keys) > 1 else "",
            )


def accuracies(measured: Measured) -> dict[Key, dict[int, NDArray[np.float64]]]:
    """Accuracy in the new and in the old environment of each seed, mean over its draws: [seeds, 2]
    by (method, parameter or None) and N_new."""
    found: dict[Key, dict[int, dict[str, list[tuple[float, ...]]]]] = {}
    for row in measured.rows:
        parameter = row.get("parameter")
        key = row["method"], None if parameter is None else float(parameter)
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


def updates(measured: Measured) -> Updates:
    """Accuracies by (method, parameter or None) and N_new.

    Each estimate is over seeds, of the means over their draws: the samples of a seed share sensor
    and prototypes.
    """
    return {
        key: {n: _estimate(means) for n, means in by_n.items()}
        for key, by_n in accuracies(measured).items()
    }


def _estimate(means: NDArray[np.float64]) -> Update:
    return Update(*(mean_interval(column) for column in (*means.T, means.mean(1))))


STUDY = Study(
    "drift",
    "Drift and recalibration",
    "After 16 days the sensor has drifted. How many new samples does it take to be right again, "
    "and what is forgotten?",
    5,
    plots=plots,
    quantities=quantities,
)
