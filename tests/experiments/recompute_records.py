"""Records of a folder of results, read by json alone."""

from __future__ import annotations

import json
from pathlib import Path

ROOT = Path(__file__).parents[2]


def runs_of(folder: Path) -> list[dict]:
    """Every training that finished, in the order in which they ended; its last row are its
    ``results``."""
    lines = (folder / "records.jsonl").read_text("utf-8").splitlines()
    runs = []
    for record in map(json.loads, lines):
        if "model" in record and record.get("status", "finished") == "finished":
            columns, values = record["rows"]["columns"], record["rows"]["values"]
            rows = [dict(zip(columns, row)) for row in values]  # noqa: B905  (trimmed)
            runs.append(record | {"results": rows.pop(), "curve": rows})
    return runs
