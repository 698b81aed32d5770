"""Everything in a results folder, loaded once, and its rows as one data frame."""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Any, Concatenate, ParamSpec, TypeVar

import pandas as pd

from experiments.records import configs, store
from experiments.records.record import Measurement
from experiments.records.run import Finished, Unfinished

_P = ParamSpec("_P")
_T = TypeVar("_T")

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


class Results:
    """A results folder: its finished `runs`, records of the `unfinished`, `problems` of files.

    Attributes:
        measurements: those on the frames of their experiment's config first, of these those of
            which least was changed, of these the one made last.
    """

    def __init__(self, folder: Path):
        self.problems: list[str] = [*_of_version_2(folder)]
        self.runs: list[Finished] = []
        self.unfinished: list[Unfinished] = []
        self.measurements: list[Measurement] = []
        self._frames: dict[tuple[str, ...], pd.DataFrame] = {}
        for record in store.read(folder):
            if isinstance(record, ValueError):
                self.problems.append(str(record))
            elif isinstance(record, Measurement):
                _show_as_its_scene(record)
                self.measurements.insert(0, record)  # the last comes first
            else:
                self._take(record)
        self.measurements.sort(key=lambda m: (m.of_other_frames, len(m.changed)))

    def __bool__(self) -> bool:
        return bool(self.runs or self.unfinished or self.measurements)

    @property
    def finished(self) -> list[store.Made]:
        """Every finished record."""
        return [*self.runs, *self.measurements]

    def frame(self, *experiments: str) -> pd.DataFrame:
        """The rows of records as one table, a line per row; without lines where there are none.

        A line has the columns of its row, and those of its record: :data:`META`. ``runs`` stands
        for the single trainings: a line a run, with its metrics. There is one measurement of an
        experiment and scene: of those whose config was changed least the one made last, and beside
        it those of other models (:func:`_is_beside`). Scenes are in the order of their places.
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

    def _by_scene(self, name: str) -> list[Measurement]:
        found: dict[str, list[Measurement]] = {}
        for measured in self.measurements:  # those changed least come first
            if measured.name == name:
                of_scene = found.setdefault(measured.scene_label, [])
                if all(_is_beside(measured, other) for other in of_scene):
                    of_scene.append(measured)
        places = {scene: configs.scene_display(scene)["place"] for scene in found}
        ordered = sorted(found, key=lambda scene: (places[scene], scene))
        return [one for scene in ordered for one in found[scene]]

    def _take(self, entry: Finished | Unfinished) -> None:
        scene, model = entry.choices.scene, entry.choices.model
        if entry.display and not configs.is_known("model", model):
            configs.show_as("model", model, entry.display)
        if entry.scene_display and not configs.is_known("scene", scene):
            configs.show_as("scene", scene, entry.scene_display)
        if isinstance(entry, Finished):
            self.runs.append(entry)
        else:
            self.unfinished.append(entry)


def _of_version_2(folder: Path) -> Iterator[str]:
    for name in ("runs.jsonl", "measured"):
        if (folder / name).exists():
            yield (
                f"{folder / name}: records of version 2.0, which this version does not read; "
                "set RESULTS_DIR to another folder, or report on them by version 2.0"
            )


def _show_as_its_scene(measured: Measurement) -> None:
    """A scene of which something was changed is of the kind and the family of its config."""
    label = measured.scene_label
    if label != measured.scene:
        configs.show_as("scene", label, configs.scene_display(measured.scene))


def _is_beside(one: Measurement, other: Measurement) -> bool:
    """Whether a measurement has other models than another, on seeds of it, and all other settings
    are equal. Times of two calls do not compare, so of what is timed there is one."""
    columns = one.rows.columns
    if any(column.endswith("_s") or column == "seconds" for column in columns):
        return False
    models, of_other = (set(m.config.get("models") or ()) for m in (one, other))
    seeds, seeds_of_other = (m.config.get("seeds") or [] for m in (one, other))
    same = (configs.without(("models", "seeds"), m.config) for m in (one, other))
    return (
        bool(models and of_other)
        and models.isdisjoint(of_other)
        and set(seeds) <= set(seeds_of_other)
        and next(same) == next(same)
    )


def once(
    make: Callable[Concatenate[pd.DataFrame, _P], _T],
) -> Callable[Concatenate[pd.DataFrame, _P], _T]:
    """A function of a frame that computes once for each frame and arguments. Its results are kept
    as long as the frame is, and belong to everybody: nobody may change them, or the frame."""

    @functools.wraps(make)
    def kept(frame: pd.DataFrame, *args: _P.args, **kwargs: _P.kwargs) -> _T:
        results: dict[Any, _T] = frame.__dict__.setdefault("_once", {})
        key = make, args, tuple(kwargs.items())
        if key not in results:
            results[key] = make(frame, *args, **kwargs)
        return results[key]

    return kept


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


@once
def by_scene(lines: pd.DataFrame) -> dict[str, pd.DataFrame]:
    """The lines of each scene, in their order."""
    return {str(scene): of for scene, of in lines.groupby("scene", sort=False)}


@once
def of_scenes(frame: pd.DataFrame, experiment: str) -> dict[str, pd.DataFrame]:
    """The lines of one experiment by scene, in the order of the frame, with the columns of its rows
    and of records alone."""
    found = {}
    if len(frame):
        for scene, rows in by_scene(frame[frame.experiment == experiment]).items():
            names = dict.fromkeys([*rows.of_row.iloc[0], *META])
            found[scene] = rows[list(names)].infer_objects()
    return found


def _frame_of(measured: Measurement) -> pd.DataFrame:
    """A line a row of a measurement; a column of the row keeps its name before that of a record."""
    environment = measured.environment
    frame = measured.frame.copy()
    of_record = {
        "experiment": measured.name,
        "scene": measured.scene_label,
        "record": measured.id,
        "command": measured.command,
        "config": measured.config,
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


def _frame_of_runs(runs: Iterable[Finished]) -> pd.DataFrame:
    """A line a run: its place, its metrics and the run itself, with its curve."""
    lines = []
    for run in runs:
        environment = run.environment
        line: dict[str, Any] = {
            "experiment": RUNS,
            "scene": run.scene_label,
            "model": run.model_label,
            "n_train": run.config["split"]["n_train"],
            "pixels": run.config["data"]["pixels"],
            "seed": run.seed,
            "origin": run.scene.origin,
            "record": run.id,
            "command": run.command,
            "config": run.config,
            "elsewhere": False,
            "device": environment.device,
            "cpu": environment.cpu,
            "threads": environment.threads,
            "run": run,
        }
        line |= {name: getattr(run, name) for name in METRICS}
        lines.append(line)
    return pd.DataFrame(lines)
