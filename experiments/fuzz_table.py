"""The campaign of damaged and hostile files as a table: results/tables/fuzz.csv and .md."""

from __future__ import annotations

import ast
from collections.abc import Sequence
from pathlib import Path

from experiments import measurement
from experiments.fuzz import BOMB, FAILURES, RESULTS
from experiments.measurement import Row
from experiments.record import ROOT, write_atomically

_COUNTS = ("cases", *RESULTS, *FAILURES)
_HEADS = {
    "kind": "Kind of file",
    "cases": "Files",
    "named_errors": "Named error",
    "correct": "Same result",
    "changed": "Other result",
    "unnamed_errors": "Other error",
    "unstable": "Differs when read again",
    "crashes": "Crash",
    "hangs": "Hang",
    "slowest_s": "Slowest, s",
    "peak_mb": "Peak memory, MB",
}


def table(results: Path) -> list[Path]:
    """Write the table of the campaign in a results folder.

    Returns:
        list: tables/fuzz.csv and tables/fuzz.md; empty if the campaign has not been carried out.

    Raises:
        ValueError: naming the file, if the measurement is none.
    """
    found = measurement.read(results, "fuzz")
    if found is None:
        return []
    rows = summary(found.rows)
    paths = [results / "tables" / f"fuzz.{kind}" for kind in ("csv", "md")]
    write_atomically(paths[0], measurement.to_csv(rows))
    write_atomically(paths[1], to_markdown(rows, found.record))
    return paths


def summary(rows: Sequence[dict[str, str]]) -> list[Row]:
    """A row for each kind of damaged file, one for all files that ask for much, and one for all."""
    groups: dict[str, list[dict[str, str]]] = {}
    for row in rows:
        name = "asking for much" if row["damage"] == BOMB else row["kind"]
        groups.setdefault(name, []).append(row)
    return [_sum(name, same) for name, same in {**groups, "all": list(rows)}.items()]


def _sum(name: str, rows: Sequence[dict[str, str]]) -> Row:
    return {
        "kind": name,
        **{key: sum(int(row[key]) for row in rows) for key in _COUNTS},
        "slowest_s": round(max((float(row["slowest_s"]) for row in rows), default=0.0), 2),
        "peak_mb": round(max((int(row["peak_bytes"]) for row in rows), default=0) / 1e6),
    }


def to_markdown(rows: Sequence[Row], record: Row) -> str:
    """The table with its caption above and its notes below."""
    lines = [list(_HEADS.values()), ["---", *["---:"] * (len(_HEADS) - 1)]]
    lines += [[str(row[key]) for key in _HEADS] for row in rows]
    body = "\n".join("| " + " | ".join(line) + " |" for line in lines)
    limit = record["config"]["limit_s"]
    notes = (
        "A named error is a ValueError with the name of the file. Another result than the sound "
        "file's is what a damaged pixel, label or prototype gives: only PNG and npz have check "
        "sums, and some of those were made after the damage. What could be read was read twice, "
        f"in child processes, with a limit of {limit:g} s a file; memory includes the libraries'. "
        "Files asking for much are sound: images, archives, tables and records of up to a gigabyte "
        "in a few MB."
    )
    if n := hypothesis_examples():
        notes += f" Besides, Hypothesis makes up to {n} files in each run of the tests."
    if record["status"] != "finished":
        notes += f" The campaign is not whole: {record['status']}."
    return f"**What became of damaged and hostile files.**\n\n{body}\n\n{notes}\n"


def hypothesis_examples(folder: Path = ROOT / "tests" / "fuzz") -> int:
    """How many examples the tests of hostile input ask Hypothesis for: their ``max_examples``."""
    return sum(
        keyword.value.value
        for path in sorted(folder.glob("test_*.py"))
        for node in ast.walk(ast.parse(path.read_bytes()))
        if isinstance(node, ast.keyword) and (keyword := node).arg == "max_examples"
        and isinstance(keyword.value, ast.Constant) and isinstance(keyword.value.value, int)
    )  # fmt: skip
