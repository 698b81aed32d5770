"""Which runs may stand in one row of a table.

Two rules decide what is averaged: the runs have the same configuration but for their seeds, and the
same revisions of the code made them. The rest of a row's choice is a preference among such groups.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pandas as pd

from experiments.records import configs
from experiments.records.results import once
from experiments.records.run import COORDINATES, Finished

# Of several groups for one row, the stopping rule that stands first here; others come last.
STOPS = ("paper", "long", "end", "quick", "reached")
_Key = tuple[str, str, int | None, int | None]
"""Scene, model, number of training samples, number of pixels; None for all of them."""


@dataclass(frozen=True)
class Group:
    """The runs behind one row.

    Attributes:
        scene, model: labels of its runs.
        n_train, pixels: training samples and pixels seen; None for all.
        runs: one for each set of seeds, in their order.
        others: number of runs left out because their code, stopping rule or threads differ.
    """

    scene: str
    model: str
    n_train: int | None = None
    pixels: int | None = None
    runs: list[Finished] = field(default_factory=list)
    others: int = 0

    @property
    def status(self) -> str:
        """``ok``, ``missing``, or what a reader has to know."""
        if not self.runs:
            return "missing"
        notes = []
        if self.others:
            notes.append(f"{self.others} more left out: of other code or settings")
        alone = [run.environment.exclusive for run in self.runs]
        beside = sum(not exclusive for exclusive in alone)
        if beside:
            notes.append(f"{beside} timed beside other runs")
        return "; ".join(notes) or "ok"

    @property
    def right(self) -> np.ndarray:
        """Which test samples are right, of all runs one after another, bool [Q]."""
        return np.concatenate([run.right for run in self.runs])

    @property
    def commands(self) -> list[str]:
        """Commands that made the runs, each once."""
        return list(dict.fromkeys(run.command for run in self.runs))

    @property
    def machines(self) -> set[tuple[str, int]]:
        """(processor, threads): times of different ones do not compare."""
        environments = [run.environment for run in self.runs]
        return {(machine.cpu, machine.threads) for machine in environments}

    @property
    def classes(self) -> list[str]:
        """Class names, by label."""
        return self.runs[0].scene.classes

    def confusion(self) -> np.ndarray:
        """Test samples of all runs by true (row) and predicted class, int64 [L, L]."""
        n_classes = len(self.classes)
        total = np.zeros((n_classes, n_classes), np.int64)
        for run in self.runs:
            pairs = run.test_labels, run.predicted
            np.add.at(total, pairs, 1)
        return total


class Groups:
    """Runs by the rows that they may stand in.

    Args:
        runs: finished ones.
    """

    def __init__(self, runs: Iterable[Finished]):
        self.runs = list(runs)
        rows = defaultdict[_Key, list[Finished]](list)
        for run in self.runs:
            config = run.config
            sizes = config["split"]["n_train"], config["data"]["pixels"]
            rows[run.scene_label, run.model_label, *sizes].append(run)
        ordered = sorted(rows, key=_whole_first)
        self._groups = {row: _group(row, rows[row]) for row in ordered}

    @staticmethod
    @once
    def of(frame: pd.DataFrame) -> Groups:
        """Those of the runs among the lines of :meth:`Results.frame`."""
        return Groups(frame.run.dropna() if "run" in frame else [])

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

    def extra_models(self, scene: str) -> list[str]:
        """Models on a scene that no experiment of ``configs/`` sweeps over: one's own, and those
        of which something was changed."""
        found = {run.model_label for run in self.runs if run.scene_label == scene}
        return sorted(found.difference(configs.swept_models()))


def _whole_first(row: _Key) -> list[tuple[bool, Any]]:
    """Key that sorts a row: all samples and all pixels, None, come before fewer."""
    return [(part is not None, part) for part in row]


def _group(row: _Key, runs: list[Finished]) -> Group:
    """Of the runs of a row that are alike, those of today's code, then those timed alone, then by
    stopping rule, then those of today's files of ``configs/``, then the most."""
    alike = defaultdict[tuple[str, str], list[Finished]](list)
    for run in runs:
        alike[run.configuration, run.made_by].append(run)
    best = _best(list(alike.values()))
    by_seeds = {run.every_seed: run for run in best}
    ordered = sorted(by_seeds.values(), key=lambda run: run.seed)
    left_out = len(runs) - len(best)
    return Group(*row, ordered, left_out)


def _best(alternatives: list[list[Finished]]) -> list[Finished]:
    """The alternative that is least by the first of :data:`_PREFERENCES` that tells them apart."""
    for preference in _PREFERENCES:
        if len(alternatives) == 1:
            break  # files of configs/ take long to compose
        costs = [preference(runs) for runs in alternatives]
        least = min(costs)
        pairs = zip(alternatives, costs, strict=True)
        alternatives = [runs for runs, cost in pairs if cost == least]
    return alternatives[0]


def _place_of_stop(run: Finished) -> int:
    stop = run.choices.stop
    return STOPS.index(stop) if stop in STOPS else len(STOPS)


def _is_of_other_files(run: Finished) -> bool:
    """Whether the files of its scene and model have other values today than it has, but for those
    that it changed."""
    but_for = *configs.SEEDS, "device"
    changed = {*run.changed, *COORDINATES}
    for group in ("scene", "model"):
        name = getattr(run.choices, group)
        if configs.is_known(group, name):
            today = configs.part(group, name) or {}
            ours = {key: run.config[key] for key in today}
            parts = (configs.without(but_for, part) for part in (ours, today))
            if not configs.differences(*parts).keys() <= changed:
                return True
    return False


_PREFERENCES: tuple[Callable[[list[Finished]], Any], ...] = (
    lambda runs: bool(runs[0].outdated),
    lambda runs: not runs[0].environment.exclusive,
    lambda runs: _place_of_stop(runs[0]),
    lambda runs: _is_of_other_files(runs[0]),
    lambda runs: -len(runs),
    lambda runs: runs[0].made_by,
)
