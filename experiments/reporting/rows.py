"""Rows of tables of runs: values by column, and what stands around such a table."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from experiments.records import configs
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
    values: Row = {}
    if not group.runs:
        values = {"scene": group.scene, "model": group.model, "n_train": group.n_train}
        values |= {"pixels": group.pixels, "seeds": 0, "status": group.status}
    for name, column in COLUMNS.items():
        if column.of is not None and (paper if name.startswith("published_") else group.runs):
            value = column.of(group, hdc)
            values |= value.columns(name) if isinstance(value, Estimate) else {name: value}
    return values


def swept(results: Results, experiments: Sequence[str]) -> list[Row]:
    """A row for each scene, model, N and D that the experiments sweep over, measured or not."""
    rows: dict[tuple[Any, ...], Row] = {}
    for experiment in experiments:
        params = configs.sweep(experiment)
        sizes = (configs.numbers(params.get(k, ["null"])) for k in ("split.n_train", "data.pixels"))
        every: Iterable[Any] = itertools.product(params["scene"], params["model"], *sizes)
        for scene, model, *place in every:
            hdc = results.group(scene, "hdc", *place)
            rows[scene, model, *place] = row(results.group(scene, model, *place), hdc)
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
    """Commands that made the runs of these groups."""
    return list(dict.fromkeys(run.record.command for group in groups for run in group.runs))
