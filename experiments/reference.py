"""For maintainers: own results become the committed reference: ``python -m experiments.reference``.

The finished runs and measurements of the folder of own results replace those of the same studies in
``results/reference``, its tables and figures are made again, and the marked tables of README.md are
filled from them; committed records of other revisions are named.
"""

from __future__ import annotations

import argparse
import os
import re
import shutil
import sys
from collections import Counter
from collections.abc import Container
from pathlib import Path
from typing import Any

import msgspec
from rich.console import Console

from experiments import report, reproduce, studies
from experiments.protocol.sweep import span
from experiments.records import record as records
from experiments.records.files import REFERENCE, ROOT, results_dir
from experiments.records.results import Results, Run
from experiments.reporting.study import studies as studies_of
from experiments.reporting.study import with_places
from hdc.io import write_atomically

README = ROOT / "README.md"
COMMANDS = {
    "table1": "make table1",
    "full": "make reproduce",
    "quick": "make reproduce QUICK=1",
}
_BLOCK = re.compile(r"(<!-- begin (\w+) -->\n).*?(<!-- end \2 -->)", re.DOTALL)


def main(arguments: list[str] | None = None) -> int:
    """Carry it out; 1 if a record is of another revision."""
    parser = argparse.ArgumentParser(
        prog="python -m experiments.reference", description=__doc__
    )
    parser.add_argument(
        "--tables", action="store_true", help="only tables, figures and README"
    )
    chosen = parser.parse_args(arguments)
    console = Console(highlight=False)
    if not chosen.tables:
        adopt(results_dir(), REFERENCE)
    answers = report.Answers("reference", Results(REFERENCE), studies_of(studies))
    answers.draw()
    written = answers.write(REFERENCE)
    report.print_problems(console, [answers])
    console.print(
        f"{len(written)} files in {os.path.relpath(REFERENCE)}", soft_wrap=True
    )
    write_atomically(README, fill(README.read_text(encoding="utf-8")))
    console.print(f"tables of {os.path.relpath(README)}")
    changed = Counter[str]()
    for run in answers.results.runs:
        changed.update(run.outdated)
    for measured in answers.results.measurements:
        changed.update(measured.outdated)
    for name, n in sorted(changed.items()):
        console.print(f"{name}: {n} records are of another", soft_wrap=True)
    return 1 if changed else 0


def adopt(own: Path, reference: Path) -> None:
    """Take over runs of configs as they are, and measurements, but none of one's own recordings.

    What has changes that are in no commit stays outside; what other revisions or another config
    made leaves the reference.
    """
    results, before = Results(own), Results(reference)
    _adopt_runs(results, before)
    _adopt_measurements(results, before)
    steps = reproduce.read(reference) | reproduce.read(own)
    if steps:
        reproduce.write(reference, steps.values())


def _adopt_runs(results: Results, before: Results) -> None:
    ours = {run.place: run.record.id for run in results.runs if _may_enter(run)}
    stay = set()
    for run in before.runs:
        if not run.overrides and not run.outdated and run.place not in ours:
            stay.add(run.record.id)
    lines = _finished_lines(before.folder, stay)
    lines |= _finished_lines(results.folder, set(ours.values()))
    records.write_all(before.folder, [lines[name] for name in sorted(lines)])


def _may_enter(run: Run) -> bool:
    record = run.record
    is_plain = not run.overrides and not run.outdated
    others_have_it = record.scene.origin != "recorded"
    return is_plain and others_have_it and record.environment.is_of_a_commit


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


def _adopt_measurements(results: Results, before: Results) -> None:
    for measured in before.measurements:
        if measured.outdated:
            shutil.rmtree(measured.folder)
    for name in sorted({measured.record.name for measured in results.measurements}):
        for place, measured in with_places(results, name):
            scene = measured.record.config.get("scene") or {}
            is_ones_own = scene.get("_target_", "").startswith("scenes.recorded.")
            of_a_commit = measured.record.environment.is_of_a_commit
            if is_ones_own or measured.outdated or not of_a_commit:
                continue
            target = before.folder / "measured" / f"{name}{place}"
            hidden = shutil.ignore_patterns(".*")
            shutil.rmtree(target, ignore_errors=True)
            shutil.copytree(measured.folder, target, ignore=hidden)


def fill(text: str) -> str:
    """Replace the content of every marked block of README.md."""
    contents = {"claims": _claims, "table1": _table1, "reproduction": _reproduction}
    return _BLOCK.sub(
        lambda match: f"{match[1]}{contents[match[2]]()}\n{match[3]}", text
    )


def _claims() -> str:
    """The rows of the paper's claims, without title and note."""
    path = REFERENCE / "tables" / "claims.md"
    rows = []
    if path.exists():
        lines = path.read_text("utf-8").splitlines()
        rows = [line for line in lines if line.startswith("|")]
    return "\n".join(rows) or "*missing: no claim was measured*"


def _table1() -> str:
    path = REFERENCE / "tables" / "table1.md"
    if not path.exists():
        return "*missing: no run of Table I*"
    return path.read_text("utf-8").strip()


def _reproduction() -> str:
    """How many steps each command took, their time added up, and the most memory one needed."""
    rows = list(reproduce.read(REFERENCE).values())
    texts = []
    for mode, command in COMMANDS.items():
        of_mode = [row for row in rows if row["mode"] == mode]
        done = [row for row in of_mode if row["status"] == "finished"]
        if not done:
            continue
        most = max(int(row["peak_bytes"]) for row in done) / 1e9
        time = span(sum(reproduce.wall_seconds(row) for row in done))
        steps = f"{len(done)} of {len(reproduce.steps(mode))} steps"
        texts.append(f"`{command}`, {steps}: {time}, {most:.1f} GB")
    if not texts:
        return "*missing: no whole reproduction was timed*"
    return "; ".join(texts) + "."


if __name__ == "__main__":
    sys.exit(main())
