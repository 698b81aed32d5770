"""Accuracies of torchhd's classifiers on the same bits, and of a network on the same frames."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import pandas as pd

from experiments.records.measurement import Measured
from experiments.records.results import Results
from experiments.reporting.columns import Column, model_columns, scene_name
from experiments.reporting.estimates import Estimate
from experiments.reporting.measured import ENDS, by_scene, models_of, with_right
from experiments.reporting.study import RUN
from experiments.reporting.text import number, percent
from experiments.studies.recordings.study import STUDY

PLACE = {
    "recording": Column("Recording", scene_name),
    "n": Column("Frames per class"),
}
DRAWS = (
    "On the split that counts, mean of the draws with the least and the largest; draws are of "
    "frames of one sensor, and no interval for another."
)


NOTE = (
    f"{DRAWS} Torchhd's classifiers learn and predict with its own code, on hypervectors of this "
    "library's encoder in place of its own, for {epochs} epochs. Prototypes have one bit a pixel; "
    "those of AdaptHD and OnlineHD have a number of 32 bits, the weights of “HDC, lda” four."
)
FINISHED = ("finished", "trained", "reached")  # of experiments.protocol.stop


def accuracies(measured: Measured) -> pd.DataFrame:
    """A row for each model, draw and n of the split that counts: ``accuracy``, and why the training
    ``stopped`` where that is known."""
    counting = measured.frame[measured.frame.split == "counts"]
    rows = with_right(counting, ("seed", "draw"))
    table = []
    for row in rows.to_dict("records"):
        reasons = row.get("stopped")
        if not isinstance(reasons, list):  # a model that does not learn by steps
            reasons = [None] * len(row["n"])
        for n, right, stopped in zip(row["n"], row["right"], reasons, strict=True):
            accuracy = right / row["n_test"]
            line = {"model": row["model"], "n": n, "accuracy": accuracy}
            table.append({**line, "stopped": stopped})
    return pd.DataFrame(table, columns=["model", "n", "accuracy", "stopped"])


def unfinished(rows: pd.DataFrame) -> str:
    """How many trainings by steps were ended before they had finished, such as ``2 of 3``."""
    reasons = rows.stopped.dropna()
    cut = ~reasons.isin(FINISHED)
    return f"{cut.sum()} of {len(reasons)}"


def _wide(
    found: Mapping[str, Measured], experiment: str, by_steps: bool = False
) -> pd.DataFrame | None:
    """A row for each recording and n: the mean accuracy of each model, then how many trainings were
    `unfinished` if some learn `by_steps`, then the least and the largest accuracies."""
    table: list[dict[str, Any]] = []
    models: dict[str, None] = {}
    for scene, measured in found.items():
        models |= dict.fromkeys(models_of(measured.frame))
        for n, of_size in accuracies(measured).groupby("n"):
            line = {"recording": scene, "n": n, "unfinished": unfinished(of_size)}
            for model, part in of_size.groupby("model"):
                values = part.accuracy
                estimate = Estimate(values.mean(), values.min(), values.max())
                line |= estimate.columns(str(model))
            table.append(line)
    if not table:
        return None
    columns = {**PLACE, **model_columns(models, ", %", percent)}
    if by_steps:
        columns["unfinished"] = Column("Trainings not finished")
    bounds = [model + end for model in models for end in ENDS[1:]]
    data = pd.DataFrame(table)[[*columns, *bounds]]
    commands = [f"{RUN}{experiment} scene={scene}" for scene in found]
    data.attrs |= {"columns": columns, "shown": list(columns), "commands": commands}
    return data


@STUDY.table(
    "peers",
    key=("recording", "n"),
    title="Classifiers of torchhd on the same bits",
)
def peers(results: Results) -> pd.DataFrame | None:
    """Accuracy by recording and number of frames per class."""
    found = by_scene(results, "recordings_peers")
    data = _wide(found, "recordings_peers")
    if data is not None:
        epochs = sorted(set().union(*map(_epochs, found.values())))
        said = " or ".join(map(str, epochs))
        data.attrs["note"] = NOTE.replace("{epochs}", said)
    return data


def _epochs(measured: Measured) -> set[int]:
    """Numbers of epochs of the models of a measurement, where they have one."""
    models = measured.record.config.get("models", {}).values()
    settings = [dict(part["model"]) for part in models]
    return {setting["epochs"] for setting in settings if "epochs" in setting}


@STUDY.table(
    "peers_times",
    key=("recording",),
    title="Training times of torchhd's classifiers",
    note="Seconds from frames in memory to a model that can predict, once: rough.",
    folded=True,
)
def times(results: Results) -> pd.DataFrame | None:
    """Seconds of training of each model, a row for each recording."""
    found = by_scene(results, "peers_costs")
    table: list[dict[str, Any]] = []
    models: dict[str, None] = {}
    for scene, measured in found.items():
        rows = measured.frame.set_index("model")
        models |= dict.fromkeys(models_of(measured.frame))
        line = {"recording": scene, "n": rows.n.iloc[0], **rows.fit_s.to_dict()}
        table.append(line)
    if not table:
        return None
    columns = {**PLACE, **model_columns(models, ", s", number)}
    data = pd.DataFrame(table)[list(columns)]
    commands = [f"{RUN}peers_costs scene={scene}" for scene in found]
    data.attrs |= {"columns": columns, "commands": commands}
    return data


@STUDY.table(
    "networks",
    key=("recording", "n"),
    title="A network of one layer on frames of cameras",
    note=f"{DRAWS} Networks train until their loss says that all frames are learnt, or for as many "
    "steps as the experiment allows: the last column counts those that were ended so, whose "
    "accuracy may be below what they would reach.",
)
def networks(results: Results) -> pd.DataFrame | None:
    """Accuracy by recording and number of frames per class, and what was not finished."""
    found = by_scene(results, "recordings_networks")
    return _wide(found, "recordings_networks", by_steps=True)
