"""Whether light, sensor, labels, or the networks' initial weights make the published accuracies.

Sensors are what is drawn at random: means and intervals are over them, and models are compared
sensor by sensor. A condition makes softmax as published if its mean test accuracy lies in the
published one's interval, and explains the published row if HDC keeps its own. What counts is said
in configs/experiment/table1_conditions.yaml (``criterion``, ``reading``).
"""

from __future__ import annotations

import math
import textwrap
from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np
from matplotlib import pyplot as plt
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from experiments.records import configs
from experiments.records.measurement import Measured
from experiments.records.results import Results
from experiments.reporting import published
from experiments.reporting.estimates import mean_difference, mean_share
from experiments.reporting.measured import with_places
from experiments.reporting.plot import (
    STYLE,
    WIDTH,
    bars,
    errors,
    handle,
    head,
    panel,
)
from experiments.reporting.rows import display_name, frames_of
from experiments.reporting.study import Plot
from experiments.reporting.table import Table, bounded, frame, number, percent, points
from experiments.studies.conditions.readings import Curve, Levels, read
from experiments.studies.conditions.rules import RULES
from experiments.studies.conditions.verdict import criterion
from experiments.studies.robustness.view import LEVELS

OPTICS, NETWORKS = "table1_conditions_optics", "table1_conditions_networks"
CRITERIA = "table1_conditions"  # whose config says how curves are read
# As LEVELS: what a condition is called, the unit of its level, units in a level of 1.
CONDITIONS = LEVELS | {
    "power": ("laser gain ±", "%", 100),
    "exposure": ("grey level at the mean intensity", "", 1),
    "photons": ("electrons at the mean intensity", "", 1),
    "repeatability": ("scatter of touches ×", "", 1),
    "session": ("next session warmer by", "K", 1),
    "labels": ("wrong training labels", "%", 100),
}
READINGS = {
    "r1": "first above {reached} % in training",
    "r2": "first at the published training accuracy",
    "r3": "maxima over {window} times the steps to {reached} %",
    "r4": "maxima of the whole training",
}
# Dark to light as the initial weights grow; Okabe and Ito.
STARTS = {
    "linear": ("PyTorch's own", "#0072B2"),
    "normal 0.01": ("normal, 0.01", "#D55E00"),
    "normal 0.1": ("normal, 0.1", "#E69F00"),
}
BAND = "0.9"  # colour of a published interval
Case = tuple[str, float]
Accuracies = Mapping[Case, Mapping[str, Mapping[str, float]]]


def tables(results: Results) -> Iterator[Table]:
    """Test accuracies by condition, and by initial weights and reading of the networks."""
    for place, measured in with_places(results, OPTICS):
        yield _of_optics(place, measured)
    for place, measured in with_places(results, NETWORKS):
        yield _of_networks(place, measured)


def plots(results: Results) -> Iterator[Plot]:
    """The same as figures."""
    for place, measured in with_places(results, OPTICS):
        yield Plot(
            f"{OPTICS}{place}",
            "Test accuracy of HDC and of linear models when one thing goes wrong, in training and "
            "testing alike; grey: the published accuracy of softmax with its interval.",
            partial(optics_figure, measured),
            [measured.record.command],
        )
    for place, measured in with_places(results, NETWORKS):
        yield Plot(
            f"{NETWORKS}{place}",
            "Training and test accuracy of the networks against steps, by initial weights; grey: "
            "the published test accuracy with its interval.",
            partial(networks_figure, measured),
            [measured.record.command],
        )


# Optics -------------------------------------------------------------------------------------------


def accuracies(measured: Measured) -> Accuracies:
    """Test accuracy by (condition, level), model and sensor."""
    found: dict[Case, dict[str, dict[str, float]]] = {}
    for row in measured.rows:
        by_model = found.setdefault((row["condition"], float(row["level"])), {})
        by_model.setdefault(row["model"], {})[row["seed"]] = int(row["right"]) / int(row["n_test"])
    return found


def n_tested(measured: Measured) -> dict[str, int]:
    """Test samples of a sensor, by condition."""
    return {row["condition"]: int(row["n_test"]) for row in measured.rows}


def explaining(results: Results) -> list[str]:
    """The conditions that make the published pair of accuracies, each with who has them."""
    if (measured := results.measured(OPTICS)) is None:
        return []
    rows = [_optics_row(*found, measured) for found in accuracies(measured).items()]
    return [
        f"{CONDITIONS[row['condition']][0]}, {_level(row['condition'], row['level'])} "
        f"(HDC {percent(row['hdc'])} %)"
        for row in rows
        if row["verdict"].startswith("yes")
    ]


def verdict(hdc: float, softmax: Mapping[str, float]) -> str:
    """Whether a condition makes the published pair of accuracies.

    Args:
        hdc: mean test accuracy.
        softmax: that of each model that may stand for the published softmax regression, by name.

    Returns:
        ``yes`` with the models that have the published accuracy while HDC keeps its own; ``HDC
        falls too`` where one of them comes down to it, and HDC with them; else ``no``.
    """
    low, high = _published_interval("softmax")
    there = [name for name, value in softmax.items() if low <= value <= high]
    if hdc >= criterion().hdc_at_least:
        return f"yes: {', '.join(there)}" if there else "no"
    return "HDC falls too" if any(value <= high for value in softmax.values()) else "no"


def _published_interval(model: str) -> tuple[float, float]:
    """Of the published test accuracy, fractions."""
    known = published.numbers()[f"table1/{model}_test_accuracy"]
    assert known.low is not None
    assert known.high is not None
    return known.low / 100, known.high / 100


def _optics_row(
    case: Case, found: Mapping[str, Mapping[str, float]], measured: Measured
) -> dict[str, Any]:
    config = measured.record.config
    row: dict[str, Any] = {"condition": case[0], "level": case[1]}
    n = n_tested(measured)[case[0]]
    means = {model: mean_share([*by_sensor.values()], n) for model, by_sensor in found.items()}
    for model, one in means.items():
        row |= one.columns(model)
    best = max(config["linear"], key=lambda model: means[model].value)
    paired = [found["hdc"][sensor] - found[best][sensor] for sensor in found["hdc"]]
    return row | {
        "best_linear": best,
        **mean_difference(paired, n).columns("difference"),
        "ahead": sum(x > 0 for x in paired),
        "behind": sum(x < 0 for x in paired),
        "sensors": len(paired),
        "verdict": verdict(
            means["hdc"].value,
            {_shown(measured, model): means[model].value for model in config["softmax"]},
        ),
    }


def _of_optics(place: str, measured: Measured) -> Table:
    config = measured.record.config
    low, high = (percent(bound) for bound in _published_interval("softmax"))

    epochs = [
        f" {_shown(measured, model)}: {part['model']['max_epochs']} epochs."
        for model, part in config["models"].items()
        if "max_epochs" in part["model"]
    ]

    return Table(
        f"{OPTICS}{place}",
        f"Test accuracy, %, when one thing goes wrong, on {frames_of(measured.rows)}",
        frame(_optics_row(*found, measured) for found in accuracies(measured).items()),
        {
            "Condition": lambda row: CONDITIONS[row["condition"]][0],
            "Level": lambda row: _level(row["condition"], row["level"]),
            **{_shown(measured, model): partial(bounded, model) for model in config["models"]},
            "HDC − best linear, points": partial(bounded, "difference", show=points),
            "Best linear": lambda row: _shown(measured, row["best_linear"]),
            "HDC ahead, behind; sensors": lambda row: (
                f"{row['ahead']}, {row['behind']}; {row['sensors']}"
            ),
            "Softmax as published, HDC not less": lambda row: row["verdict"],
        },
        "Means over sensors, in square brackets Student's 95 % interval over them; differences are "
        "taken sensor by sensor, from the linear model of the highest mean, which favours it. Last "
        "column: yes if a softmax regression has a mean within the published one's interval, "
        f"{low} to {high} %, and HDC at least "
        f"{percent(criterion().hdc_at_least)} %; HDC falls too: it is below that, and one of them "
        "at or below the interval. It goes wrong in training and testing alike, but for wrong "
        "labels, which are in training alone, and the next session, which tests. Laser gain, stray "
        f"light, glare and movement differ from frame to frame.{''.join(epochs)}",
        [measured.record.command],
    )


def _shown(measured: Measured, model: str) -> str:
    """What a model is called; of one that learns by steps, with optimiser and start."""
    recipe = measured.record.config["models"][model]["model"]
    if "optimizer" not in recipe:
        return display_name(model)
    return f"{display_name(model)}, {recipe['optimizer']} from {recipe['init']}"


def _level(condition: str, level: float) -> str:
    _, unit, units = CONDITIONS[condition]
    return "" if condition == "none" else f"{level * units:g} {unit}".strip()


def optics_figure(measured: Measured) -> Figure:
    """Accuracy against level, a panel a condition; without any of it at the left of each."""
    found = accuracies(measured)
    conditions = [name for name in dict.fromkeys(c for c, _ in found) if name != "none"]
    models = list(measured.record.config["models"])
    with plt.rc_context(STYLE):
        rows = -(-len(conditions) // 3)
        figure, panels = plt.subplots(
            rows, 3, figsize=(WIDTH, 1.2 + 1.35 * rows), sharey=True, squeeze=False,
            layout="constrained",
        )  # fmt: skip
        for axes in panels.flat[len(conditions) :]:
            axes.set_visible(False)
        for axes, letter, name in zip(panels.flat, "abcdefghijkl", conditions, strict=False):
            _condition(axes, measured, found, name)
            panel(axes, letter, "")
        for axes in panels[:, 0]:
            axes.set_ylabel("test accuracy (%)")
        handles: list[Any] = [handle(model) for model in models]
        for model, entry in zip(models, handles, strict=True):
            entry.set_label(_shown(measured, model))
        handles.append(Patch(color=BAND, label="softmax, published [95 %]"))
        figure.legend(handles=handles, loc="outside lower center", ncols=2)
        head(
            figure,
            "Test accuracy when one thing goes wrong",
            [f"{frames_of(measured.rows)}, 95 % intervals over {_sensors(measured)}"],
        )
    return figure


def _condition(axes: Axes, measured: Measured, found: Accuracies, name: str) -> None:
    text, unit, units = CONDITIONS[name]
    n = n_tested(measured)
    cases = [case for case in found if case[0] in ("none", name)]
    axes.axhspan(*(100 * bound for bound in _published_interval("softmax")), color=BAND, lw=0)
    models = measured.record.config["models"]
    for k, model in enumerate(models):
        shares = [(list(found[case][model].values()), n[case[0]]) for case in cases]
        y, spread = errors([mean_share(*of) for of in shares], 100)
        x = np.arange(len(cases)) + 0.09 * (k - (len(models) - 1) / 2)
        bars(axes, model, x, y, spread, lw=0.8, elinewidth=0.5, markersize=2.5)
    levels = (f"{units * level:g}" for _, level in cases[1:])
    axes.set_xticks(range(len(cases)), ["–", *levels], fontsize=6)
    lines = textwrap.wrap(text, 20) + ([f"({unit})"] if unit else [])
    axes.set_xlabel("\n".join(lines), fontsize=6)
    axes.set_xlim(-0.4, len(cases) - 0.6)


def _sensors(measured: Measured) -> str:
    n = len({row["seed"] for row in measured.rows})
    return f"{n} sensor{'s' * (n != 1)}"


# Networks -----------------------------------------------------------------------------------------


def read_of(curve: Sequence[Mapping[str, str]], model: str) -> dict[str, Any]:
    """What the rules of ``readings`` read off the rows of one training of a network."""
    train = published.value(f"table1/{_published_name(model)}_training_accuracy")
    assert train is not None
    rule = configs.task(CRITERIA)["reading"]
    # No plateau is looked for: the last rule takes the whole training.
    levels = Levels(rule["reached"], train, (), rule["window"], rule["plateau_steps"], 0.0)
    shown = [row for row in curve if "train_accuracy" in row]
    steps = [int(row["step"]) for row in shown]
    loss, accuracy, tested = (
        [float(row[key]) for row in shown] for key in ("loss", "train_accuracy", "test_accuracy")
    )
    return read(Curve(math.nan, steps, loss, accuracy, tested), levels) if shown else {}


def _curves(measured: Measured) -> dict[tuple[str, str, str], dict[str, list[dict[str, str]]]]:
    """Rows by (model, start, pixels) and sensor."""
    found: dict[tuple[str, str, str], dict[str, list[dict[str, str]]]] = {}
    for row in measured.rows:
        start = row["init"] if row["init"] == "linear" else f"{row['init']} {row['init_std']}"
        by_sensor = found.setdefault((row["model"], start, row["pixels"]), {})
        by_sensor.setdefault(row["seed"], []).append(row)
    return found


def _published_name(model: str) -> str:
    """``cnn1`` of ``cnn1_fast``: the network that the paper has."""
    return model.partition("_")[0]


def _network_rows(measured: Measured) -> Iterator[dict[str, Any]]:
    for (model, start, pixels), by_sensor in _curves(measured).items():
        known = {
            part: published.numbers()[f"table1/{_published_name(model)}_{name}_accuracy"]
            for part, name in (("train", "training"), ("test", "test"))
        }
        of_sensors = [read_of(curve, model) for curve in by_sensor.values()]
        for rule in RULES:
            found = [one for one in of_sensors if one.get(f"{rule}_steps") is not None]
            inside = sum(
                all(
                    one.low <= 100 * line[f"{rule}_{part}"] <= one.high  # type: ignore[operator]
                    for part, one in known.items()
                )
                for line in found
            )
            row: dict[str, Any] = {"model": model, "start": start, "pixels": pixels}
            row |= {"rule": rule, "sensors": len(of_sensors), "reached": len(found)}
            for part in ("steps", "train", "test"):
                values = [line[f"{rule}_{part}"] for line in found]
                row |= {part: float(np.mean(values))} if values else {}
                row |= {f"{part}_low": min(values), f"{part}_high": max(values)} if values else {}
            for part, one in known.items():
                row |= {f"published_{part}": one.value / 100}
                row |= {f"published_{part}_low": one.low and one.low / 100}
                row |= {f"published_{part}_high": one.high and one.high / 100}
            enough = inside >= criterion().share * len(of_sensors)
            yield row | {"inside": inside, "verdict": "accuracies" if enough else "no"}


def _of_networks(place: str, measured: Measured) -> Table:
    def spread(key: str, show: Any, row: Mapping[str, Any]) -> str:
        value, low, high = (show(row.get(f"{key}{end}")) for end in ("", "_low", "_high"))
        return value if low == high else f"{value} ({low}…{high})"

    rule = configs.task(CRITERIA)["reading"]
    texts = {"reached": percent(rule["reached"]), "window": number(rule["window"])}
    config = measured.record.config
    return Table(
        f"{NETWORKS}{place}",
        "What one reads off the training of a convolutional network, by its initial weights and "
        f"the scale of its pixels, on {frames_of(measured.rows)}",
        frame(_network_rows(measured)),
        {
            "Network": lambda row: display_name(row["model"]),
            "Initial weights": lambda row: STARTS.get(row["start"], (row["start"],))[0],
            "Pixels": lambda row: row["pixels"],
            "Reading": lambda row: READINGS[row["rule"]].format(**texts),
            "Reached, sensors": lambda row: f"{row['reached']} of {row['sensors']}",
            "Steps": partial(spread, "steps", lambda x: number(x, 3)),
            "Training accuracy, %, paper [95 %]": partial(bounded, "published_train"),
            "Training accuracy, %": partial(spread, "train", percent),
            "Test accuracy, %, paper [95 %]": partial(bounded, "published_test"),
            "Test accuracy, %": partial(spread, "test", percent),
            "As published, sensors": lambda row: f"{row['inside']} of {row['sensors']}",
            "Explains": lambda row: row["verdict"],
        },
        f"Means over the sensors (lowest…highest). Each training has {config['steps']} steps of "
        "Adam at the published rate and no stopping rule. As published: training and test "
        "accuracy lie in the published intervals. Explains the accuracies if "
        f"{percent(criterion().share)} % of the sensors are so; what the paper took for time is "
        "steps times seconds a step, and is not judged here.",
        [measured.record.command],
    )


def networks_figure(measured: Measured) -> Figure:
    """Accuracies against steps: a panel a network and scale of pixels, a colour an initial
    weight, a line a sensor."""
    found = _curves(measured)
    groups = list(dict.fromkeys((model, pixels) for model, _, pixels in found))
    with plt.rc_context(STYLE):
        figure, panels = plt.subplots(
            len(groups), 1, figsize=(WIDTH, 1.2 + 1.5 * len(groups)), sharex=True, sharey=True,
            squeeze=False, layout="constrained",
        )  # fmt: skip
        for axes, letter, (model, pixels) in zip(panels.flat, "abcdefgh", groups, strict=False):
            band = (100 * bound for bound in _published_interval(_published_name(model)))
            axes.axhspan(*band, color=BAND, lw=0)
            for start, (_, colour) in STARTS.items():
                for curve in found.get((model, start, pixels), {}).values():
                    shown = [row for row in curve if "train_accuracy" in row]
                    x = [int(row["step"]) for row in shown]
                    for key, line in (("train_accuracy", ":"), ("test_accuracy", "-")):
                        y = [100 * float(row[key]) for row in shown]
                        axes.plot(x, y, color=colour, ls=line, lw=0.8)
            panel(axes, letter, f"{display_name(model)}, pixels {pixels}")
            axes.set_ylabel("accuracy (%)")
            axes.set_ylim(0, 104)
        panels[-1, 0].set_xlabel("steps of the optimiser")
        shown_starts = {start for _, start, _ in found}
        handles: list[Any] = [
            Line2D([], [], color=colour, label=f"weights {name}")
            for start, (name, colour) in STARTS.items()
            if start in shown_starts
        ]
        handles += [
            Line2D([], [], color="0.3", ls="-", label="test"),
            Line2D([], [], color="0.3", ls=":", label="training"),
            Patch(color=BAND, label="test, published [95 %]"),
        ]
        figure.legend(handles=handles, loc="outside lower center", ncols=2)
        head(
            figure,
            "Accuracy of the networks by their initial weights",
            [f"{frames_of(measured.rows)}, {_sensors(measured)}, a line each"],
        )
    return figure
