"""Where records lie: ``records.jsonl`` of a folder, a record a line, a file that only grows.

A record that is made again adds a line; of several lines with one id the last finished one counts.
A line that is no record is reported and skipped.
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator
from pathlib import Path

import msgspec
from rich.console import Console

from experiments.records import locks
from experiments.records.console import say
from experiments.records.record import SCHEMA, Record
from experiments.records.revision import Revisions
from hdc.io import write_atomically

FILE = "records.jsonl"
_LOCKS = Path("cache", "locks")
_DECODER = msgspec.json.Decoder(Record)


class _Version(msgspec.Struct):
    schema: int


def to_line(record: Record) -> str:
    """A record as a line of JSON.

    Raises:
        TypeError: for a value that JSON does not have.
    """
    return msgspec.json.encode(record).decode()


def append(folder: Path, record: Record) -> None:
    """Add a record to the file of a folder."""
    line = to_line(record)
    lock = locks.held(folder / _LOCKS / FILE, timeout_s=-1)
    with lock, (folder / FILE).open("a+b") as file:
        if file.tell():  # a line that a kill cut short must not spoil the next
            file.seek(-1, os.SEEK_END)
            if file.read(1) != b"\n":
                line = f"\n{line}"
        file.write(f"{line}\n".encode())
        file.flush()
        os.fsync(file.fileno())


def read(folder: Path, name: str = "") -> Iterator[Record | ValueError]:
    """Every record of a folder whose line has the name in it, in their order: the last finished
    one of each id, else its last. A line that is no record gives an error that names it; lines of
    earlier versions give one error together."""
    path, earlier = folder / FILE, 0
    records: dict[str, Record] = {}
    lines = path.read_bytes().splitlines() if path.is_file() else []
    for number, line in enumerate(lines, 1):
        if name.encode() not in line:
            continue
        try:
            record = _DECODER.decode(line)
        except (ValueError, RecursionError) as error:
            if _is_earlier(line):
                earlier += 1
            else:
                yield ValueError(f"{path}, line {number}: {error}")
            continue
        known = records.get(record.id)
        if known is None or record.is_finished or not known.is_finished:
            records.pop(record.id, None)  # in the order of the lines that count
            records[record.id] = record
    if earlier:
        yield ValueError(
            f"{path}: {earlier} records of an earlier version, which this version does not read; "
            "set RESULTS_DIR to another folder, or report on them by that version"
        )
    yield from records.values()


def _is_earlier(line: bytes) -> bool:
    """Whether a line is a record of an earlier version."""
    try:
        return msgspec.json.decode(line, type=_Version).schema < SCHEMA
    except (ValueError, RecursionError):
        return False


def find(folder: Path, name: str) -> Record | None:
    """The finished record of this id, or None."""
    for record in read(folder, name):
        if isinstance(record, Record) and record.id == name and record.is_finished:
            return record
    return None


def write_all(folder: Path, records: Iterable[Record]) -> None:
    """Replace the records of a folder."""
    text = "".join(f"{to_line(record)}\n" for record in records)
    write_atomically(folder / FILE, text)


def lock_of(folder: Path, name: str) -> Path:
    """The file that whoever makes the record of this id locks."""
    return folder / _LOCKS / name


def made_before(
    folder: Path,
    name: str,
    now: Revisions,
    console: Console | None = None,
    threads: int | None = None,
    columns: Iterable[str] = (),
) -> Record | None:
    """The finished record of this id, if it is what today's code would make.

    Args:
        folder: of the records.
        name: the id.
        now: revisions of today's code for the config of this id.
        console: prints why one does not count.
        threads: of torch; a record of times with another number does not count.
        columns: that its rows need to have.
    """
    known = find(folder, name)
    if known is None:
        return None
    reasons, before = known.differs_from(now), known.environment.threads
    if threads not in (None, before):
        reasons.append(f"{before} threads, now {threads}")
    reasons += [
        f"no {column}" for column in columns if column not in known.rows.columns
    ]
    if not reasons:
        return known
    if console is not None:
        text = f"{name}: made again, finished otherwise: {', '.join(reasons)}"
        say(console, text, "yellow")
    return None
