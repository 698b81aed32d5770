"""Everything in a results folder, loaded once, and which of its runs may stand in one row.

Two rules decide what is averaged: the runs have the same configuration but for their seeds, and the
same revisions of the code made them. The rest of a row's choice is a preference among such groups.
"""

from __future__ import annotations

import json
from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from experiments.records import configs, measurement
from experiments.records import record as records
from experiments.records.measurement import Measured
from experiments.records.record import Curve, Finished, Record

# Of several groups for one row, the stopping rule that stands first here; others come last.
STOPS = ("paper", "long", "end", "few", "quick", "reached")
# What a row asks for by number; and where a recording lies, which is known by its content.
_COORDINATES = ("split.n_train", "data.pixels", "scene.path")
# Of what was changed.
_FRAMES_FIRST = {"scene": 0, "split": 1, "model": 2, "stop": 3}
_OF_MODEL = ("model.", "stop.")  # keys of what was changed of a model, not of a scene

RUNS = "runs"  # the name of single trainings among those of experiments
META = (
    *("experiment", "scene", "record", "command", "config", "elsewhere"),
    *("device", "cpu", "threads", "of_row"),
)
"""Columns of :meth:`Results.frame` that a line has of its record. ``elsewhere``: whether it was
measured on other frames than those of the experiment's config; ``of_row``: names of the columns
that are its row's own."""
METRICS = (
    *("stop", "training_s", "time_to_target_train_s", "time_to_target_test_s"),
    *("train_accuracy_at_target", "test_accuracy_at_target"),
    *("train_accuracy_max", "train_accuracy_final", "test_accuracy_max"),
    *("test_accuracy_final", "model_bytes", "predict_single_s"),
    "predict_batch_s_per_frame",
)
"""Columns of a run, as :class:`Finished` has them."""

Row = tuple[str, str, int | None, int | None]
"""Scene, model, number of training samples, number of pixels; None for all of them."""


@dataclass(frozen=True)
class Run:
    """A finished run.

    Attributes:
        record: its line of runs.jsonl.
        curve: one dict a report of the model.
    """

    record: Finished
    curve: Curve

    @cached_property
    def overrides(self) -> dict[str, str]:
        """Values of its scene, split, model and stop that differ from ``configs/``, by key. What
        learns in one pass has no stopping rule."""
        found = {}
        changed = self.record.changed
        for key in sorted(changed, key=_place_of_key):
            of_stop = key.startswith("stop.") and not self.iterative
            if key not in _COORDINATES and not of_stop:
                found[key] = changed[key]
        return found

    @property
    def seeds(self) -> str:
        """Its seeds, as text: runs of several models with equal ones saw the same samples."""
        return json.dumps(self.record.config["seed"], sort_keys=True)

    @property
    def iterative(self) -> bool:
        """Whether the model learns by steps that report a loss, or in one pass."""
        return any("loss" in row for row in self.curve)

    @cached_property
    def outdated(self) -> list[str]:
        """What has another revision today."""
        return self.record.outdated

    @property
    def place(self) -> tuple[Any, ...]:
        """What it measured, whatever its config says today: its row, its seeds and its rule."""
        config, stop = self.record.config, self.record.choices.stop
        sizes = config["split"]["n_train"], config["data"]["pixels"]
        threads = config.get("threads")
        return self.scene, self.model, *sizes, self.seeds, stop, threads

    @property
    def made_by(self) -> str:
        """Revisions of its code, as text."""
        return json.dumps(self.record.revisions, sort_keys=True)

    @cached_property
    def scene(self) -> str:
        """Name of the scene's config, for a recording with its fingerprint, and its overrides."""
        overrides = self.overrides.items()
        changed = {key: v for key, v in overrides if not key.startswith(_OF_MODEL)}
        name = self.record.scene.name
        if self.record.scene.origin == "recorded":
            recorded = self.record.config["scene"]
            path = Path(str(recorded.get("path", "")))
            name += f" {path.name} ({self.record.data[:6]})"
        return _labelled(name, changed)

    @cached_property
    def model(self) -> str:
        """Name of the model's config, and its overrides and those of the stopping rule."""
        overrides = self.overrides.items()
        changed = {k: v for k, v in overrides if k.startswith(_OF_MODEL)}
        return _labelled(self.record.choices.model, changed)

    @cached_property
    def configuration(self) -> str:
        """All of the config that runs of one row have in common, as text."""
        config = _core(self.record.config)
        if not self.iterative:  # it ends by itself, whatever the rule
            config.pop("stop")
        for name in _COORDINATES:
            group, key = name.split(".")
            config[group].pop(key, None)
        return json.dumps(config, sort_keys=True)


@dataclass(frozen=True)
class Group:
    """The runs behind one row.

    Attributes:
        scene, model: as :class:`Run` names them.
        n_train, pixels: training samples and pixels seen; None for all.
        runs: one for each set of seeds, in their order.
        others: number of runs left out because their code, stopping rule or threads differ.
    """

    scene: str
    model: str
    n_train: int | None = None
    pixels: int | None = None
    runs: list[Run] = field(default_factory=list)
    others: int = 0

    @property
    def status(self) -> str:
        """``ok``, ``missing``, or what a reader has to know."""
        if not self.runs:
            return "missing"
        notes = []
        if self.others:
            notes.append(f"{self.others} more left out: of other code or settings")
        alone = [run.record.environment.exclusive for run in self.runs]
        beside = sum(not exclusive for exclusive in alone)
        if beside:
            notes.append(f"{beside} timed beside other runs")
        return "; ".join(notes) or "ok"

    @property
    def right(self) -> np.ndarray:
        """Which test samples are right, of all runs one after another, bool [Q]."""
        return np.concatenate([run.record.right for run in self.runs])

    @property
    def machines(self) -> set[tuple[str, int]]:
        """(processor, threads): times of different ones do not compare."""
        environments = [run.record.environment for run in self.runs]
        return {(machine.cpu, machine.threads) for machine in environments}

    @property
    def classes(self) -> list[str]:
        """Class names, by label."""
        return self.runs[0].record.scene.classes

    def confusion(self) -> np.ndarray:
        """Test samples of all runs by true (row) and predicted class, int64 [L, L]."""
        n_classes = len(self.classes)
        total = np.zeros((n_classes, n_classes), np.int64)
        for run in self.runs:
            places = (run.record.test_labels, run.record.predicted)
            np.add.at(total, places, 1)
        return total


class Groups:
    """Runs by the rows that they may stand in.

    Args:
        runs: finished ones.
    """

    def __init__(self, runs: Iterable[Run]):
        self.runs = list(runs)
        rows = defaultdict[Row, list[Run]](list)
        for run in self.runs:
            config = run.record.config
            sizes = config["split"]["n_train"], config["data"]["pixels"]
            rows[run.scene, run.model, *sizes].append(run)
        ordered = sorted(rows, key=_whole_first)
        self._groups = {row: _group(row, rows[row]) for row in ordered}

    @classmethod
    def of(cls, frame: pd.DataFrame) -> Groups:
        """Those of the runs among the lines of :meth:`Results.frame`."""
        if "run" not in frame:
            return cls([])
        return cls(frame.run.dropna())

    def __bool__(self) -> bool:
        return bool(self.runs)

    def __iter__(self) -> Iterator[Group]:
        """Every row there is, by scene, model, number of samples and pixels."""
        return iter(self._groups.values())

    def group(
        self,
        scene: str,
        model: str,
        n_train: int | None = None,
        pixels: int | None = None,
    ) -> Group:
        """The runs of one row, named as in :class:`Group`; none where there are none."""
        row = scene, model, n_train, pixels
        return self._groups.get(row, Group(*row))

    def models(self, scene: str) -> set[str]:
        """Models that were run on a scene with all of its training samples and pixels."""
        return {
            model
            for place, model, *sizes in self._groups
            if (place, *sizes) == (scene, None, None)
        }

    def extra_models(self, scene: str) -> list[str]:
        """Models on a scene that no experiment of ``configs/`` sweeps over: one's own, and those
        of which something was changed."""
        found = {run.model for run in self.runs if run.scene == scene}
        return sorted(found.difference(configs.swept_models()))


class Results:
    """A results folder: its finished `runs`, records of the `unfinished`, `problems` of files."""

    def __init__(self, folder: Path):
        self.folder = folder
        self.problems: list[str] = []
        self.runs: list[Run] = []
        self.unfinished: list[Record] = []
        for entry in records.read(folder):
            if isinstance(entry, ValueError):
                self.problems.append(str(entry))
            else:
                self._take(entry)

    def __bool__(self) -> bool:
        return bool(self.runs or self.unfinished or self.measurements)

    def frame(self, *experiments: str) -> pd.DataFrame:
        """The rows of records as one table, a line a row; without lines where there are none.

        A line has the columns of its row, and those of its record: :data:`META`. ``runs`` stands
        for the single trainings: a line a run, with its metrics. There is one measurement of an
        experiment and scene, the one whose config was changed least; scenes are in the order of
        their places.
        """
        if experiments not in self._frames:
            parts = []
            for name in experiments:
                if name == RUNS:
                    parts += [_frame_of_runs(self.runs)] if self.runs else []
                else:
                    parts += [_frame_of(one) for one in self._by_scene(name)]
            self._frames[experiments] = _joined(parts, several=len(experiments) > 1)
        return self._frames[experiments]

    def _by_scene(self, name: str) -> list[Measured]:
        found: dict[str, Measured] = {}
        for measured in self.measurements:  # those changed least come first
            if measured.record.name == name:
                found.setdefault(measured.record.scene, measured)
        places = {scene: configs.scene_display(scene)["place"] for scene in found}
        ordered = sorted(found, key=lambda scene: (places[scene], scene))
        return [found[scene] for scene in ordered]

    @cached_property
    def _frames(self) -> dict[tuple[str, ...], pd.DataFrame]:
        return {}

    @cached_property
    def _rows(self) -> Groups:
        return Groups(self.runs)

    def group(
        self,
        scene: str,
        model: str,
        n_train: int | None = None,
        pixels: int | None = None,
    ) -> Group:
        """The runs of one row, as :meth:`Groups.group`."""
        return self._rows.group(scene, model, n_train, pixels)

    @cached_property
    def measurements(self) -> list[Measured]:
        """Every finished measurement, those on the frames of its experiment's config first."""
        finished = []
        paths = (self.folder / "measured").glob("*/record.json")
        for path in sorted(paths):
            try:
                measured = measurement.read(path.parent)
            except ValueError as error:
                self.problems.append(str(error))
                continue
            if measured is not None and measured.record.status == "finished":
                finished.append(measured)
        return sorted(finished, key=lambda m: (m.of_other_frames, len(m.overrides)))

    def measured(self, name: str) -> Measured | None:
        """The measurement of an experiment on its own scene, whole before quick; None if there is
        none."""
        for measured in self.measurements:
            if measured.record.name == name and not measured.of_other_frames:
                return measured
        return None

    def _take(self, entry: Record) -> None:
        scene, model = entry.choices.scene, entry.choices.model
        if entry.display and not configs.is_known("model", model):
            configs.show_as("model", model, entry.display)
        if entry.scene_display and not configs.is_known("scene", scene):
            configs.show_as("scene", scene, entry.scene_display)
        if isinstance(entry, Finished):
            run = Run(entry, records.curve_of(entry))
            self.runs.append(run)
        else:
            self.unfinished.append(entry)


def own_columns(frame: pd.DataFrame) -> pd.DataFrame:
    """The lines of one experiment with the columns of its rows alone."""
    return frame[list(frame.of_row.iloc[0])]


def _joined(parts: list[pd.DataFrame], several: bool) -> pd.DataFrame:
    """The parts one below the other. Of several experiments, which have other columns, integers
    stay integers where a column is missing elsewhere."""
    if not parts:
        return pd.DataFrame()
    if several:
        parts = [part.astype(object) for part in parts]
    return pd.concat(parts, ignore_index=True)


def of_scenes(frame: pd.DataFrame, experiment: str) -> dict[str, pd.DataFrame]:
    """The lines of one experiment by scene, in the order of the frame, with the columns of its rows
    and of records alone."""
    found = {}
    if len(frame):
        lines = frame[frame.experiment == experiment]
        for scene, rows in lines.groupby("scene", sort=False):
            names = dict.fromkeys([*rows.of_row.iloc[0], *META])
            found[str(scene)] = rows[list(names)].infer_objects()
    return found


def _frame_of(measured: Measured) -> pd.DataFrame:
    """A line a row of a measurement; a column of the row keeps its name before that of a record."""
    environment = measured.record.environment
    frame = measured.frame.copy()
    of_record = {
        "experiment": measured.record.name,
        "scene": measured.record.scene,
        "record": measured.folder.name,
        "command": measured.record.command,
        "config": measured.record.config,
        "elsewhere": measured.of_other_frames,
        "device": environment.device,
        "cpu": environment.cpu,
        "threads": environment.threads,
        "of_row": tuple(frame.columns),
    }
    for name, value in of_record.items():
        if name not in frame:
            frame[name] = [value] * len(frame)
    return frame


def _frame_of_runs(runs: Iterable[Run]) -> pd.DataFrame:
    """A line a run: its place, its metrics and the run itself, with its curve."""
    lines = []
    for run in runs:
        record, environment = run.record, run.record.environment
        line: dict[str, Any] = {
            "experiment": RUNS,
            "scene": run.scene,
            "model": run.model,
            "n_train": record.config["split"]["n_train"],
            "pixels": record.config["data"]["pixels"],
            "seed": record.seed,
            "origin": record.scene.origin,
            "record": record.id,
            "command": record.command,
            "config": record.config,
            "elsewhere": False,
            "device": environment.device,
            "cpu": environment.cpu,
            "threads": environment.threads,
            "run": run,
        }
        line |= {name: getattr(record, name) for name in METRICS}
        lines.append(line)
    return pd.DataFrame(lines)


def _whole_first(row: Row) -> list[tuple[bool, Any]]:
    """By this key a row is sorted: all samples and all pixels, None, come before fewer."""
    return [(part is not None, part) for part in row]


def _place_of_key(key: str) -> int:
    group, _, _ = key.partition(".")
    return _FRAMES_FIRST.get(group, 4)


def _group(row: Row, runs: list[Run]) -> Group:
    """Of the runs of a row that are alike, those of today's code, then those timed alone, then by
    stopping rule, then the most."""
    alike = defaultdict[tuple[str, str], list[Run]](list)
    for run in runs:
        alike[run.configuration, run.made_by].append(run)
    best = min(alike.values(), key=_preference)
    by_seeds = {}
    for run in best:
        seeds = list(_seeds(run.record.config))
        by_seeds[json.dumps(seeds)] = run
    ordered = sorted(by_seeds.values(), key=lambda run: run.record.seed)
    left_out = len(runs) - len(best)
    return Group(*row, ordered, left_out)


def _preference(runs: list[Run]) -> tuple[Any, ...]:
    first = runs[0].record
    stop = first.choices.stop
    rank = STOPS.index(stop) if stop in STOPS else len(STOPS)
    beside = not first.environment.exclusive
    return bool(runs[0].outdated), beside, rank, -len(runs), runs[0].made_by


def _core(config: Any) -> Any:
    """A config without what differs from seed to seed, or from device to device."""
    return configs.without((*configs.SEEDS, "device"), config)


def _seeds(config: Any) -> Iterator[Any]:
    """Every seed in a config, in the order of its keys."""
    if isinstance(config, Mapping):
        for key in sorted(config):
            if key in configs.SEEDS:
                yield config[key]
            else:
                yield from _seeds(config[key])
    elif isinstance(config, list | tuple):
        for part in config:
            yield from _seeds(part)


def _labelled(name: str, changed: Mapping[str, str]) -> str:
    """A name, and in brackets what was changed."""
    text = ", ".join(
        f"{key.partition('.')[2]}={value}" for key, value in changed.items()
    )
    if text:
        return f"{name} ({text})"
    return name
