"""Accuracies of torchhd's classifiers on the same bits, and of a network on the same frames."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import pandas as pd

from experiments.records.results import of_scenes
from experiments.reporting.columns import Column, model_columns, scene_name
from experiments.reporting.estimates import Estimate
from experiments.reporting.measured import ENDS, models_of, values_of, with_right
from experiments.reporting.table import Columns, Table
from experiments.reporting.text import number, percent

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


def accuracies(of_recording: pd.DataFrame) -> pd.DataFrame:
    """A row for each model, draw and n of the split that counts: ``accuracy``, and why the training
    ``stopped`` where that is known."""
    counting = of_recording[of_recording.split == "counts"]
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


def _wide(found: Mapping[str, pd.DataFrame], by_steps: bool = False) -> pd.DataFrame:
    """A row for each recording and n: the mean accuracy of each model, then how many trainings were
    `unfinished` if some learn `by_steps`, then the least and the largest accuracies."""
    table: list[dict[str, Any]] = []
    models: dict[str, None] = {}
    for scene, rows in found.items():
        models |= dict.fromkeys(models_of(rows))
        for n, of_size in accuracies(rows).groupby("n"):
            line = {"recording": scene, "n": n}
            for model, part in of_size.groupby("model"):
                values = part.accuracy
                estimate = Estimate(values.mean(), values.min(), values.max())
                line |= estimate.columns(str(model))
            if by_steps:
                line["unfinished"] = unfinished(of_size)
            table.append(line)
    last = ["unfinished"] if by_steps else []
    bounds = [model + end for model in models for end in ENDS[1:]]
    data = pd.DataFrame(table)
    return data[[*PLACE, *models, *last, *bounds]] if len(data) else data


def _columns(unit: str, show: Callable[[Any], str]) -> Columns:
    """How the columns are shown: what a row is of, then a column a model."""

    def columns(data: pd.DataFrame) -> dict[str, Column]:
        models = [
            name for name in values_of(data) if name not in (*PLACE, "unfinished")
        ]
        found = {**PLACE, **model_columns(models, unit, show)}
        return found | {"unfinished": Column("Trainings not finished")}

    return columns


def peers(frame: pd.DataFrame) -> pd.DataFrame:
    """Accuracy of torchhd's classifiers by recording and number of frames per class."""
    return _wide(of_scenes(frame, "recordings_peers"))


def _note(frame: pd.DataFrame) -> str:
    """How to read the table, with the numbers of epochs."""
    found = of_scenes(frame, "recordings_peers").values()
    epochs = set().union(*(_epochs(rows.config.iloc[0]) for rows in found))
    return NOTE.replace("{epochs}", " or ".join(map(str, sorted(epochs))))


def _epochs(config: Mapping[str, Any]) -> set[int]:
    """Numbers of epochs of the models of a measurement, where they have one."""
    settings = [dict(part["model"]) for part in config.get("models", {}).values()]
    return {setting["epochs"] for setting in settings if "epochs" in setting}


def times(frame: pd.DataFrame) -> pd.DataFrame:
    """Seconds of training of each model, a row for each recording."""
    table: list[dict[str, Any]] = []
    models: dict[str, None] = {}
    for scene, rows in of_scenes(frame, "peers_costs").items():
        by_model = rows.set_index("model")
        models |= dict.fromkeys(models_of(rows))
        n = by_model.n.iloc[0]
        table.append({"recording": scene, "n": n, **by_model.fit_s.to_dict()})
    return pd.DataFrame(table)[[*PLACE, *models]]


def networks(frame: pd.DataFrame) -> pd.DataFrame:
    """Accuracy of a network by recording and number of frames per class, and what was not
    finished."""
    return _wide(of_scenes(frame, "recordings_networks"), by_steps=True)


TABLES = [
    Table(
        "peers",
        peers,
        of="recordings_peers",
        key=("recording", "n"),
        title="Classifiers of torchhd on the same bits",
        note=_note,
        columns=_columns(", %", percent),
    ),
    Table(
        "peers_times",
        times,
        of="peers_costs",
        key=("recording",),
        title="Training times of torchhd's classifiers",
        note="Seconds from frames in memory to a model that can predict, once: rough.",
        folded=True,
        columns=_columns(", s", number),
    ),
    Table(
        "networks",
        networks,
        of="recordings_networks",
        key=("recording", "n"),
        title="A network of one layer on frames of cameras",
        note=f"{DRAWS} Networks train until their loss says that all frames are learnt, or for "
        "as many steps as the experiment allows: the last column counts those that were ended "
        "so, whose accuracy may be below what they would reach.",
        columns=_columns(", %", percent),
    ),
]
