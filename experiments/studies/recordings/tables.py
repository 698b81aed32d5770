"""Accuracies on recordings as tables, and the forms of HDC beside the baseline."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

import pandas as pd

from experiments.records import configs
from experiments.records.results import of_scenes
from experiments.reporting.columns import (
    Column,
    display_name,
    model_columns,
    scene_name,
)
from experiments.reporting.measured import (
    ENDS,
    models_of,
    saturated,
    values_of,
)
from experiments.reporting.table import Table
from experiments.reporting.text import percent, points
from experiments.studies.recordings.values import (
    CONFIRMATORY,
    FEW,
    NOTE,
    RIVALS,
    Accuracies,
    accuracies_of,
    forms_of,
    gaps,
    kind,
    of_recording,
    recordings,
)

COLUMNS = {
    "recording": Column("Recording", scene_name),
    "kind": Column("Kind"),
    "frames": Column("Frames"),
    "n": Column("Frames per class"),
    "told": Column("Solved by a low-resolution baseline"),
}
# Models that see no speckle, and what it means where one of them is ahead of HDC.
TRIVIAL = {"brightness": "brightness", "thumbnail": "coarse layout"}


def front(frame: pd.DataFrame) -> pd.DataFrame:
    """The recordings, at the fewest, five and the largest number of frames per class."""
    found = recordings(frame)
    table = []
    for scene, rows in found.items():
        of_first = _about(scene, rows)
        for k, line in enumerate(_by_size(of_recording(rows))):
            described = {"kind": "", "frames": ""} if k else of_first
            table.append({"recording": scene, **described, **line})
    return _wide(table, COLUMNS, found.values())


def _about(scene: str, rows: pd.DataFrame) -> dict[str, str]:
    """The kind of the frames, and what they are."""
    frames = configs.scene_display(scene)["frames"]
    if saturated(rows):
        frames += "; saturated, ranks nothing"
    return {"kind": kind(scene, rows), "frames": frames}


def _by_size(every: Accuracies) -> Iterator[dict[str, Any]]:
    """Accuracies by the split that counts at the fewest, five and the most frames per class."""
    for n in every.ends():
        line: dict[str, Any] = {"n": n, "told": _told(every, n)}
        for model in every.models:
            mean = every.mean(model, n)
            if not math.isnan(mean.value):
                line |= mean.columns(model)
        yield line


def _told(every: Accuracies, n: int) -> str:
    """Which trivial models are ahead of HDC, and whether one is ahead of every other model."""
    ahead = [model for model in TRIVIAL if every.difference(model, "hdc", n).low > 0]
    if not ahead:
        return ""
    called = " and ".join(TRIVIAL[model] for model in ahead)
    text = f"{called} alone: more than HDC"
    leads = any(_leads(every, model, n) for model in ahead)
    return f"{text}, and than any model here" if leads else text


def _leads(every: Accuracies, model: str, n: int) -> bool:
    """Whether no other model is more accurate in the draws in which both were asked."""
    others = (every.difference(other, model, n).value for other in every.models)
    return not any(more > 0 for more in others)


def _wide(
    table: Sequence[Mapping[str, Any]],
    columns: Mapping[str, Column],
    found: Iterable[pd.DataFrame],
) -> pd.DataFrame:
    """The rows with the columns of what they are first, then each model's value, then bounds."""
    models: dict[str, None] = {}
    for rows in found:
        models |= dict.fromkeys(models_of(rows))
    data = pd.DataFrame(table)
    bounds = [name + end for name in models for end in ENDS[1:]]
    names = [*columns, *models, *bounds]
    return data[[name for name in names if name in data]]


def _columns(data: pd.DataFrame) -> dict[str, Column]:
    """How the columns are shown: what a row is of, and a column per model."""
    models = [name for name in values_of(data) if name not in COLUMNS]
    return {**COLUMNS, **model_columns(models, ", %", percent)}


def _shown(data: pd.DataFrame) -> list[str]:
    """The recording, then HDC as published and extended, the baseline and other models.

    Of these, models with an interval come first: others learnt from a few of the draws only.
    """
    first = ("recording", "n", "told", *CONFIRMATORY, *RIVALS)
    others = [name for name in values_of(data) if name not in (*first, *COLUMNS)]
    low = data.reindex(columns=[name + ENDS[1] for name in others])
    others = [others[k] for k in low.isna().sum().argsort(kind="stable")]
    return [*(name for name in first if name in data), *others]


def forms(frame: pd.DataFrame) -> pd.DataFrame:
    """A row for each recording, 5 and the most frames per class, and baseline."""
    table = []
    for scene, every in accuracies_of(of_scenes(frame, "recordings")).items():
        known = forms_of(every.models)
        sizes = [n for n in every.ends() if n >= FEW]
        for n, rival in itertools.product(sizes, RIVALS):
            line: dict[str, Any] = {"recording": scene, "n": n, "rival": rival}
            for gap in gaps(every, n, known, [rival]):
                line |= gap.difference.columns(gap.form)
            if len(line) > 3:
                table.append(line)
    return pd.DataFrame(table)


def _columns_of_forms(data: pd.DataFrame) -> dict[str, Column]:
    about = {
        "recording": COLUMNS["recording"],
        "n": COLUMNS["n"],
        "rival": Column("Baseline", display_name),
    }
    known = forms_of([name for name in values_of(data) if name not in about])
    return about | {form: Column(_form_head(form), points) for form in known}


def _shown_of_forms(data: pd.DataFrame) -> list[str]:
    return list(_columns_of_forms(data))


def _form_head(form: str) -> str:
    status = "fixed in advance" if form in CONFIRMATORY else "exploratory"
    return f"{display_name(form)} ({status})"


TABLES = [
    Table(
        "recordings",
        front,
        of="recordings",
        title="Accuracy on public recordings",
        note=f"{NOTE} Solved by a low-resolution baseline: where two numbers of a frame, its mean "
        "and deviation (brightness), or a picture of 8 × 6 pixels (coarse layout) recognise more "
        "than HDC, the interval of the difference above zero. Such frames differ by more than "
        "their fine pattern. Networks stop after a limited number of steps, torchhd's "
        "classifiers learn on hypervectors of this library's encoder.",
        key=("recording", "n"),
        columns=_columns,
        shown=_shown,
    ),
    Table(
        "forms",
        forms,
        of="recordings",
        title="Forms of HDC minus converged softmax regression, points",
        note=f"{NOTE} Above zero, the form of HDC is more accurate on the same test frames. "
        "Fixed in advance: named by the frozen rules. Exploratory: all others; the best of many "
        "on the frames that judge it is no claim.",
        key=("recording", "n", "rival"),
        columns=_columns_of_forms,
        shown=_shown_of_forms,
    ),
]
