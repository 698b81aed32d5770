"""Every model on measured recordings: accuracies, where information is lost, distances."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from experiments.records.measurement import Measured
from experiments.records.results import Results
from experiments.reporting.columns import Column
from experiments.reporting.estimates import Estimate, mean_interval
from experiments.reporting.plot import errors, head, panel
from experiments.reporting.study import RUN, Study
from experiments.reporting.text import number, percent, points

STUDY = Study(
    "recordings",
    "Measured recordings",
    "On frames that others measured with optical sensors of several kinds: does HDC recognise "
    "better than its rivals, where does it lose information, and where does the median gain?",
    0.5,
    front=True,
)
SATURATED = 0.995  # accuracy from which a recording cannot tell models apart
RIVAL = "softmax_dual"  # the primary rival, named beforehand: the paper's own, at its optimum
# By what a model keeps of the frames: grey values, bits, one template a class.
STEPS = {
    "ridge": "ridge, greys",
    "ridge_standardised": "ridge, standardised",
    RIVAL: "softmax optimum",
    "linear_bits": "ridge, bits",
    "nearest_neighbour": "1-NN, bits",
    "mean_image": "mean image",
    "mean_image_standardised": "mean, standardised",
    "hdc_integer": "counts of bits",
    "hdc": "majority: HDC",
}
SHOWN_N = (1, 5, 20, 50)
FIELDS = {
    "fibre_grouped": 1,
    "fibre_4_fields": 4,
    "fibre_16_fields": 16,
}  # input fields
KINDS = {
    "diffuser": "laser speckle behind ground glass",
    "fibre_grouped": "multimode fibre, pressed; 3,362 pixels of 110 modes, computed from measured "
    "matrices",
    "fibre_2": "second fibre; computed from measured matrices",
    "fibre_3": "third fibre; computed from measured matrices",
    "spr": "specklegrams of a fibre sensor",
    "gelsight": "camera under an elastomer with markers; no speckle",
    "tactip": "camera under a skin with pins; no speckle",
}


def recordings(results: Results, name: str = "recordings") -> dict[str, Measured]:
    """:func:`by_scene` in the order of :data:`KINDS`; one fibre counts once, by one field."""
    found = by_scene(results, name)
    known = [scene for scene in KINDS if scene in found]
    return {
        scene: found[scene]
        for scene in [*known, *sorted(set(found) - {*known, *FIELDS})]
    }


def by_scene(results: Results, name: str) -> dict[str, Measured]:
    """Finished measurements by the name of their scene; of several of one scene the one whose
    config was changed least."""
    found: dict[str, Measured] = {}
    for measured in results.measurements:  # those changed least come first
        if measured.record.name == name:
            found.setdefault(measured.record.scene, measured)
    return found


def accuracies(rows: pd.DataFrame) -> pd.DataFrame:
    """A row for each split, model, n and unit: ``accuracy``. The unit is what varies: the seed
    where there are several (another input field or fibre), else the draw of frames."""
    every = rows.explode(["n", "right"]).astype({"n": int, "right": float})
    several = every.seed.nunique() > 1
    every["unit"] = every.seed if several else every.draw
    every["accuracy"] = every.right / every.n_test
    return every.groupby(["split", "model", "n", "unit"]).accuracy.mean().reset_index()


def estimate(values: Sequence[float], seeds: bool) -> Estimate:
    """Mean with Student's interval over seeds; of draws from one recording, which share frames,
    with the central 95 % of the draws."""
    if seeds:
        return mean_interval(list(values))
    low, high = np.quantile(values, (0.025, 0.975))
    return Estimate(float(np.mean(values)), float(low), float(high))


def summary(measured: Measured) -> pd.DataFrame:
    """``model``, ``n`` and accuracy with its interval, by the split that counts."""
    every = accuracies(measured.frame).query("split == 'counts'")
    seeds = measured.frame.seed.nunique() > 1
    table = []
    for (model, n), part in every.groupby(["model", "n"]):
        table.append(
            {
                "model": model,
                "n": n,
                **estimate(part.accuracy, seeds).columns("accuracy"),
            }
        )
    return pd.DataFrame(table)


COLUMNS = {
    "recording": Column("Recording"),
    "frames": Column("Frames"),
    "n": Column("Frames per class"),
    "hdc": Column("HDC, %", percent),
    "mean_image": Column("Mean image, %", percent),
    "linear_bits": Column("Ridge on the same bits, %", percent),
    "softmax_dual": Column("Softmax at its optimum, %", percent),
    "softmax_dual_standardised": Column(
        "Softmax at its optimum, standardised frames, %", percent
    ),
    "nearest_neighbour": Column("Nearest neighbour on bits, %", percent),
    "softmax": Column("Softmax, published recipe, two draws, %", percent),
}
NOTE = (
    "Split by time, session, group or position, as each recording states, so that near copies of a "
    "test frame do not train. Brackets: Student over seeds (input fields, fibres) for fibres, the "
    "central 95 % of draws for cameras, each of which is one sensor. Standardised: each frame with "
    "mean 0 and deviation 1. Primary rival, named beforehand: softmax regression at its optimum."
)


@STUDY.table(
    "recordings", title="Accuracy on measured recordings", note=NOTE, columns=COLUMNS
)
def front(results: Results) -> pd.DataFrame | None:
    """The recordings, at the fewest, a middle and the largest number of frames per class."""
    table = []
    for scene, measured in recordings(results).items():
        saturated = measured.record.config["scene"].get("saturated")
        frames = KINDS.get(scene, "recording") + "; saturated, ranks nothing" * bool(
            saturated
        )
        for k, line in enumerate(_by_size(measured)):
            table.append({"recording": scene, "frames": "" if k else frames, **line})
    if not table:
        return None
    data = pd.DataFrame(table)
    names = [name for name in COLUMNS if name in data]
    data.attrs["shown"] = names
    data.attrs["commands"] = [
        f"{RUN}recordings scene={scene}" for scene in recordings(results)
    ]
    return data[[*names, *(c for c in data if c.endswith(("_low", "_high")))]]


def _by_size(measured: Measured) -> list[dict[str, Any]]:
    """Accuracies by the split that counts at the fewest, five and the most frames per class."""
    lines = summary(measured)
    sizes, table = sorted(lines.n.unique()), []
    for n in dict.fromkeys((sizes[0], *[n for n in sizes if n == 5], sizes[-1])):
        line = {"n": n}
        for model, part in lines[lines.n == n].set_index("model").iterrows():
            if model in COLUMNS:
                line |= {
                    f"{model}{end}": part[f"accuracy{end}"]
                    for end in ("", "_low", "_high")
                }
        table.append(line)
    return table


@STUDY.table(
    "recordings_fields",
    title="One fibre seen through more input fields",
    columns={"fields": Column("Input fields"), "pixels": Column("Pixels"), **COLUMNS},
    note=NOTE + " More fields are more pixels of the same 110 modes.",
    folded=True,
)
def fields(results: Results) -> pd.DataFrame | None:
    """The first fibre by the number of input fields."""
    found, table = by_scene(results, "recordings"), []
    for scene, count in FIELDS.items():
        if scene in found:
            side = found[scene].record.config["scene"]["side"]
            lines = _by_size(found[scene])
            table += [
                {"fields": count, "pixels": 2 * side**2 * count, **line}
                for line in lines
            ]
    if not table:
        return None
    data = pd.DataFrame(table)
    data.attrs["shown"] = [
        "fields",
        "pixels",
        *(name for name in COLUMNS if name in data),
    ]
    data.attrs["commands"] = [f"{RUN}recordings scene={scene}" for scene in FIELDS]
    return data


@STUDY.table(
    "recording_theory",
    title="Theory from ten frames of every class, and what was measured",
    columns={
        "recording": Column("Recording"),
        "n": Column("Frames per class"),
        "hdc": Column("HDC, %", percent),
        "hdc_theory": Column("HDC by theory, %", percent),
        "mean_image": Column("Mean image, %", percent),
        "mean_image_theory": Column("Mean image by theory, %", percent),
        "cost": Column("Cost of the bit, points", points),
        "cost_theory": Column("Cost by theory, points", points),
    },
    note="Random split, because theory takes all frames of a class as alike. Theory knows the "
    "correlations of pairs among ten frames of every class and classifies none; brackets: the "
    "central 95 % of 20 choices of the ten. Mean image: compared by correlation. Cost of the bit: "
    "mean image less HDC.",
    folded=True,
)  # fmt: skip
def foretold(results: Results) -> pd.DataFrame | None:
    """A row for each recording and n of which both theory and a measurement are there."""
    table, benches = [], recordings(results)
    for scene, expected in recordings(results, "recording_theory").items():
        if scene not in benches:
            continue
        lines = accuracies(benches[scene].frame).query("split == 'random'")
        measured = lines.groupby(["n", "model"]).accuracy.mean().unstack()
        rows = expected.frame.assign(cost=lambda frame: frame.mean_image - frame.hdc)
        for n, part in rows.groupby("n"):
            if n in measured.index:
                hdc, image = measured.loc[n, ["hdc", "correlation"]]
                line = {"recording": scene, "n": n, "hdc": hdc, "mean_image": image}
                line |= {"cost": image - hdc}
                for name in ("hdc", "mean_image", "cost"):
                    line |= estimate(part[name].tolist(), seeds=False).columns(
                        f"{name}_theory"
                    )
                table.append(line)
    if not table:
        return None
    data = pd.DataFrame(table)
    data.attrs["commands"] = [
        f"{RUN}recording_theory scene={name}" for name in data.recording.unique()
    ]
    return data


@STUDY.figure(
    "recordings",
    caption="Where information is lost: accuracy by what a model keeps of the frames, on each "
    "measured recording that is not saturated. Left of the line models that weigh pixels or keep "
    "all frames, right of it one template per class. Split by time, group or position; bars: 95 %.",
    size=(7.0, 3.1),
    needs=lambda results: bool(recordings(results)),
)
def lost(figure: Figure, results: Results) -> None:
    """Accuracy by what a model keeps of the frames, a panel per recording, a line per n."""
    shown = {
        scene: measured
        for scene, measured in recordings(results).items()
        if not measured.record.config["scene"].get("saturated")
    }
    panels = figure.subplots(1, max(1, len(shown)), sharey=True, squeeze=False)[0]
    colours, markers = ("#56B4E9", "#0072B2", "#E69F00", "#D55E00"), "osD^"
    looks = dict(zip(SHOWN_N, zip(colours, markers, strict=True), strict=True))
    for k, (axes, (scene, measured)) in enumerate(
        zip(panels, shown.items(), strict=False)
    ):
        lines = summary(measured)
        for n, (colour, marker) in looks.items():
            at = lines[lines.n == n].set_index("model")
            places = [i for i, model in enumerate(STEPS) if model in at.index]
            values = at.loc[[list(STEPS)[i] for i in places]]
            y, spread = errors(
                values[["accuracy", "accuracy_low", "accuracy_high"]], 100
            )
            axes.errorbar(places, y, yerr=np.maximum(spread, 0), color=colour, marker=marker,
                          ls=":", lw=0.6, ms=3, elinewidth=0.5, label=f"{n}")  # fmt: skip
        axes.axvline(4.5, color="0.7", lw=0.6)
        axes.set_xticks(range(len(STEPS)), STEPS.values(), rotation=90, fontsize=6.5)
        axes.set_ylim(0, 103)
        panel(axes, "abcdefgh"[k], scene)
    panels[0].set_ylabel("accuracy (%)")
    handles, labels = panels[0].get_legend_handles_labels()
    figure.legend(
        handles,
        labels,
        title="frames per class",
        loc="outside lower center",
        ncols=len(labels),
    )


@STUDY.figure(
    "recording_distances",
    caption="Hamming distances between hypervectors of frames of one class (intra) and of two "
    "(inter), and their separation d′.",
    size=(7.0, 2.6),
    needs=lambda results: bool(recordings(results, "recording_distances")),
)
def distances(figure: Figure, results: Results) -> None:
    """Histograms of intra- and inter-class distances, a panel a recording."""
    shown = recordings(results, "recording_distances")
    panels = figure.subplots(1, len(shown), squeeze=False, sharex=True)[0]
    for k, (axes, (scene, measured)) in enumerate(
        zip(panels, shown.items(), strict=True)
    ):
        for kind, colour in (("intra", "#0072B2"), ("inter", "#D55E00")):
            part = (
                measured.frame.query("kind == @kind")
                .groupby("low", as_index=False)["count"]
                .sum()
            )
            axes.step(part.low, part["count"] / part["count"].sum(), where="post", color=colour,
                      lw=0.9, label=kind)  # fmt: skip
        panel(
            axes,
            "abcdefgh"[k],
            f"{scene}\nd′ = {number(separation(measured.frame), 2)}",
        )
        axes.set_yticks([])
        axes.set_xlabel("share of bits", fontsize=6)
    panels[0].legend()
    head(figure, "Hamming distances between frames of one class and of two", [])


def separation(rows: pd.DataFrame) -> float:
    """d′ = |mean inter − mean intra| / √((variance inter + variance intra)/2)."""
    moments = rows.groupby("kind")[["mean", "variance"]].mean()
    gap = abs(moments["mean"]["inter"] - moments["mean"]["intra"])
    return float(gap / np.sqrt(moments["variance"].mean()))


def over_rival(
    measured: Measured, sizes: Sequence[int] = ()
) -> list[tuple[Estimate, int]]:
    """HDC's accuracy less that of the primary rival, by the split that counts, and n: each of these
    frames a class that was asked for, or the most at which one is below :data:`SATURATED`."""
    rows = measured.frame[measured.frame.model.isin(("hdc", RIVAL))]
    every = accuracies(rows).query("split == 'counts'")
    chosen = [n for n in sizes if n in set(every.n)]
    if not sizes:
        least = every.groupby(["n", "model"]).accuracy.mean().groupby("n").min()
        open_sizes = least[least < SATURATED].index
        chosen = [int(max(open_sizes)) if len(open_sizes) else int(least.index.min())]
    at = every.pivot(index=["n", "unit"], columns="model", values="accuracy")
    seeds = rows.seed.nunique() > 1
    return [(estimate((at["hdc"] - at[RIVAL])[n].tolist(), seeds), n) for n in chosen]
