"""Named forms against softmax, by data set and over all."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import pandas as pd

from experiments.reporting.columns import scene_name
from experiments.reporting.estimates import Estimate
from experiments.reporting.facets import intervals
from experiments.reporting.forms import FORMS, RIVAL_FORM
from experiments.reporting.plot import handle, legend_below, literal, look_of
from experiments.reporting.resamples import place_of
from experiments.reporting.study import RUN, Figure
from experiments.reporting.table import ENDS, Table
from experiments.reporting.text import CAPTURED, COMPUTED, SIMULATED, kind_of
from experiments.studies.claims.judge import judge
from experiments.studies.claims.rules import LARGEST, RULES, read
from experiments.studies.recordings.figures import SPLIT
from experiments.studies.recordings.tables import FEW, Accuracies, recordings

if TYPE_CHECKING:
    from matplotlib.figure import Figure as Canvas

WIDTH = 5.4  # in; narrow, so that its letters can be read on a phone
MARGIN = 3  # points, the largest loss that the rules accept
ALL = "all"
# Kinds of rows and their headings, from top to bottom.
HEADINGS = {
    CAPTURED: "captured by a camera",
    COMPUTED: "computed from\nmeasured matrices",
    SIMULATED: "simulated",
    ALL: "",
}
HELD = tuple(form for form in FORMS if form != RIVAL_FORM)  # against it
SIZES = {"few": f"{FEW} frames per class", "most": "the most frames per class"}
OF_RULES = {FEW: "few", LARGEST: "most"}


def forest(frame: pd.DataFrame) -> pd.DataFrame:
    """Each named form minus softmax of standardised frames on each data set at five and the most
    frames per class: ``size``, ``n``, ``form`` and ``difference`` with its 95 % interval; and
    means over all sources, of kind ``all``."""
    lines = []
    for scene, rows in recordings(frame).items():
        every = Accuracies(rows)
        about = {"recording": scene, "kind": kind_of(str(rows.origin.iloc[0]))}
        for size, n in zip(SIZES, (FEW, every.sizes[-1]), strict=True):
            for form in HELD:
                gap = every.difference(form, RIVAL_FORM, n)
                at = {"size": size, "n": n, "form": form}
                lines.append(about | at | gap.columns("difference"))
    found = pd.DataFrame([*lines, *_pooled(frame)] if lines else [])
    return found.dropna(subset="difference") if lines else found


def _pooled(frame: pd.DataFrame) -> list[dict[str, Any]]:
    """The means over sources by the rules, a row per form and size."""
    rules = read(RULES)
    judged = judge(rules, frame).dropna(subset="mean")
    judged = judged[(judged.rival == RIVAL_FORM) & (judged.status == "all")]
    rows = []
    for row in judged[judged["size"].isin(OF_RULES)].to_dict("records"):
        about = {"recording": "mean over sources", "kind": ALL}
        at = {"size": OF_RULES[row["size"]], "form": rules.claims[row["claim"]].form}
        mean = Estimate(*(row[f"mean{end}"] / 100 for end in ENDS))
        rows.append(about | at | mean.columns("difference"))
    return rows


def draw(figure: Canvas, data: pd.DataFrame) -> None:
    """A row of panels per kind: five frames per class, and the most."""
    from matplotlib.patches import Patch

    names = {
        kind: sorted(data.recording[data.kind == kind].unique(), key=place_of)
        for kind in HEADINGS
        if kind in set(data.kind)
    }
    heights = [len(of_kind) for of_kind in names.values()]
    figure.set_size_inches(WIDTH, 1.8 + 0.4 * sum(heights))
    shape = {"height_ratios": heights}
    panels = figure.subplots(
        len(names), 2, sharex=True, sharey="row", squeeze=False, gridspec_kw=shape
    )
    forms = [form for form in HELD if form in set(data.form)]
    for row, (kind, of_kind) in zip(panels, names.items(), strict=True):
        for axes, size in zip(row, SIZES, strict=True):
            shown = data[(data.kind == kind) & (data["size"] == size)]
            axes.axvspan(-MARGIN, MARGIN, color="0.88", lw=0, zorder=0)
            axes.axvline(0, color="0.4", lw=0.7, zorder=1)
            intervals(
                axes,
                shown,
                *("difference", "recording", "form"),
                names=of_kind,
                hues=forms,
                look=lambda form: {"elinewidth": 0.9, **_look(form)},
                scale=100,
                apart=0.66,
            )
            axes.set_ylim(len(of_kind) - 0.5, -0.5)
            axes.tick_params(labelsize=8)
        shown_names = [literal(scene_name(name)) for name in of_kind]
        row[0].set_yticks(range(len(of_kind)), shown_names)
        row[0].set_ylabel(HEADINGS[kind], fontsize=8)
    for axes, letter, title in zip(panels[0], "ab", SIZES.values(), strict=True):
        axes.set_title(f"({letter}) {title}", loc="left", fontsize=8, pad=3)
    for axes in panels[-1]:
        axes.set_xlabel("accuracy minus softmax\n(percentage points)", fontsize=8)
    handles: list[Any] = [handle(form, **_look(form)) for form in forms]
    handles.append(Patch(color="0.88", label=f"±{MARGIN:g} percentage points"))
    legend_below(figure, handles, 2)


def _look(form: str) -> dict[str, Any]:
    return {**look_of(form), "ls": "", "ms": 3.5}


FIGURE = Figure(
    "forest",
    Table("forest", forest, of="recordings", commands=[f"{RUN}recordings"]),
    draw,
    title="Test accuracy minus that of standardised softmax, by data set",
    details=SPLIT,
    caption="Test accuracy of HDC and of two simple baselines minus that of softmax regression on "
    "standardised frames, fitted to convergence. Right of zero: more accurate than softmax. Grey "
    f"band: ±{MARGIN:g} points, the largest loss that rules 4 accept. Bars: 95 %, Student over "
    "input fields or seeds, the central 95 % of draws for cameras; no bar where fewer than ten "
    "draws were made. Last row: means over sources by rules 4.",
    size=(WIDTH, 3.8),
)
