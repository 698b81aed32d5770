"""Records of a folder of results, read by json alone."""

from __future__ import annotations

import json
from pathlib import Path

ROOT = Path(__file__).parents[2]


def runs_of(folder: Path) -> list[dict]:
    """Every training that finished, in the order in which they ended."""
    lines = (folder / "records.jsonl").read_text("utf-8").splitlines()
    return [record for record in map(json.loads, lines) if record["type"] == "run"]
