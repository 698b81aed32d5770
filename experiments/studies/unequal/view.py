"""Unequal classes: accuracy with and without more frames of one class."""

from __future__ import annotations

import pandas as pd
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from experiments.records.measurement import Measured
from experiments.records.results import Results
from experiments.reporting.columns import Column
from experiments.reporting.plot import head, panel, style_of
from experiments.reporting.study import RUN, Study
from experiments.reporting.text import percent, points
from experiments.studies.recordings.view import by_scene, estimate

STUDY = Study(
    "unequal",
    "Unequal classes",
    "One class has one frame more than the others: how many of their frames does it take, "
    "by which rule, and does the remedy cost anything?",
    2.7,
)
NAMES = {
    "hdc": "HDC as published", "hdc_balanced": "HDC, balanced", "hdc_random_ties": "random ties",
    "hdc_integer": "integer prototypes", "ridge": "ridge, greys", "mean_image": "mean image",
}  # fmt: skip
ENDS = ("", "_low", "_high")


def measurements(results: Results) -> dict[str, Measured]:
    """Finished measurements by the name of their scene."""
    return dict(sorted(by_scene(results, "unequal").items()))


def summary(rows: pd.DataFrame) -> pd.DataFrame:
    """A row for each n, extra and model, with intervals: ``accuracy``, its ``change`` from equal
    classes in the same draws, and ``to_larger``, the share that is put into the larger class."""
    every = rows.explode(["n", "right", "to_larger"]).astype({"n": int})
    seeds = every.seed.nunique() > 1
    every["unit"] = every.seed if seeds else every.draw
    every["accuracy"] = every.right.astype(float) / every.n_test
    every["to_larger"] = every.to_larger.astype(float) / every.n_test
    keys = ["model", "n", "unit"]
    every = (
        every.groupby([*keys, "extra"])[["accuracy", "to_larger"]].mean().reset_index()
    )
    equal = every[every.extra == 0].set_index(keys).accuracy
    every["change"] = (
        every.accuracy - equal.reindex(every.set_index(keys).index).to_numpy()
    )
    table = []
    for (n, extra, model), part in every.groupby(["n", "extra", "model"]):
        line = {"n": n, "extra": extra, "model": model}
        for name, least in (("accuracy", 0), ("change", -1), ("to_larger", 0)):
            line |= estimate(part[name].tolist(), seeds).within(least, 1).columns(name)
        table.append(line)
    return pd.DataFrame(table)


@STUDY.table(
    "unequal",
    title="More training frames in one class",
    note="Changes of the test accuracy, on the same test frames, when one class has more training "
    "frames than the others. The majority of n frames whose hypervectors correlate by c multiplies "
    "every correlation, the floor of all frames too, by about √(2/π)·√(m/(1 + (m − 1)·c)), m = n "
    "for odd n and n − 1 for even n. For equal classes the factor cancels; a class with more "
    "frames has a larger one, and takes frames of the others. Balanced, the library's default: a "
    "class counts as if it had as many frames as the smallest. Brackets: Student over sensors or "
    "input fields; of one camera or sensor, the central 95 % of draws.",
    columns={
        "recording": Column("Frames"),
        "n": Column("n of each class"),
        "extra": Column("More of one class"),
        "equal": Column("HDC, equal classes, %", percent),
        "to_larger": Column(
            "Answers of HDC as published that name the larger class, %", percent
        ),
        **{model: Column(f"{name}, points", points) for model, name in NAMES.items()},
    },
)
def table(results: Results) -> pd.DataFrame | None:
    """A row for each scene, n and number of further frames: what they change."""
    lines = []
    for scene, measured in measurements(results).items():
        every = summary(measured.frame).set_index("model")
        for (n, extra), at in every[every.extra > 0].groupby(["n", "extra"]):
            equal = every[(every.n == n) & (every.extra == 0)]
            line = {"recording": scene, "n": n, "extra": extra}
            for end in ENDS:
                line[f"equal{end}"] = equal.loc["hdc", f"accuracy{end}"]
                line[f"to_larger{end}"] = at.loc["hdc", f"to_larger{end}"]
                line |= {
                    f"{model}{end}": at.loc[model, f"change{end}"] for model in NAMES
                }
            lines.append(line)
    if not lines:
        return None
    data = pd.DataFrame(lines)
    data.attrs["shown"] = [name for name in data if not name.endswith(ENDS[1:])]
    data.attrs["commands"] = [
        f"{RUN}unequal scene={scene}" for scene in measurements(results)
    ]
    return data


LINES = {  # label: model, further frames, colour, line
    "HDC, equal classes": ("hdc", 0, "black", "-"),
    "HDC as published, one more": ("hdc", 1, style_of("hdc")[0], "-"),
    "HDC, random ties, one more": ("hdc_random_ties", 1, style_of("hdc")[0], ":"),
    "HDC, balanced, one more": ("hdc_balanced", 1, "#009E73", "--"),
    "mean image, one more": ("mean_image", 1, style_of("mean_image")[0], "-."),
}


@STUDY.figure(
    "unequal",
    caption="Test accuracy against the number of training frames of each class, with and without "
    "one more in one class: HDC as published and by two remedies, and mean images.",
    size=(7.0, 2.8),
    needs=lambda results: bool(measurements(results)),
)
def figure(figure: Figure, results: Results) -> None:
    """A panel a scene, a line a rule."""
    shown = measurements(results)
    panels = figure.subplots(1, len(shown), sharey=True, squeeze=False)[0]
    for k, (axes, (scene, measured)) in enumerate(
        zip(panels, shown.items(), strict=True)
    ):
        every = summary(measured.frame)
        for model, extra, colour, line in LINES.values():
            part = every[(every.model == model) & (every.extra == extra)]
            axes.plot(
                part.n,
                100 * part.accuracy,
                color=colour,
                ls=line,
                marker="o",
                ms=2,
                lw=1,
            )
            low, high = 100 * part.accuracy_low, 100 * part.accuracy_high
            axes.fill_between(part.n, low, high, color=colour, alpha=0.1, lw=0)
        ticks = [n for n in (2, 5, 10, 20) if n in set(every.n)]
        axes.set(xscale="log", xlabel="frames of each class", ylim=(0, 103))
        axes.set_xticks(ticks, map(str, ticks))
        axes.minorticks_off()
        panel(axes, "abcdefgh"[k], scene)
    panels[0].set_ylabel("test accuracy (%)")
    handles = [
        Line2D([], [], color=c, ls=s, label=name)
        for name, (_, _, c, s) in LINES.items()
    ]
    figure.legend(handles=handles, loc="outside lower center", ncols=3)
    head(figure, "One more frame in one class", [])
