"""Rows of tables of runs: values by column, and what stands around such a table."""

from __future__ import annotations

import shlex
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

from experiments.records import configs
from experiments.records.record import Finished
from experiments.records.results import Group, Results
from experiments.reporting.columns import COLUMNS, display_name
from experiments.reporting.estimates import Estimate
from experiments.reporting.text import frames_of

Row = dict[str, Any]

__all__ = ["Row", "caption", "commands", "display_name", "frames_of", "row", "stop_note", "swept"]


def row(group: Group, hdc: Group, paper: bool = False) -> Row:
    """Values of every column of :data:`COLUMNS` that follows from runs; a group without runs has
    its scene, model, place in the sweep and status.

    Args:
        group: runs of one row.
        hdc: runs of HDC on the same frames, with which times and right samples are compared.
        paper: whether the numbers of the paper's Table I are wanted, too.
    """
    if not group.runs:
        place = {"scene": group.scene, "model": group.model, "n_train": group.n_train}
        values: Row = {**place, "pixels": group.pixels, "seeds": 0, "status": group.status}
        return values | (_of_columns(group, hdc, "published_") if paper else {})
    values = {key: v for key, v in _of_columns(group, hdc).items() if not key.startswith("publ")}
    return values | (_of_columns(group, hdc, "published_") if paper else {})


def _of_columns(group: Group, hdc: Group, start: str = "") -> Row:
    values: Row = {}
    for name, column in COLUMNS.items():
        if column.of is None or not name.startswith(start):
            continue
        value = column.of(group, hdc)
        values |= value.columns(name) if isinstance(value, Estimate) else {name: value}
    return values


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


def caption(rows: Sequence[Mapping[str, Any]], what: str) -> str:
    """What a table shows, on which frames, on which machine."""
    scene = " and ".join(dict.fromkeys(f"“{line['scene']}”" for line in rows))
    machine = "; ".join(
        sorted({f"{line['cpu']}, {line['threads']} threads" for line in rows if line.get("cpu")})
    )
    if not any(line["seeds"] for line in rows):
        return f"{what}, scene {scene}: no runs."
    text = f"{what}, {frames_of(rows)}, scene {scene}."
    return f"{text} {machine}." if machine else text


STOPS = {
    "finished": "finished: a one-pass model, or converged",
    "trained": "trained: the loss converged",
    "reached": "reached: stopped when training accuracy passed 90 %",
    "steps": "steps: the limit of steps came before the loss converged",
    "budget": "budget: the limit of time came before the loss converged",
}


def stop_note(rows: Iterable[Mapping[str, Any]]) -> str:
    """Why runs of these rows stopped, where one did not simply finish."""
    stops = {stop for line in rows for stop in (line.get("stop") or "").split("; ")}
    return "; ".join(text for stop, text in STOPS.items() if stop in stops - {"finished"})


def commands(groups: Iterable[Group]) -> list[str]:
    """Commands that make the runs of these groups again: one for all models with the same seeds,
    on the same frames, with the same overrides."""
    alike: dict[tuple[Any, ...], list[Group]] = {}
    for group in groups:
        if group.runs:
            seeds = {(run.record.choices.stop, run.record.seed) for run in group.runs}
            changed = {(_path(run.record), *run.overrides.items()) for run in group.runs}
            key = *sorted(map(str, seeds)), *sorted(map(str, changed))
            alike.setdefault(key, []).append(group)
    return [_command(groups_alike) for groups_alike in alike.values()]


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
        if (distinct := values(get)) != [None]:
            text = ",".join("null" if value is None else str(value) for value in distinct)
            words.append(shlex.quote(f"{key}={text}"))
    changed = {key: value for run in runs for key, value in run.overrides.items()}
    return " ".join([*words, *(shlex.quote(f"{key}={value}") for key, value in changed.items())])


def _path(record: Finished) -> str | None:
    """Where a recording lies, or lay."""
    return record.config["scene"].get("path")
