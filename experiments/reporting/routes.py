"""Routes of the benchmark by name, and the time of the ordinary ones, those of other libraries."""

from __future__ import annotations

import math

import pandas as pd

from experiments.records.results import Group, Results
from experiments.reporting.table import records

OPERATIONS = ("encode", "bundle", "hamming", "train", "predict", "folder", "video")
OURS, OURS_COMPILED = "hdc", "hdc, compiled"
READ, COPY = "one read of the bytes", "one copy of the bytes"
NUMKONG, TORCHHD_BUNDLE = "numkong.cdist", "torchhd.multiset"
DECODE_IMAGES = "cv2.imread alone, as many threads"
DECODE_VIDEO = "cv2.VideoCapture alone"
TORCHHD_TRAIN = "torch.median, torchhd.multiset"
NO_RESULT = (READ, COPY, DECODE_IMAGES, DECODE_VIDEO)
ORDINARY_ROUTES = (TORCHHD_TRAIN, "numpy.median, torchhd.multiset")

ORDINARY = "HDC by ordinary routes"
HEADLINE = {"n": 400, "d": 250_000, "l": 5}


def ordinary_training_s(results: Results, group: Group) -> float | None:
    """Seconds in which the faster of the ordinary routes makes prototypes of as many frames as a
    group's, on its processor and as many threads; None where that was not measured."""
    measured = results.measured("benchmark")
    if measured is None or not group.runs:
        return None
    record, made_on = group.runs[0].record, measured.record.environment
    machine = (record.environment.cpu, record.environment.threads)
    if (made_on.cpu, made_on.threads) != machine:
        return None
    sizes = {
        "n": record.n_train,
        "d": math.prod(record.scene.shape),
        "l": len(group.classes),
    }
    seconds = []
    for route in ORDINARY_ROUTES:
        median = of_route(measured.frame, "train", route, **sizes)["median_s"]
        if not math.isnan(median):
            seconds.append(median)
    return min(seconds, default=None)


def of_route(
    rows: pd.DataFrame, operation: str, route: str, **sizes: int
) -> dict[str, float]:
    """Median and ratio of a route at these sizes, NaN where it was not measured.

    A size that is not given is the headline's, or the only one that was measured.
    """
    rows = rows[(rows["operation"] == operation) & (rows["route"] == route)]
    for key, value in (HEADLINE | sizes).items():
        if key in sizes or rows[key].nunique() > 1:
            rows = rows[rows[key] == value]
    row = records(rows)[0] if len(rows) else {}
    return {key: row.get(key) or math.nan for key in ("median_s", "ratio_to_ours")}
