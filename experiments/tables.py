"""Tables from records: the numbers of every row. Their text is :mod:`experiments.table_text`.

What a row says, for the records of all its seeds:

- Times are medians with quartiles. The training time of a model that learns step by step is the
  paper's: until its training accuracy exceeded 90 %. A seed that never did counts as infinitely
  long, so a median or quartile may be "not reached in T s". A model that learns in one pass has the
  time until it is done (for HDC: until the prototypes are made).
- Accuracies are means over the seeds. ``test_accuracy_final`` is that of the last model; its
  interval is Wilson's for the counts of all seeds together, as if they were independent samples.
- ``mcnemar_p`` is the exact McNemar test against ``hdc`` on the same test samples, seeds together.
"""

from __future__ import annotations

import csv
import functools
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from experiments import evaluate, sources
from experiments.record import ROOT
from experiments.selection import Group, Records, Run, numbers, sweep

Row = dict[str, Any]

PUBLISHED_TEST_SAMPLES = 100  # Fig. 5(a) of the paper

# Columns of table1.csv and table1_extended.csv.
# fmt: off
TABLE1 = (
    "model", "n_train",
    "training_time_s", "training_time_q25_s", "training_time_q75_s",
    "time_to_90_train_s", "time_to_90_test_s", "total_time_s",
    "train_accuracy_max", "train_accuracy_final", "test_accuracy_max", "test_accuracy_final",
    "test_ci_low", "test_ci_high", "mcnemar_p", "model_bytes", "predict_single_s",
    "training_time_over_hdc",
    "published_training_time_s", "published_training_time_over_hdc", "published_train_accuracy",
    "published_test_accuracy", "published_test_ci_low", "published_test_ci_high",
    "seeds", "stop", "status", "scene", "origin", "cpu", "threads", "code",
)
# Columns of accuracy_vs_n.csv, accuracy_vs_d.csv and work_precision.csv.
CURVE = (
    "model", "n_train", "pixels", "test_accuracy_final", "test_ci_low", "test_ci_high",
    "test_accuracy_max", "training_time_s", "training_time_q25_s", "training_time_q75_s",
    "predict_single_s", "predict_batch_s_per_frame", "model_bytes",
    "seeds", "stop", "status", "scene", "origin", "code",
)
# fmt: on


def table1(records: Records, experiment: str = "table1") -> list[Row]:
    """One row for each model of the experiment, in its order."""
    params = sweep(experiment)
    scene = params["scene"][0]
    hdc = records.group(scene, "hdc")
    return [row(records.group(scene, model), hdc) for model in params["model"]]


def curve(records: Records, experiments: Sequence[str]) -> list[Row]:
    """One row for each model, number of training samples and of pixels of the experiments."""
    rows = []
    for experiment in experiments:
        params = sweep(experiment)
        scene = params["scene"][0]
        for model in params["model"]:
            for n in numbers(params.get("split.n_train", ["null"])):
                for pixels in numbers(params.get("data.pixels", ["null"])):
                    hdc = records.group(scene, "hdc", n, pixels)
                    rows.append(row(records.group(scene, model, n, pixels), hdc))
    return rows


def row(group: Group, hdc: Group) -> Row:
    """What the runs of a group say, with the published numbers; None where there is nothing."""
    result: Row = {
        "model": group.model,
        "n_train": group.n_train,
        "pixels": group.pixels,
        "seeds": len(group.runs),
        "status": group.status,
        "scene": group.scene,
        **_published(group),
    }
    if not group.runs:
        return result
    runs, records = group.runs, [run.record for run in group.runs]
    longest = max(record["training_s"] for record in records)
    q25, median, q75 = _quartiles([training_time(run) for run in runs])
    right = sum(int(_right(record).sum()) for record in records)
    n_test = sum(record["n_test"] for record in records)
    low, high = evaluate.wilson(right, n_test)

    def mean(key: str) -> float | None:
        values = [record[key] for record in records if record[key] is not None]
        return float(np.mean(values)) if values else None

    def to_target(key: str) -> float | str:
        return _reached(_quartiles([_or_never(record[key]) for record in records])[1], longest)

    reference = _quartiles([training_time(run) for run in hdc.runs])[1] if hdc.runs else None
    result |= {
        "n_train": records[0]["n_train"],
        "pixels": group.pixels or int(np.prod(records[0]["scene"]["shape"])),
        "training_time_s": _reached(median, longest),
        "training_time_q25_s": _reached(q25, longest),
        "training_time_q75_s": _reached(q75, longest),
        "time_to_90_train_s": to_target("time_to_target_train_s"),
        "time_to_90_test_s": to_target("time_to_target_test_s"),
        "total_time_s": float(np.median([record["training_s"] for record in records])),
        "train_accuracy_max": mean("train_accuracy_max"),
        "train_accuracy_final": mean("train_accuracy_final"),
        "test_accuracy_max": mean("test_accuracy_max"),
        "test_accuracy_final": right / n_test,
        "test_ci_low": low,
        "test_ci_high": high,
        "n_test": n_test,
        "mcnemar_p": None if group.model == "hdc" else mcnemar(runs, hdc.runs),
        "model_bytes": _same(record["model_bytes"] for record in records),
        "predict_single_s": float(np.median([r["predict_single_s"] for r in records])),
        "predict_batch_s_per_frame": float(
            np.median([r["predict_batch_s_per_frame"] for r in records])
        ),
        "training_time_over_hdc": (
            median / reference if reference and np.isfinite(median) else None
        ),
        "stop": "; ".join(sorted({record["stop"] for record in records})),
        "origin": _same(record["scene"]["origin"] for record in records),
        "cpu": _same(record["environment"]["cpu"] for record in records),
        "threads": _same(record["environment"]["threads"] for record in records),
        "code": ", ".join(sources.outdated(_files(records))) or "current",
    }
    return result


def training_time(run: Run) -> float:
    """Seconds in the paper's sense (see above); infinite if 90 % were not reached."""
    if run.iterative:
        return _or_never(run.record["time_to_target_train_s"])
    return float(run.record["training_s"])


def mcnemar(runs: Sequence[Run], reference: Sequence[Run]) -> float | None:
    """Exact McNemar test on the test samples of all seeds that both have; None without any."""
    theirs = {run.seeds: run.record for run in reference}
    pairs = [
        (_right(run.record), _right(theirs[run.seeds]))
        for run in runs
        if run.seeds in theirs
        and run.record["data_sha256"]["test"] == theirs[run.seeds]["data_sha256"]["test"]
    ]
    if not pairs:
        return None
    a, b = (np.concatenate(part) for part in zip(*pairs, strict=True))
    return evaluate.mcnemar(a, b)


@functools.cache
def published() -> dict[str, float]:
    """Numbers of the paper by experiment and quantity; fractions where it has percent.

    Raises:
        ValueError: naming the file, if it is not a table of them.
    """
    path = ROOT / "results" / "published.csv"
    try:
        with path.open(encoding="utf-8", newline="") as file:
            return {
                f"{line['experiment']}/{line['quantity']}": float(line["value"])
                / (100 if line["unit"] == "%" else 1)
                for line in csv.DictReader(file, strict=True)
                if line["value"]
            }
    except (KeyError, ValueError, csv.Error) as error:
        raise ValueError(
            f"{path}: expected experiment, quantity, value and unit in each row, found: {error!r}"
        ) from error


def published_row(model: str) -> Row:
    """The published line of Table I for a model, as far as there is one."""
    known = published()
    time = known.get(f"table1/{model}_training_time")
    accuracy = known.get(f"table1/{model}_test_accuracy")
    low, high = (None, None) if accuracy is None else wilson_of_published(accuracy)
    return {
        "published_training_time_s": time,
        "published_training_time_over_hdc": time and time / known["table1/hdc_training_time"],
        "published_train_accuracy": known.get(f"table1/{model}_training_accuracy"),
        "published_test_accuracy": accuracy,
        "published_test_ci_low": low,
        "published_test_ci_high": high,
    }


def wilson_of_published(accuracy: float) -> tuple[float, float]:
    """95 % interval of a published test accuracy, which is of 100 samples."""
    return evaluate.wilson(round(accuracy * PUBLISHED_TEST_SAMPLES), PUBLISHED_TEST_SAMPLES)


def _published(group: Group) -> Row:
    # The paper's table is about its touch experiment with all samples and all pixels.
    fits = group.scene == "touch" and group.n_train is None and group.pixels is None
    return published_row(group.model if fits else "")


def _right(record: Mapping[str, Any]) -> np.ndarray:
    return np.equal(record["predicted"], record["test_labels"])


def _or_never(seconds: float | None) -> float:
    return np.inf if seconds is None else float(seconds)


def _quartiles(times: Sequence[float]) -> list[float]:
    """Quartiles; one between a number and infinity is infinite."""
    ordered = np.sort(times)
    result = []
    for q in (0.25, 0.5, 0.75):
        place = q * (len(ordered) - 1)
        below, above = ordered[int(np.floor(place))], ordered[int(np.ceil(place))]
        never = np.isinf(above)
        result.append(np.inf if never else float(below + (place % 1) * (above - below)))
    return result


def _reached(seconds: float, longest: float) -> float | str:
    return seconds if np.isfinite(seconds) else f"not reached in {longest:.3g} s"


def _files(records: Sequence[Mapping[str, Any]]) -> dict[str, str]:
    """The code of a row's records, which agree (:class:`selection.Records` sees to it)."""
    return {k: v for record in records for k, v in record["environment"]["sources"].items()}


def _same(values: Any) -> Any:
    distinct = set(values)
    return distinct.pop() if len(distinct) == 1 else "mixed"
