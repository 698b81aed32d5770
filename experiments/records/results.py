"""Everything in a results folder, loaded once, and its rows as tidy data frames."""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from experiments.records import configs, store
from experiments.records.record import Record
from experiments.records.rows import Row, unpack_labels

RUNS = "runs"  # the name of single trainings among those of experiments
CHECKPOINTS = "checkpoints"  # and of the reports that they made while they learned
OF_TRAININGS = (RUNS, CHECKPOINTS)
ROW = ["scene", "model", "asked_n", "asked_d"]
"""Columns that name a row of a table of runs: how many training samples and how many pixels were
asked for, 0 for all of them."""
# Of several configurations of one row, the stopping rule that stands first here; others come last.
STOPS = ("paper", "long", "end", "quick", "reached")
# Columns that tell the resamples of a measurement apart: the true classes are stored once in each.
_RESAMPLE = ("seed", "split", "draw")


class Results:
    """A results folder: its finished `runs`, which are trainings, those that are `unfinished`, the
    `measurements` of all other experiments, the one made last first, and `problems` of files.

    Attributes:
        displays: how models and scenes are shown that have no file in ``configs/``, by group and
            name, for :func:`experiments.records.configs.shown_as`.
    """

    def __init__(self, folder: Path):
        self.problems: list[str] = []
        self.runs: list[Record] = []
        self.unfinished: list[Record] = []
        self.measurements: list[Record] = []
        self.displays: dict[tuple[str, str], Mapping[str, Any]] = {}
        self._frames: dict[tuple[str, ...], pd.DataFrame] = {}
        for record in store.read(folder):
            if isinstance(record, ValueError):
                self.problems.append(str(record))
                continue
            self._show(record)
            if record.is_training:
                (self.runs if record.is_finished else self.unfinished).append(record)
            elif record.is_finished:
                self.measurements.insert(0, record)

    def __bool__(self) -> bool:
        return bool(self.runs or self.unfinished or self.measurements)

    @property
    def finished(self) -> list[Record]:
        """Every finished record."""
        return [*self.runs, *self.measurements]

    def frame(self, *experiments: str) -> pd.DataFrame:
        """A line per row of the records of some experiments; every cell is a scalar.

        A line has the columns of its row. Where a row has lists of equal length, it becomes a line
        per place in them, with the column ``place``. From its record a line has ``experiment``,
        ``scene``, ``record``, ``command``, ``device``, ``cpu``, ``threads`` and every setting of
        the config by its dotted key, lists as JSON. ``right`` counts the right answers of a line
        with ``predicted``; ``labels``, the true classes, stand in each.

        :data:`RUNS` stands for single trainings, a line each, with their results; a row
        (:data:`ROW`) has one of its configurations (:func:`_counting`). :data:`CHECKPOINTS` are the
        reports of these trainings, a line each. An experiment has one measurement of each scene
        (:meth:`chosen`). Scenes are in their order.
        """
        if experiments not in self._frames:
            parts = [self._part(name) for name in experiments]
            self._frames[experiments] = _joined([part for part in parts if len(part)])
        return self._frames[experiments]

    def trainings(self) -> pd.DataFrame:
        """Every finished training, a line each with its settings and results."""
        lines = pd.DataFrame(map(_of_finished, self.runs))
        return lines.drop(columns="alike", errors="ignore")

    def chosen(self, experiment: str) -> tuple[list[Record], list[Record]]:
        """The measurements of an experiment that count, and those that are left out.

        The last one of each scene counts; of one that is to be made several times, the last
        of each ``measurement`` that the config counts.
        """
        counting: dict[tuple[str, int], Record] = {}
        left_out = []
        for measured in self.measurements:
            if measured.experiment == experiment:
                name = _label(measured), measured.config.get("measurement", 1)
                if counting.setdefault(name, measured) is not measured:
                    left_out.append(measured)
        ordered = sorted(counting, key=lambda name: self._order(name[0]))
        return [counting[name] for name in ordered], left_out

    def left_out(self) -> Iterator[str]:
        """A line for each measurement that a later one of its scene stands for."""
        for name in dict.fromkeys(
            measured.experiment for measured in self.measurements
        ):
            for measured in self.chosen(name)[1]:
                yield f"{measured.id}: a later measurement of {name} takes its place"

    def _order(self, scene: str) -> tuple[float, str]:
        with configs.shown_as(self.displays):
            return configs.scene_display(scene)["order"], scene

    def _part(self, name: str) -> pd.DataFrame:
        if name == RUNS:
            return _counting(pd.DataFrame(map(_of_finished, self.runs)))
        if name == CHECKPOINTS:
            return self._checkpoints()
        parts = [_of_measurement(measured) for measured in self.chosen(name)[0]]
        return pd.concat(parts, ignore_index=True) if parts else pd.DataFrame()

    def _checkpoints(self) -> pd.DataFrame:
        """The reports of the runs that count, with what names their run."""
        runs = self.frame(RUNS)
        if not len(runs):
            return runs
        lines = [
            {"record": run.id, "place": place, **report}
            for run in self.runs
            for place, report in enumerate(run.curve)
        ]
        named = runs[["record", *ROW, "seeds", "seed", "iterative"]]
        every = named.merge(pd.DataFrame(lines), on="record")
        return every.assign(experiment=CHECKPOINTS)

    def _show(self, record: Record) -> None:
        for group, named in (("model", record.model), ("scene", record.scene)):
            if named and named.display and not configs.is_known(group, named.name):
                self.displays[group, named.name] = named.display


def _label(record: Record) -> str:
    return record.scene.label if record.scene else ""


def of_experiment(frame: pd.DataFrame, experiment: str) -> pd.DataFrame:
    """The lines of one experiment."""
    if not len(frame):
        return frame
    return frame[frame.experiment == experiment].infer_objects().copy()


def own_frames(frame: pd.DataFrame) -> pd.DataFrame:
    """The lines on the scene of their experiment's own config, unchanged; of single trainings,
    and of experiments that are not in ``configs/``, all."""
    if not len(frame):
        return frame
    own = frame.experiment.map(configs.scene_of)
    return frame[(own == "") | (frame.scene == own)]


def by_scene(lines: pd.DataFrame) -> dict[str, pd.DataFrame]:
    """The lines of each scene, in their order."""
    if not len(lines):
        return {}
    return {str(scene): of for scene, of in lines.groupby("scene", sort=False)}


def _joined(parts: list[pd.DataFrame]) -> pd.DataFrame:
    """The parts one below the other; integers stay integers where others lack their column."""
    if len(parts) > 1:
        parts = [part.astype(object) for part in parts]
    return pd.concat(parts, ignore_index=True) if parts else pd.DataFrame()


# Lines --------------------------------------------------------------------------------------------


def _settings(config: Mapping[str, Any]) -> Row:
    """The values of a config by their dotted keys; a list as JSON."""
    found = configs.flat(config).items()
    return {name: _scalar(value) for name, value in found}


def _of_record(record: Record) -> Row:
    """The names of a record, its settings and its machine."""
    environment = record.environment
    return {
        **_settings(record.config),
        "experiment": RUNS if record.is_training else record.experiment,
        "scene": _label(record),
        "record": record.id,
        "command": record.command,
        "device": environment.device,
        "cpu": environment.machine,
        "threads": environment.threads,
    }


def _of_finished(run: Record) -> Row:
    """The line of a finished training, with what tells it from others of its row; one that never
    got to its target took infinitely long."""
    config, results = run.config, run.results
    same = configs.without((*configs.SEEDS, "device"), config)
    if not results["iterative"]:  # it ends by itself, whatever the rule
        same.pop("stop")
    for key in configs.COORDINATES:
        group, name = key.split(".")
        same[group].pop(name, None)
    seconds = results["training_time_s"]
    return {
        **_of_record(run),
        "model": run.model.label if run.model else "",
        "asked_n": config["split"]["n_train"] or 0,
        "asked_d": config["data"]["pixels"] or 0,
        "exclusive": run.environment.exclusive,
        "code": run.environment.short_commit,
        "seed": config["seed"]["run"],
        "seeds": json.dumps(config["seed"], sort_keys=True),
        "stop_rule": run.stop,
        **results,
        "alike": json.dumps([same, run.revisions], sort_keys=True),
        "training_time_s": math.inf if seconds is None else seconds,
    }


def _counting(lines: pd.DataFrame) -> pd.DataFrame:
    """The runs of each row that count, with ``others``, the number that is left out.

    The runs of a row have one configuration and code of one revision. Where there are several
    configurations, runs that were timed alone come first, then the stopping rule that is first in
    :data:`STOPS`, then the newest. Runs with the same seeds are chosen in the same way.
    """
    if not len(lines):
        return lines
    order = {name: number for number, name in enumerate(STOPS)}
    ordered = lines.assign(
        by_rule=lines.stop_rule.map(order).fillna(len(order)),
        age=-np.arange(len(lines)),
    ).sort_values(["exclusive", "by_rule", "age"], ascending=[False, True, True])
    first = ordered.groupby(ROW).alike.transform("first")
    ordered["counts"] = ordered.alike == first
    by_row = ordered.groupby(ROW).counts
    ordered["others"] = by_row.transform("size") - by_row.transform("sum")
    chosen = ordered[ordered.counts].drop_duplicates([*ROW, "seeds"])
    chosen = chosen.sort_values([*ROW, "seed"])
    helpers = ["alike", "by_rule", "age", "counts"]
    return chosen.drop(columns=helpers).reset_index(drop=True)


def _of_measurement(measured: Record) -> pd.DataFrame:
    """The lines of one measurement; a column of a row keeps its name before that of a record."""
    of_record = _of_record(measured)
    lines = pd.DataFrame(_answered(_lines(measured.rows.dicts())))
    named = [name for name in of_record if name not in lines]
    about = pd.DataFrame([of_record] * len(lines), columns=named)
    return pd.concat([lines, about], axis="columns")


def _lines(rows: Iterable[Row]) -> Iterator[Row]:
    """A line per row, or per place in its lists; lists of unequal lengths become JSON."""
    for row in rows:
        lists = {name: of for name, of in row.items() if isinstance(of, list)}
        if len({len(of) for of in lists.values()}) > 1:
            yield row | {name: json.dumps(of) for name, of in lists.items()}
        elif not lists:
            yield row
        else:
            for place, values in enumerate(zip(*lists.values(), strict=True)):
                at_place = zip(lists, map(_scalar, values), strict=True)
                yield row | dict(at_place) | {"place": place}


def _scalar(value: Any) -> Any:
    """A value of a list; one that is a list or a mapping itself as JSON."""
    return json.dumps(value) if isinstance(value, list | tuple | dict) else value


def _answered(lines: Iterable[Row]) -> Iterator[Row]:
    """Lines with ``predicted`` get the true classes of their resample, and how many are right."""
    truths: dict[tuple[Any, ...], str] = {}
    for line in lines:
        resample = tuple(line.get(name) for name in _RESAMPLE)
        if line.get("labels") is not None:
            truths[resample] = line["labels"]
        if line.get("predicted") is None:
            yield line
            continue
        labels = truths[resample]
        right = unpack_labels(line["predicted"]) == unpack_labels(labels)
        yield line | {"labels": labels, "right": int(right.sum())}
