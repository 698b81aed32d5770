"""Fill the marked tables of README.md from committed results: ``python -m experiments.readme``.

A block between ``<!-- begin NAME -->`` and ``<!-- end NAME -->`` is made from the file that NAME
stands for; a result that is missing shows as missing.
"""

from __future__ import annotations

import csv
import re
from collections.abc import Callable
from pathlib import Path

from experiments import reproduce
from experiments.benchmark_results import markdown_table
from experiments.record import ROOT, results_dir, write_atomically

_BLOCK = re.compile(r"(<!-- begin (\w+) -->\n).*?(<!-- end \2 -->)", re.DOTALL)


def fill(text: str, blocks: dict[str, Callable[[], str]]) -> str:
    """Replace the content of every marked block.

    Raises:
        ValueError: for a block that has no source.
    """

    def content(match: re.Match[str]) -> str:
        begin, name, end = match.groups()
        if name not in blocks:
            raise ValueError(f"README.md: expected a block among {list(blocks)}, found {name!r}")
        return f"{begin}{blocks[name]()}\n{end}"

    return _BLOCK.sub(content, text)


def sources(results: Path) -> dict[str, Callable[[], str]]:
    """What each block is made from."""
    return {
        "table1": lambda: _read(results / "tables" / "table1.md"),
        "comparison": lambda: _read(results / "tables" / "comparison.md"),
        "calibration": lambda: _calibration(results / "calibration.csv"),
        "benchmark": lambda: _benchmark(results / "benchmark.csv"),
        "reproduction": lambda: _reproduction(results),
    }


def _read(path: Path) -> str:
    return path.read_text(encoding="utf-8").strip() if path.exists() else _missing(path)


def _benchmark(path: Path) -> str:
    return markdown_table(path).strip() if path.exists() else _missing(path)


def _reproduction(results: Path) -> str:
    """What the steps took, added up, and the two that needed most memory."""
    rows = reproduce.read(results)
    if not rows:
        return _missing(results / "tables" / "reproduce.csv")
    table = ["| command | steps | time | most memory |", "|---|---:|---:|---|"]
    for mode, command in (("full", "make reproduce"), ("quick", "make reproduce QUICK=1")):
        chosen = [row for (_, m), row in rows.items() if m == mode]
        steps = [row for row in chosen if row["status"] == "finished"]
        if steps:
            seconds = sum(float(row["seconds"]) for row in steps)
            parts = [
                f", and part of {row['step']} ({reproduce.span(float(row['seconds']))})"
                for row in chosen
                if row["status"] == reproduce.INTERRUPTED
            ]
            most = sorted(steps, key=lambda row: -int(row["peak_bytes"]))[:2]
            memory = ", ".join(f"{int(x['peak_bytes']) / 1e9:.2f} GB ({x['step']})" for x in most)
            count, time = f"{len(steps)}{''.join(parts)}", reproduce.span(seconds)
            table.append(f"| `{command}` | {count} | {time} | {memory} |")
    return "\n".join(table)


def _calibration(path: Path) -> str:
    """The rows that something was expected of; the file has the others and the single values."""
    if not path.exists():
        return _missing(path)
    with path.open(encoding="utf-8", newline="") as file:
        rows = [row for row in csv.DictReader(file) if row["expected"]]
    columns = ["quantity", "paper", "ours", "sd", "seeds", "status", "expected", "met", "note"]
    cells = [columns, ["---"] * len(columns), *([row[key] for key in columns] for row in rows)]
    return "\n".join("| " + " | ".join(line) + " |" for line in cells)


def _missing(path: Path) -> str:
    return f"*missing: {path.parent.name}/{path.name} has not been made*"


if __name__ == "__main__":
    readme = ROOT / "README.md"
    write_atomically(readme, fill(readme.read_text(encoding="utf-8"), sources(results_dir())))
