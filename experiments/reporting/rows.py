"""The numbers of a row of runs, and the columns that tables of runs choose from.

- Times are medians with quartiles. The training time of a model that learns step by step is the
  paper's: until its training accuracy exceeded 90 %. A seed that never did counts as infinitely
  long, so a median or quartile may be "not reached in T s". A model that learns in one pass has the
  time until it is done (for HDC: until the prototypes are made).
- Accuracies are means over the seeds. ``test_accuracy_final`` is that of the last model; its
  interval is Student's over seeds. Maxima over a run and accuracies of training have none: the
  first are chosen among as many as the run made, the second are not of samples drawn anew.
- ``*_accuracy_at_target`` are read where the training accuracy first exceeded 90 %, ``*_max`` are
  the largest of the run.
- ``over_hdc`` is the mean over seeds of the difference in ``test_accuracy_final`` from ``hdc`` on
  the same test samples, with Student's interval.
"""

from __future__ import annotations

import math
import shlex
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np

from experiments.records import configs
from experiments.records.record import Finished
from experiments.records.results import Group, Results
from experiments.reporting import published
from experiments.reporting.estimates import Difference, difference, quartiles, share, training_time
from experiments.reporting.table import (
    Columns,
    bounded,
    cell,
    interval,
    number,
    percent,
    points,
    size,
)

Row = dict[str, Any]
STAR = "*"
EARLY = "stopped at 90 % in training, later accuracies may be higher"

# Columns of the CSV of a table of runs.
# fmt: off
VALUES = (
    "scene", "model", "n_train", "pixels", "seeds", "stop", "status",
    "training_time_s", "training_time_q25_s", "training_time_q75_s",
    "time_to_90_train_s", "time_to_90_test_s", "total_time_s", "training_time_over_hdc",
    "training_time_over_ordinary_hdc",
    "train_accuracy_at_target", "test_accuracy_at_target",
    "train_accuracy_max", "train_accuracy_final", "test_accuracy_max", "test_accuracy_final",
    "test_ci_low", "test_ci_high", "over_hdc", "over_hdc_low", "over_hdc_high",
    "seeds_above_hdc", "seeds_below_hdc", "model_bytes",
    "predict_single_s", "predict_batch_s_per_frame", "origin", "cpu", "threads", "code",
)
PUBLISHED = (
    "published_training_time_s", "published_training_time_over_hdc", "published_train_accuracy",
    "published_test_accuracy", "published_test_ci_low", "published_test_ci_high",
)
# fmt: on


def row(group: Group, hdc: Group) -> Row:
    """What the runs of a group say; None, or no key, where there is nothing.

    Args:
        group: runs of one row.
        hdc: runs of HDC on the same frames, that times and right samples are compared with.
    """
    result: Row = {
        "scene": group.scene,
        "model": group.model,
        "n_train": group.n_train,
        "pixels": group.pixels,
        "seeds": len(group.runs),
        "status": group.status,
    }
    if not group.runs:
        return result
    records = [run.record for run in group.runs]
    longest = max(record.training_s for record in records)
    q25, median, q75 = quartiles([training_time(run) for run in group.runs])
    reference = quartiles([training_time(run) for run in hdc.runs])[1] if hdc.runs else None
    accuracy = share(group)
    over = None if group.model == "hdc" else difference(group.runs, hdc.runs)

    def mean(values: Iterable[float | None]) -> float | None:
        known = [value for value in values if value is not None]
        return float(np.mean(known)) if known else None

    def reached(seconds: float) -> float | str:
        three_digits = float(f"{longest:.3g}")
        return seconds if math.isfinite(seconds) else f"not reached in {three_digits:.10g} s"

    def to_target(times: Iterable[float | None]) -> float | str:
        return reached(quartiles([math.inf if t is None else t for t in times])[1])

    return result | {
        "n_train": records[0].n_train,
        "pixels": group.pixels or math.prod(records[0].scene.shape),
        "stop": "; ".join(sorted({record.stop for record in records})),
        "training_time_s": reached(median),
        "training_time_q25_s": reached(q25),
        "training_time_q75_s": reached(q75),
        "time_to_90_train_s": to_target(record.time_to_target_train_s for record in records),
        "time_to_90_test_s": to_target(record.time_to_target_test_s for record in records),
        "total_time_s": float(np.median([record.training_s for record in records])),
        "training_time_over_hdc": median / reference
        if reference and math.isfinite(median)
        else None,
        "train_accuracy_at_target": mean(record.train_accuracy_at_target for record in records),
        "test_accuracy_at_target": mean(record.test_accuracy_at_target for record in records),
        "train_accuracy_max": mean(record.train_accuracy_max for record in records),
        "train_accuracy_final": mean(record.train_accuracy_final for record in records),
        "test_accuracy_max": mean(record.test_accuracy_max for record in records),
        "test_accuracy_final": accuracy.value,
        "test_ci_low": accuracy.low,
        "test_ci_high": accuracy.high,
        "n_test": len(group.right),
        **({} if over is None else _over_hdc(over)),
        "model_bytes": _same(record.model_bytes for record in records),
        "predict_single_s": float(np.median([r.predict_single_s for r in records])),
        "predict_batch_s_per_frame": float(
            np.median([r.predict_batch_s_per_frame for r in records])
        ),
        "origin": _same(record.scene.origin for record in records),
        "cpu": _same(record.environment.cpu for record in records),
        "threads": _same(record.environment.threads for record in records),
        "code": group.runs[0].record.environment.code[:12],
    }


def _over_hdc(over: Difference) -> Row:
    counts = {"seeds_above_hdc": over.above, "seeds_below_hdc": over.below}
    return over.share.columns("over_hdc") | counts


def swept(results: Results, experiments: Sequence[str]) -> list[Row]:
    """A row for each scene, model, N and D that the experiments sweep over, measured or not."""
    rows: dict[tuple[Any, ...], Row] = {}
    for experiment in experiments:
        params = configs.sweep(experiment)
        for scene in params["scene"]:
            for model in params["model"]:
                for n in configs.numbers(params.get("split.n_train", ["null"])):
                    for pixels in configs.numbers(params.get("data.pixels", ["null"])):
                        hdc = results.group(scene, "hdc", n, pixels)
                        key = (scene, model, n, pixels)
                        rows[key] = row(results.group(*key), hdc)
    return list(rows.values())


def published_row(model: str) -> Row:
    """The published line of Table I for a model, as far as there is one."""
    time = published.value(f"table1/{model}_training_time")
    accuracy = published.numbers().get(f"table1/{model}_test_accuracy")
    hdc = published.value("table1/hdc_training_time")

    def share_of(percents: float | None) -> float | None:
        return None if percents is None else percents / 100

    return {
        "published_training_time_s": time,
        "published_training_time_over_hdc": time and hdc and time / hdc,
        "published_train_accuracy": published.value(f"table1/{model}_training_accuracy"),
        "published_test_accuracy": accuracy and share_of(accuracy.value),
        "published_test_ci_low": accuracy and share_of(accuracy.low),
        "published_test_ci_high": accuracy and share_of(accuracy.high),
    }


def display_name(model: str) -> str:
    """What a model is called in tables and figures; what was changed of it stays in brackets."""
    name, changed, rest = model.partition(" (")
    return configs.display(name)["name"] + changed + rest


# What cells say -----------------------------------------------------------------------------------


def time_cell(line: Mapping[str, Any]) -> str:
    """Median training time with quartiles where there are several seeds."""
    if not line["seeds"]:
        return str(line["status"])
    text = number(line["training_time_s"])
    low, high = (
        number(line[f"training_time_q{q}_s"]).replace("not reached in ", "> ").removesuffix(" s")
        for q in (25, 75)
    )
    return text if low == high else f"{text} ({low}…{high})"


def accuracy_cell(line: Mapping[str, Any]) -> str:
    """Final test accuracy with its interval, and a star if a run was stopped before its best."""
    keys = ("test_accuracy_final", "test_ci_low", "test_ci_high")
    return interval(*(percent(line.get(key)) for key in keys)) + STAR * ("reached" in _stops(line))


def _stops(line: Mapping[str, Any]) -> list[str]:
    return (line.get("stop") or "").split("; ")


def _published_accuracy(line: Mapping[str, Any]) -> str:
    keys = ("published_test_accuracy", "published_test_ci_low", "published_test_ci_high")
    return interval(*(percent(line.get(key)) for key in keys))


def _ahead(line: Mapping[str, Any]) -> str:
    above, below = (line.get(f"seeds_{side}_hdc") for side in ("above", "below"))
    return "–" if above is None else f"{above}, {below}"


def _size(line: Mapping[str, Any]) -> str:
    value = line.get("model_bytes")
    return "–" if not line["seeds"] else value if isinstance(value, str) else size(value)


def _milliseconds(line: Mapping[str, Any]) -> str:
    seconds = line.get("predict_single_s")
    return number(None if seconds is None else 1e3 * seconds)


def _status(line: Mapping[str, Any]) -> str:
    return ", ".join(filter(None, [line["status"], line.get("stop")]))


COLUMNS: Columns = {
    "Model": lambda line: display_name(line["model"]),
    "Seeds": lambda line: str(line["seeds"]),
    "N": lambda line: str(line["n_train"] or "all"),
    "D": lambda line: str(line["pixels"] or "all"),
    "Training time, s, paper": cell("published_training_time_s", number),
    "Training time, s": time_cell,
    "Until it stopped, s": cell("total_time_s", number),
    "× HDC, paper": cell("published_training_time_over_hdc", number),
    "× HDC": cell("training_time_over_hdc", number),
    "× HDC by ordinary routes": cell("training_time_over_ordinary_hdc", number),
    "Training accuracy, %, paper": cell("published_train_accuracy", percent),
    "Training accuracy, %": cell("train_accuracy_max", percent),
    "Test accuracy, %, paper [95 %]": _published_accuracy,
    "Test accuracy, %, maximum": cell("test_accuracy_max", percent),
    "Test accuracy, %, final [95 %]": accuracy_cell,
    "− HDC, points [95 %]": partial(bounded, "over_hdc", show=points),
    "Seeds above, below HDC": _ahead,
    "Prediction, ms a frame": _milliseconds,
    "Size": _size,
    "Status": _status,
}
PAPER_HEADS = tuple(head for head in COLUMNS if "paper" in head)


def columns(*heads: str) -> Columns:
    """Some of :data:`COLUMNS`, in this order."""
    return {head: COLUMNS[head] for head in heads}


# What stands around them --------------------------------------------------------------------------


def frames_of(rows: Iterable[Mapping[str, Any]]) -> str:
    """What frames they are of: ``simulated frames``, ``recorded frames`` …"""
    origins = sorted({str(r["origin"]) for r in rows if r.get("origin")})
    computed = {"measured": "frames of measured matrices"}  # of a fibre; no camera took them
    return " and ".join(computed.get(one, f"{one} frames") for one in origins) or "no frames"


def caption(rows: Sequence[Mapping[str, Any]], what: str) -> str:
    """What a table shows, on which frames, on which machine."""
    scene = " and ".join(dict.fromkeys(f"“{line['scene']}”" for line in rows))
    machine = "; ".join(
        sorted({f"{line['cpu']}, {line['threads']} threads" for line in rows if line.get("cpu")})
    )
    if not any(line["seeds"] for line in rows):
        return f"{what}, on the scene {scene}: no runs."
    text = f"{what}, on {frames_of(rows)}, scene {scene}."
    return f"{text} Measured on {machine}." if machine else text


# What a column needs said, and why a run stopped: printed where there is such a one.
_NOTES = {
    "Training time, s": "Training time: of a model that reports a loss, until its training "
    "accuracy exceeded 90 %; of any other, until it is done (HDC: until the prototypes are made).",
    "Test accuracy, %, maximum": "Maxima are over a run and have no interval, nor have training "
    "accuracies; the final accuracy is the last model's.",
    "− HDC, points [95 %]": "− HDC: difference in accuracy on the same test samples, seed by seed; "
    "above zero, the model is better. Beside it, in how many seeds it is, and in how many worse.",
}
_STOPS = {
    "finished": "finished: learns in one pass, or found nothing left to do",
    "trained": "trained: until its loss had come down",
    "reached": f"reached ({STAR}): {EARLY}",
    "steps": "steps: its last step came before its loss had come down",
    "budget": "budget: its time was up before its loss had come down",
}


def notes(rows: Sequence[Mapping[str, Any]], shown: Columns) -> str:
    """How to read the numbers of a table with these columns."""
    stops = {stop for line in rows for stop in _stops(line)}
    said = [text for head, text in _NOTES.items() if head in shown]
    said.append(
        "Times are medians (quartiles), accuracies means over the seeds. Intervals: Student, 95 %, "
        "over seeds, none of which spreads less than its test samples make it (of one seed, and "
        "the paper's: Wilson)."
    )
    found = [text for stop, text in _STOPS.items() if stop in stops]
    if any("left out" in line["status"] for line in rows):
        found.append("left out: runs of the same by other code or another stopping rule")
    if found:
        said.append(f"Status: {'; '.join(found)}.")
    return " ".join(said)


def commands(groups: Iterable[Group]) -> list[str]:
    """What makes the runs of these groups again: a command for the models with the same seeds, on
    the same frames, of which the same was changed."""
    alike: dict[tuple[Any, ...], list[Group]] = {}
    for group in groups:
        seeds = {(run.record.choices.stop, run.record.seed) for run in group.runs}
        changed = {(_path(run.record), *run.overrides.items()) for run in group.runs}
        if seeds:
            key = *sorted(map(str, seeds)), *sorted(map(str, changed))
            alike.setdefault(key, []).append(group)
    return [_command(same) for same in alike.values()]


def _command(groups: Sequence[Group]) -> str:
    runs = [run for group in groups for run in group.runs]

    def values(get: Callable[[Any], Any]) -> list[Any]:
        return sorted({get(run.record) for run in runs}, key=lambda v: (v is None, v))

    words = ["python -m experiments.run -m"]
    for key, get in (
        ("scene", lambda r: r.choices.scene),
        ("scene.path", _path),
        ("model", lambda r: r.choices.model),
        ("stop", lambda r: r.choices.stop),
        ("seed.run", lambda r: r.seed),
        ("split.n_train", lambda r: r.config["split"]["n_train"]),
        ("data.pixels", lambda r: r.config["data"]["pixels"]),
    ):
        if (found := values(get)) != [None]:
            text = ",".join("null" if value is None else str(value) for value in found)
            words.append(shlex.quote(f"{key}={text}"))
    changed = {key: value for run in runs for key, value in run.overrides.items()}
    return " ".join([*words, *(shlex.quote(f"{key}={value}") for key, value in changed.items())])


def _path(record: Finished) -> str | None:
    """Where a recording lies, or lay."""
    return record.config["scene"].get("path")


def _same(values: Iterable[Any]) -> Any:
    distinct = set(values)
    return distinct.pop() if len(distinct) == 1 else "mixed"
