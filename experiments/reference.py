"""For maintainers: own results become the committed reference: ``python -m experiments.reference``.

The finished runs and measurements of the folder of own results replace those of the same studies in
``results/reference``, its tables and figures are made again, and the marked tables of README.md are
filled from them; committed records of other code are named.
"""

from __future__ import annotations

import argparse
import os
import re
import shutil
import sys
from collections import Counter
from pathlib import Path
from typing import Any

import msgspec
from rich.console import Console

from experiments import report, reproduce, studies
from experiments.records import record as records
from experiments.records.files import REFERENCE, ROOT, results_dir
from experiments.records.results import Results
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
    """Carry it out; 1 if a record is of other code."""
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
    changed = Counter(file for run in answers.results.runs for file in run.outdated)
    changed += Counter(
        file for m in answers.results.measurements for file in m.outdated
    )
    for file, n in sorted(changed.items()):
        console.print(f"{file} has changed since {n} records", soft_wrap=True)
    return 1 if changed else 0


def adopt(own: Path, reference: Path) -> None:
    """Take over runs of configs as they are, and measurements, but none of one's own recordings.

    What another code or config made leaves the reference.
    """
    results, before = Results(own), Results(reference)
    plain = (run.record for run in results.runs if not run.overrides)
    ours = {record.id for record in plain if record.scene.origin != "recorded"}
    gone = {run.record.id for run in before.runs if run.overrides or run.outdated}
    for measured in before.measurements:
        if measured.outdated:
            shutil.rmtree(measured.folder)
    code = records.read_code(reference) | records.read_code(own)
    lines: dict[str, dict[str, Any]] = {}
    for folder in (reference, own):
        path = folder / records.RUNS
        for line in path.read_bytes().splitlines() if path.is_file() else ():
            entry = msgspec.json.decode(line)
            name, finished = entry["id"], entry["status"] == "finished"
            if (name in ours and finished) if folder == own else (name not in gone):
                lines[name] = entry
    records.write_all(reference, (lines[name] for name in sorted(lines)), code)
    for name in sorted({measured.record.name for measured in results.measurements}):
        for place, measured in with_places(results, name):
            scene = measured.record.config.get("scene", {})
            if scene.get("_target_", "").startswith("scenes.recorded."):
                continue  # others do not have that recording
            target = reference / "measured" / f"{name}{place}"
            shutil.rmtree(target, ignore_errors=True)
            shutil.copytree(
                measured.folder, target, ignore=shutil.ignore_patterns(".*")
            )
    if steps := reproduce.read(reference) | reproduce.read(own):
        reproduce.write(reference, steps.values())


def fill(text: str) -> str:
    """Replace the content of every marked block of README.md."""
    contents = {"claims": _claims, "table1": _table1, "reproduction": _reproduction}
    return _BLOCK.sub(
        lambda match: f"{match[1]}{contents[match[2]]()}\n{match[3]}", text
    )


def _claims() -> str:
    """The rows of the paper's claims, without title and note."""
    path = REFERENCE / "tables" / "claims.md"
    lines = path.read_text("utf-8").splitlines() if path.exists() else []
    rows = [line for line in lines if line.startswith("|")]
    return "\n".join(rows) or "*missing: no claim was measured*"


def _table1() -> str:
    path = REFERENCE / "tables" / "table1.md"
    return (
        path.read_text("utf-8").strip()
        if path.exists()
        else "*missing: no run of Table I*"
    )


def _reproduction() -> str:
    """How many steps each command took, their time added up, and the most memory one needed."""
    rows, texts = list(reproduce.read(REFERENCE).values()), []
    for mode, command in COMMANDS.items():
        done = [
            row for row in rows if row["mode"] == mode and row["status"] == "finished"
        ]
        if done:
            most = max(int(row["peak_bytes"]) for row in done) / 1e9
            lanes = [
                1 + ("exclusive=false" in row["command"]) for row in done
            ]  # two at a time
            seconds = sum(
                float(row["seconds"]) / n for row, n in zip(done, lanes, strict=True)
            )
            time = reproduce.span(seconds)
            steps = f"{len(done)} of {len(reproduce.steps(mode))} steps"
            texts.append(f"`{command}`, {steps}: {time}, {most:.1f} GB")
    return (
        "; ".join(texts) + "."
        if texts
        else "*missing: no whole reproduction was timed*"
    )


if __name__ == "__main__":
    sys.exit(main())
