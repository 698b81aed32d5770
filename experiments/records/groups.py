"""Which runs may stand in one row of a table.

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

from experiments.records import configs
from experiments.records.record import Curve, Finished

# Of several groups for one row, the stopping rule that stands first here; others come last.
STOPS = ("paper", "long", "end", "few", "quick", "reached")
# What a row asks for by number; and where a recording lies, which is known by its content.
_COORDINATES = ("split.n_train", "data.pixels", "scene.path")
# Of what was changed.
_FRAMES_FIRST = {"scene": 0, "split": 1, "model": 2, "stop": 3}
_OF_MODEL = ("model.", "stop.")  # keys of what was changed of a model, not of a scene

Row = tuple[str, str, int | None, int | None]
"""Scene, model, number of training samples, number of pixels; None for all of them."""


@dataclass(frozen=True)
class Run:
    """A finished run.

    Attributes:
        record: its record.
    """

    record: Finished

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
    def curve(self) -> Curve:
        """A row a report of the model."""
        return self.record.curve

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
