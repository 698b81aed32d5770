"""Which records belong to a row of a table: chosen by what was computed, not by what it was called.

A record counts for (scene, model, n_train, pixels) if its resolved configuration is the one that
``configs/`` composes today for that scene and model with the record's own seeds. A run that was
made for another experiment therefore counts too, and one with a changed learning rate never does.
Records are pooled if the same code made them from the same frames: those whose scene has another
fingerprint by now are left out of a row, or the row says so.
"""

from __future__ import annotations

import copy
import csv
import functools
import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from hydra import compose, initialize_config_dir
from hydra.errors import HydraException
from omegaconf import DictConfig, OmegaConf, open_dict
from omegaconf.errors import OmegaConfBaseException

from experiments import pooling, schema
from experiments.record import MOST_ROW_BYTES, NOT_IDENTITY, ROOT, read_record, read_text

CONFIGS = ROOT / "configs"
# Of several finished runs of one seed the first in this list counts; an unnamed rule comes last.
STOPS = ("paper", "quick", "reached")
# What may differ between a record and its reference; n_train and pixels are asked for by number.
_FREE = ("stop", "threads", "split.n_train", "data.pixels", *NOT_IDENTITY)

Curve = list[dict[str, float]]


@dataclass
class Run:
    """A record and its curve.

    Attributes:
        record: what record.json holds.
        curve: one dict a report of the model.
        other_frames: whether the scene makes, or holds, other frames by now.
        disputed: whether other records of the same scene, seeds and split have other test samples.
    """

    record: dict[str, Any]
    curve: Curve = field(default_factory=list)
    other_frames: bool = False
    disputed: bool = False

    @property
    def seeds(self) -> str:
        return json.dumps(self.record["config"]["seed"], sort_keys=True)

    @property
    def iterative(self) -> bool:
        """Whether the model learns by steps that report a loss, or in one pass."""
        return any("loss" in row for row in self.curve)


@dataclass
class Group:
    """The runs behind one row: finished ones of one stopping rule, one for each set of seeds.

    Attributes:
        scene, model: names of the configs.
        n_train: training samples asked for; None for all.
        pixels: pixels asked for; None for all.
        runs: finished runs, in the order of their seeds.
        failed: records of seeds that have no finished run.
        older: finished runs left out because other code, or other frames, made them than the runs.
    """

    scene: str
    model: str
    n_train: int | None = None
    pixels: int | None = None
    runs: list[Run] = field(default_factory=list)
    failed: list[dict[str, Any]] = field(default_factory=list)
    older: list[Run] = field(default_factory=list)

    @property
    def status(self) -> str:
        """``ok``, ``missing``, or what went wrong."""
        if not self.runs and not self.failed:
            return "missing"
        if not self.failed:
            return "; ".join(self._reservations()) or "ok"
        worst = self.failed[0]
        text = f"{worst['status']}: {worst.get('error', 'no error recorded')}"
        return text if not self.runs else f"{len(self.failed)} more {text}"

    def _reservations(self) -> Iterator[str]:
        """What a reader of the row has to know of its runs."""
        frames = bool(self.runs) and self.runs[0].other_frames
        by_frames = sum(run.other_frames != frames for run in self.older)
        if by_code := len(self.older) - by_frames:
            yield f"{by_code} more left out: made by other code"
        if by_frames:
            yield f"{by_frames} more left out: of other frames"
        if frames:
            yield "of other frames than the scene's now"
        if disputed := sum(run.disputed for run in self.runs):
            yield f"{disputed} with other test samples than other models of the same seed"
        if beside := sum(not run.record["environment"].get("exclusive", True) for run in self.runs):
            yield f"{beside} timed beside other runs"


class Records:
    """Every record of a results folder, and the ones a row asks for.

    Args:
        results: the folder that holds ``runs/``.
        device: records of other devices are left out; their times would not compare.

    Attributes:
        problems: files that are no records, by name and reason.
        skipped: ids of records whose configuration is no longer the one of their config's names.
    """

    def __init__(self, results: Path, device: str = "cpu"):
        self.device = device
        self.problems: list[str] = []
        self.skipped: list[str] = []
        self._found: dict[tuple[str, str, int | None, int | None], list[Run]] = {}
        folders = sorted(p for p in (results / "runs").glob("*") if p.is_dir())
        runs = [run for run in map(self._read, folders) if run is not None]
        pooling.mark_disputed(run for run in runs if run.record["status"] == "finished")
        whole = {
            record["scene"]["name"]: record["n_train"]
            for record in (run.record for run in runs)
            if record["status"] == "finished" and record["config"]["split"]["n_train"] is None
        }
        for run in runs:
            config, names = run.record["config"], run.record["choices"]
            n_train = config["split"]["n_train"]
            key = (
                names["scene"],
                names["model"],
                None if n_train == whole.get(names["scene"]) else n_train,
                config["data"]["pixels"],
            )
            self._found.setdefault(key, []).append(run)
        self._whole = whole

    def group(
        self, scene: str, model: str, n_train: int | None = None, pixels: int | None = None
    ) -> Group:
        """The runs of one row."""
        group = Group(scene, model, n_train, pixels)
        wanted = None if n_train == self._whole.get(scene) else n_train
        by_seeds: dict[str, list[Run]] = {}
        for run in self._found.get((scene, model, wanted, pixels), []):
            by_seeds.setdefault(run.seeds, []).append(run)
        finished: dict[int, list[Run]] = {}
        for same in by_seeds.values():
            done = [run for run in same if run.record["status"] == "finished"]
            if not done:
                group.failed.append(min(same, key=_preference).record)
            for rank in {_stop_rank(run) for run in done}:
                best = min((r for r in done if _stop_rank(r) == rank), key=_preference)
                finished.setdefault(rank, []).append(best)
        if finished:
            # Maxima of runs that were stopped by different rules must not be averaged.
            group.runs, group.older = pooling.of_one_frames_and_code(finished[min(finished)])
            group.runs.sort(key=lambda run: _seed_order(run.record))
        group.failed.sort(key=_seed_order)
        return group

    def _read(self, folder: Path) -> Run | None:
        try:
            record = _read_run(folder)
            if record is None:
                return None
            if record["config"]["device"] != self.device:
                return None
            reference = _today(record)
            if reference is None or _identity(record["config"]) != reference:
                self.skipped.append(folder.name)
                return None
            known = record["scene"].get("fingerprint")
            # A record has lost the order of its classes; the equal configuration of today has it.
            now = pooling.fingerprint(json.dumps(reference["scene"]))
            return Run(
                record,
                read_curve(folder / "curve.csv"),
                other_frames=None not in (known, now) and known != now,
            )
        except (ValueError, KeyError, TypeError, AttributeError) as error:
            self.problems.append(f"{folder.name}: {type(error).__name__}: {error}")
            return None


def sweep(experiment: str) -> dict[str, list[str]]:
    """The values that an experiment sweeps over, by key: what its tables expect to find."""
    tree = OmegaConf.load(CONFIGS / "experiment" / f"{experiment}.yaml")
    return {
        str(key): [value.strip() for value in str(values).split(",")]
        for key, values in tree.hydra.sweeper.params.items()
    }


def numbers(values: Sequence[str]) -> list[int | None]:
    """Values of a sweep as integers; null is None."""
    return [None if value == "null" else int(value) for value in values]


def _read_run(folder: Path) -> dict[str, Any] | None:
    """The record of a run, with every field that is used of it as it should be."""
    try:
        record = read_record(folder)
    except OSError as error:
        raise ValueError(f"expected a readable record, found: {error.strerror}") from error
    if record is not None:
        schema.check_run(record)
    return record


def read_curve(path: Path) -> Curve:
    """The rows of curve.csv; empty cells are left out, no file is no rows.

    Raises:
        ValueError: naming the file, if it is no table of numbers with the times of its rows.
    """
    if not path.exists():
        return []
    try:
        rows = csv.DictReader(read_text(path, MOST_ROW_BYTES).splitlines(keepends=True))
        curve = [{key: float(text) for key, text in row.items() if text} for row in rows]
    except (OSError, ValueError, TypeError, csv.Error) as error:
        raise ValueError(f"{path}: expected a curve, found: {error}") from error
    if not all(0 <= row.get("training_s", -1) < float("inf") for row in curve):
        raise ValueError(f"{path}: expected seconds in the column training_s, found others")
    return curve


def _today(record: Mapping[str, Any]) -> dict[str, Any] | None:
    """What today's configs, with the record's seeds, say of its scene and model."""
    names, config = record["choices"], record["config"]
    try:
        return _reference(
            names["scene"], names["model"], json.dumps(config["seed"]), config["device"]
        )
    except (HydraException, OmegaConfBaseException, RecursionError, OSError) as error:
        raise ValueError(f"expected a configuration of configs/, found: {error}") from error


@functools.cache
def _reference(scene: str, model: str, seeds: str, device: str) -> dict[str, Any] | None:
    composed = compose_run(scene, model)
    if composed is None:
        return None
    cfg = copy.deepcopy(composed)
    with open_dict(cfg):
        cfg.seed, cfg.device = json.loads(seeds), device
    return _identity(OmegaConf.to_container(cfg, resolve=True))  # type: ignore[arg-type]


@functools.cache
def compose_run(scene: str, model: str) -> DictConfig | None:
    """What configs/ says of a run of that scene and model; None if they are not there."""
    for group, name in (("scene", scene), ("model", model)):
        if not (CONFIGS / group / f"{name}.yaml").is_file():
            return None
    with initialize_config_dir(str(CONFIGS), version_base="1.3"):
        return compose("config", overrides=[f"scene={scene}", f"model={model}"])


@functools.cache
def _stops() -> list[dict[str, Any]]:
    rules = (OmegaConf.load(CONFIGS / "stop" / f"{name}.yaml") for name in STOPS)
    return [dict(rule) for rule in rules]


def _identity(config: Mapping[str, Any]) -> dict[str, Any]:
    """The part of a configuration that has to agree."""
    kept = copy.deepcopy({key: value for key, value in config.items() if key not in _FREE})
    for name in _FREE:
        group, _, key = name.partition(".")
        if key:
            kept[group].pop(key)
    return kept


def _stop_rank(run: Run) -> int:
    # What ran to its own end does not depend on the rule.
    if run.record["stop"] == "finished":
        return 0
    stops = _stops()
    stop = run.record["config"]["stop"]
    return stops.index(stop) if stop in stops else len(stops)


def _preference(run: Run) -> tuple[int, str]:
    return -int(run.record["config"]["threads"]), run.record["id"]


def _seed_order(record: Mapping[str, Any]) -> tuple[int, str]:
    return record["config"]["seed"]["run"], json.dumps(record["config"]["seed"], sort_keys=True)
