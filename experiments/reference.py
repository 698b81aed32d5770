"""For maintainers: own results become the committed reference: ``python -m experiments.reference``.

The finished runs and measurements of the folder of own results replace those of the same studies in
``results/reference``, its tables and figures are made again, and the marked tables of README.md are
filled from them. At the end every committed record has to be of today's code, or the file that has
changed stands in ``results/reference/stands.yaml`` with the reason why the record may stand.
``--check`` does the last alone and writes nothing.
"""

from __future__ import annotations

import argparse
import csv
import os
import re
import shutil
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

from rich.console import Console

from experiments import report, reproduce
from experiments.records import archive
from experiments.records.files import REFERENCE, ROOT, results_dir, write_atomically
from experiments.records.record import to_csv
from experiments.records.results import Results, Run
from experiments.reporting.measured import with_places
from experiments.reporting.table import markdown_text

MEASURED_LIGHT = "scenes.fibre.FibreScene"  # public; other scenes of a study are one's own
README = ROOT / "README.md"
_BLOCK = re.compile(r"(<!-- begin (\w+) -->\n).*?(<!-- end \2 -->)", re.DOTALL)


def main(arguments: list[str] | None = None) -> int:
    """Carry it out; 1 if a record is of other code and no reason is given."""
    parser = argparse.ArgumentParser(prog="python -m experiments.reference", description=__doc__)
    parser.add_argument("--check", action="store_true", help="only check the committed records")
    parser.add_argument("--tables", action="store_true", help="only tables, figures and README")
    chosen = parser.parse_args(arguments)
    console = Console(highlight=False)
    if not chosen.check:
        if not chosen.tables:
            adopt(results_dir(), REFERENCE)
        report.main(["--reference"])
        text = README.read_text(encoding="utf-8")
        write_atomically(README, fill(text, blocks()))
        console.print(f"tables of {os.path.relpath(README)}")
    wrong = outdated(Results(REFERENCE))
    for file, names in sorted(wrong.items()):
        console.print(
            f"{file} has changed since {len(names)} records, such as {names[0]}", soft_wrap=True
        )
    return 1 if wrong else 0


def adopt(own: Path, reference: Path) -> None:
    """Take over runs and measurements of configs as they are; what else the reference has of such
    configs stays, and runs go whose config has changed since, or that were made again.

    Recordings and whatever was changed of a config are nobody's reference, but for measurements on
    the public fibre.

    Raises:
        ValueError: naming a file that is no record.
    """
    results = Results(own)
    ours = [
        run for run in results.runs if not run.overrides and run.record.scene.origin != "recorded"
    ]
    made = set(map(_asked, ours))
    archive.pack(
        own / "runs",
        reference,
        chosen={run.record.id for run in ours},
        without={
            run.record.id
            for run in Results(reference).runs
            if run.overrides or (run.outdated and _asked(run) in made)
        },
    )
    for name in sorted({one.record.name for one in results.measurements}):
        for place, found in with_places(results, name):
            scene = found.record.config.get("scene", {}).get("_target_")
            if place and scene != MEASURED_LIGHT:
                continue
            target = reference / "measured" / f"{name}{'_fibre' if place else ''}"
            shutil.rmtree(target, ignore_errors=True)
            shutil.copytree(found.folder, target, ignore=shutil.ignore_patterns(".*"))
    if steps := reproduce.read(reference) | reproduce.read(own):
        write_atomically(reference / reproduce.FILE, to_csv(list(steps.values())))


def _asked(run: Run) -> tuple[str, str, Any, Any]:
    """Scene, model, and how many training samples and pixels."""
    config = run.record.config
    return run.scene, run.model, config["split"]["n_train"], config["data"]["pixels"]


def outdated(results: Results) -> dict[str, list[str]]:
    """Files that have changed without a reason to stand → names of the records they made."""
    reasons = report.stands()
    found: dict[str, list[str]] = {}
    made = [(run.record.id, run.outdated) for run in results.runs]
    made += [(one.record.name, one.outdated) for one in results.measurements]
    for name, files in made:
        for file in files:
            if file not in reasons:
                found.setdefault(file, []).append(name)
    return found


def fill(text: str, contents: dict[str, Callable[[], str]]) -> str:
    """Replace the content of every marked block.

    Raises:
        ValueError: for a block that has no source.
    """

    def content(match: re.Match[str]) -> str:
        begin, name, end = match.groups()
        if name not in contents:
            raise ValueError(f"README.md: expected a block among {list(contents)}, found {name!r}")
        return f"{begin}{contents[name]()}\n{end}"

    return _BLOCK.sub(content, text)


def blocks() -> dict[str, Callable[[], str]]:
    """What each marked block of README.md is made from."""
    return {"claims": _claims, "table1": lambda: _table("table1"), "reproduction": _reproduction}


def _claims() -> str:
    """The paper's claims and what holds of each."""
    path = REFERENCE / "tables" / "claims.csv"
    if not path.exists():
        return "*missing: no claim was measured*"
    lines = ["| the paper says | what holds |", "|---|---|"]
    with path.open(encoding="utf-8", newline="") as file:
        for row in csv.DictReader(file):
            claim, paper, verdict = (markdown_text(row[k]) for k in ("claim", "paper", "verdict"))
            lines.append(f"| **{claim}**: {paper} | {verdict} |")
    return "\n".join(lines)


def _table(name: str) -> str:
    path = REFERENCE / "tables" / f"{name}.md"
    if not path.exists():
        return f"*missing: {path.parent.name}/{path.name} has not been made*"
    return path.read_text(encoding="utf-8").strip()


def _reproduction() -> str:
    """What the steps took, added up, and the two that needed most memory."""
    rows = list(reproduce.read(REFERENCE).values())
    lines = ["| command | steps | time | most memory |", "|---|---:|---:|---|"]
    commands = {
        "table1": "make table1",
        "full": "make reproduce",
        "quick": "make reproduce QUICK=1",
    }
    for mode, command in commands.items():
        done = [row for row in rows if row["mode"] == mode and row["status"] == "finished"]
        if done:
            most = sorted(done, key=lambda row: -int(row["peak_bytes"]))[:2]
            memory = ", ".join(f"{int(x['peak_bytes']) / 1e9:.2f} GB ({x['step']})" for x in most)
            time = reproduce.span(sum(float(row["seconds"]) for row in done))
            steps = len(reproduce.steps(mode))
            of = f" of {steps}" * (len(done) < steps)
            lines.append(f"| `{command}` | {len(done)}{of} | {time} | {memory} |")
    return "\n".join(lines) if len(lines) > 2 else "*missing: no whole reproduction was timed*"


if __name__ == "__main__":
    sys.exit(main())
