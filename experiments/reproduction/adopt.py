"""Records from own results to the reference, step by step, and back to go on from there.

Only what a finished step of the whole reproduction made by the present code is taken over. The rest
of the reference stays as it is, older revisions too, until a new record takes its place.
"""

from __future__ import annotations

import shutil
from collections.abc import Container, Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

import msgspec

from experiments.records import record as records
from experiments.records import steps as touched
from experiments.records.groups import Run
from experiments.records.measurement import Measured
from experiments.records.results import Results
from experiments.reproduction import took
from experiments.reproduction.steps import WHAT, steps

WHOLE = "full"  # the mode whose steps make the reference


@dataclass(frozen=True)
class Adopted:
    """How many runs and measurements entered the reference, and how many of steps that are not
    finished stayed outside."""

    runs: int
    measurements: int
    outside: int


def adopt(own: Path, reference: Path, drop_older: bool = False) -> Adopted:
    """Take over what finished steps of the whole reproduction left in own results.

    Runs of configs as they are enter, and measurements, but none of one's own recordings, none of
    other revisions, and none with changes that are in no commit.

    Args:
        own: folder of own results.
        reference: folder of the reference.
        drop_older: remove what other revisions made and nothing replaced, and times of steps that
            are no more.
    """
    results, before = Results(own), Results(reference)
    unfinished = unfinished_records(own)
    runs = [run for run in results.runs if _may_enter(run)]
    entering = [run for run in runs if run.record.id not in unfinished]
    _adopt_runs(entering, results, before, drop_older)
    measured = list(_measurements(results))
    taken = [(m, suffix) for m, suffix in measured if m.record.id not in unfinished]
    _adopt_measurements(taken, before, drop_older)
    rows = took.read(reference)
    for key, row in took.read(own).items():
        if row["status"] == took.FINISHED:
            rows[key] = row
    if drop_older:
        there = {(step.name, mode) for mode in WHAT for step in steps(mode)}
        rows = {key: row for key, row in rows.items() if key in there}
    if rows:
        took.write(reference, rows.values())
    outside = len(runs) - len(entering) + len(measured) - len(taken)
    return Adopted(len(entering), len(taken), outside)


def unfinished_records(own: Path) -> set[str]:
    """Names of records of which no step of the whole reproduction vouches: one that is not
    finished, or one of another mode, made them."""
    rows = took.read(own)
    sure: set[str] = set()
    unsure: set[str] = set()
    for listed in touched.read(own):
        row = rows.get((listed.step, listed.mode))
        is_finished = row is not None and row["status"] == took.FINISHED
        vouches = is_finished and listed.whole and listed.mode == WHOLE
        (sure if vouches else unsure).update(listed.names)
    return unsure - sure


def _may_enter(run: Run) -> bool:
    record = run.record
    is_plain = not run.overrides and not run.outdated
    others_have_it = record.scene.origin != "recorded"
    return is_plain and others_have_it and record.environment.is_of_a_commit


def _adopt_runs(
    entering: list[Run], results: Results, before: Results, drop_older: bool
) -> None:
    ours = {run.place: run.record.id for run in entering}
    stay = set()
    for run in before.runs:
        dropped = bool(run.outdated) and drop_older
        if not run.overrides and not dropped and run.place not in ours:
            stay.add(run.record.id)
    lines = _finished_lines(before.folder, stay)
    lines |= _finished_lines(results.folder, set(ours.values()))
    records.write_all(before.folder, [lines[name] for name in sorted(lines)])


def _finished_lines(
    folder: Path,
    names: Container[str],
) -> dict[str, dict[str, Any]]:
    """The last line of each finished run with one of these ids, decoded."""
    path = folder / records.RUNS
    lines: dict[str, dict[str, Any]] = {}
    if not path.is_file():
        return lines
    for line in path.read_bytes().splitlines():
        try:
            entry = msgspec.json.decode(line, type=dict)
        except ValueError:
            continue  # a line that is no record: its reader has named it
        if entry.get("id") in names and entry.get("status") == "finished":
            lines[entry["id"]] = entry
    return lines


def _measurements(results: Results) -> Iterator[tuple[Measured, str]]:
    """Measurements that may enter, each with the suffix of its folder's name."""
    for measured in results.measurements:
        scene = measured.record.config.get("scene") or {}
        is_ones_own = scene.get("_target_", "").startswith("scenes.recorded.")
        of_a_commit = measured.record.environment.is_of_a_commit
        if of_a_commit and not is_ones_own and not measured.outdated:
            place = measured.record.scene or measured.folder.name
            yield measured, f"_{place}" if measured.of_other_frames else ""


def _adopt_measurements(
    taken: list[tuple[Measured, str]], before: Results, drop_older: bool
) -> None:
    for old in before.measurements:
        replaced = any(_replaces(measured, old) for measured, _ in taken)
        if replaced or (old.outdated and drop_older):
            shutil.rmtree(old.folder)
    for measured, suffix in taken:
        target = before.folder / "measured" / f"{measured.record.name}{suffix}"
        if (target / "record.json").exists():  # of other settings on the same scene
            target = before.folder / "measured" / measured.record.id
        _copy(measured.folder, target)


def _replaces(new: Measured, old: Measured) -> bool:
    """Whether a measurement takes the place of another: the same one, one of an older revision on
    the same scene, or one of which the same settings were changed."""
    if (new.record.name, new.record.scene) != (old.record.name, old.record.scene):
        return False
    same = new.record.id == old.record.id
    return same or bool(old.outdated) or set(new.overrides) == set(old.overrides)


def _copy(source: Path, target: Path) -> None:
    """Copy a measurement without its lock."""
    shutil.rmtree(target, ignore_errors=True)
    shutil.copytree(source, target, ignore=shutil.ignore_patterns(".*"))


def go_on_from(reference: Path, own: Path) -> int:
    """Put what the present code made of the reference into own results, where they lack it: the
    steps that made it are then found finished. Returns the number of records."""
    results, there = Results(reference), Results(own)
    own.mkdir(parents=True, exist_ok=True)
    runs = _current(results.runs).keys() - _current(there.runs).keys()
    for entry in _finished_lines(reference, runs).values():
        records.append_decoded(own, entry)
    ours, theirs = _current(there.measurements), _current(results.measurements)
    missing = [theirs[name] for name in theirs if name not in ours]
    for measured in missing:
        _copy(measured.folder, own / "measured" / measured.record.id)
    _take_over_steps(results, own)
    return len(runs) + len(missing)


Made = TypeVar("Made", Run, Measured)


def _current(found: Iterable[Made]) -> dict[str, Made]:
    """Those of some records that the present code made, by name."""
    return {one.record.id: one for one in found if not one.outdated}


def _take_over_steps(results: Results, own: Path) -> None:
    """Rows of reproduce.csv that own results lack, of the commits that made what is up to date: of
    steps of an older code nothing is known here."""
    runs, measurements = _current(results.runs), _current(results.measurements)
    current: list[Run | Measured] = [*runs.values(), *measurements.values()]
    commits = {one.record.environment.commit for one in current}
    rows = took.read(own)
    for key, row in took.read(results.folder).items():
        if row.get("commit") in commits:
            rows.setdefault(key, row)
    if rows:
        took.write(own, rows.values())
