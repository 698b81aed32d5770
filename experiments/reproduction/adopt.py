"""Records from own results to the reference, step by step, and back to go on from there.

A finished step of the whole reproduction enters whole: its records take the place of all those that
the reference has of this step. Steps that were not called stay as they are, older revisions too.
"""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import NamedTuple

from experiments.records import store
from experiments.records.record import Record
from experiments.records.results import Results
from experiments.reproduction import took
from experiments.reproduction.steps import steps

WHOLE = "full"  # the mode whose steps make the reference


class Adopted(NamedTuple):
    """How many records entered the reference, how many left it, and how many of own results stayed
    outside."""

    entered: int
    left: int
    outside: int


def adopt(own: Path, reference: Path) -> Adopted:
    """Take over what finished steps of the whole reproduction made, or found made.

    None of other revisions enters, and none with changes that are in no commit; a step of which
    nothing may enter stays as the reference has it. What belongs to no step any more leaves the
    reference.

    Args:
        own: folder of own results.
        reference: folder of the reference.
    """
    known = {step.name for step in steps(WHOLE)}
    every = {f"{WHOLE}/{name}" for name in known}
    calls = [row for row in took.read(own).values() if row["status"] == took.FINISHED]
    finished = every & {took.step_of(row) for row in calls}
    ours, before = Results(own).finished, Results(reference).finished
    made = [record for record in ours if finished & {*record.steps}]
    entering = [record for record in made if _may_enter(record)]
    replaced = finished & _steps_of(entering)
    refused = _steps_of(made) - _steps_of(entering)

    records = _joined(before, entering, replaced, every)
    store.write_all(reference, (records[name] for name in sorted(records)))
    entered = [row for row in calls if took.step_of(row) not in refused]
    _take_times(reference, entered, known)
    left = {record.id for record in before}.difference(records)
    return Adopted(len(entering), len(left), len(ours) - len(entering))


def _joined(
    before: Iterable[store.Made],
    entering: Iterable[store.Made],
    replaced: set[str],
    every: set[str],
) -> dict[str, store.Made]:
    """Records by id: those of before without the steps that are replaced, and those that enter.
    Each then names its steps among all there are."""
    records: dict[str, store.Made] = {}
    for record in before:
        record.steps = sorted((every - replaced) & {*record.steps})
        if record.steps:
            records[record.id] = record
    for record in entering:
        shared = records[record.id].steps if record.id in records else []
        record.steps = sorted(every & {*record.steps, *shared})
        records[record.id] = record
    return records


def _take_times(reference: Path, calls: Iterable[took.Call], known: set[str]) -> None:
    """Add the times of calls to the reference; steps that are not known lose theirs."""
    rows = took.read(reference)
    for row in calls:
        rows[row["step"], row["mode"]] = row
    took.write(reference, (row for row in rows.values() if row["step"] in known))


def _steps_of(records: Iterable[Record]) -> set[str]:
    return {step for record in records for step in record.steps}


def _may_enter(record: Record) -> bool:
    return record.environment.is_of_a_commit and not record.outdated


def go_on_from(reference: Path, own: Path) -> int:
    """Put what the present code made of the reference into own results, where they lack it: the
    steps that made it are then found finished. Returns the number of records."""
    own.mkdir(parents=True, exist_ok=True)
    current = _current(Results(reference).finished)
    there = {record.id for record in _current(Results(own).finished)}
    missing = [record for record in current if record.id not in there]
    for record in missing:
        store.append(own, record)
    # Nothing is known here of steps of an older code.
    commits = {record.environment.commit for record in current}
    with took.changing(own) as rows:
        for key, row in took.read(reference).items():
            if row.get("commit") in commits:
                rows.setdefault(key, row)
    return len(missing)


def _current(records: Iterable[store.Made]) -> list[store.Made]:
    return [record for record in records if not record.outdated]
