"""Records of a folder of results, read by json alone."""

from __future__ import annotations

import base64
import json
import zlib
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import yaml

ROOT = Path(__file__).parents[2]
SCENES = ROOT / "configs" / "scene"


class Folder:
    """A folder of results, and what the files of its scenes say.

    Attributes:
        named: folders that the row names, which come first where a scene was measured twice.
    """

    def __init__(self, path: Path):
        self.path, self.named = path, ""
        self.known: dict[str, list] = {}

    def measured(self, name: str) -> list[tuple[dict, list[dict]]]:
        """Record and rows of the measurement of each scene."""
        if name not in self.known:
            self.known[name] = list(self._read(name))
        by_scene: dict[str, tuple[dict, list[dict]]] = {}
        for place, record, rows in self.known[name]:
            scene = record.get("scene", "")
            if scene not in by_scene or place in self.named.split("; "):
                by_scene[scene] = record, rows
        return list(by_scene.values())

    def runs(self) -> list[dict]:
        """Every run that finished."""
        if "runs" not in self.known:
            lines = (self.path / "records.jsonl").read_text("utf-8").splitlines()
            records = map(json.loads, lines)
            self.known["runs"] = [r for r in records if r["type"] == "run"]
        return self.known["runs"]

    def _read(self, name: str) -> Iterator[tuple[str, dict, list[dict]]]:
        for line in (self.path / "records.jsonl").read_text("utf-8").splitlines():
            record = json.loads(line)
            if record["type"] == "measurement" and record["name"] == name:
                table = record["rows"]
                rows = [
                    dict(zip(table["columns"], values, strict=True))
                    for values in table["values"]
                ]
                yield record["id"], record, rows


def shown(scene: str) -> dict:
    """Laboratory and kind of a scene, by its file and those that it extends."""
    tree = yaml.safe_load((SCENES / f"{scene}.yaml").read_text("utf-8"))
    found = {}
    for parent in tree.get("defaults", []):
        if parent.endswith("@_here_"):
            found |= shown(parent.partition("@")[0])
    return found | tree.get("scene_display", {})


def labels(text: str) -> np.ndarray:
    """Packed labels: kind of integer, then compressed bytes in base 64."""
    kind, _, packed = text.partition(":")
    data = zlib.decompress(base64.b64decode(packed))
    return np.frombuffer(data, {"u1": "|u1", "u2": "<u2", "i4": "<i4"}[kind])


def shares(rows: list[dict]) -> dict[tuple, float]:
    """Share of right answers by (model, n, seed, draw), by the split that counts."""
    truths = {}
    for row in rows:
        if row.get("labels"):
            truths[row["seed"], row["split"], row["draw"]] = labels(row["labels"])
    found = {}
    for row in rows:
        if row["split"] != "counts":
            continue
        right = row.get("right")
        if right is None:
            truth = truths[row["seed"], row["split"], row["draw"]]
            right = [(labels(text) == truth).sum() for text in row["predicted"]]
        for n, count in zip(row["n"], right, strict=True):
            place = row["model"], n, row["seed"], row["draw"]
            found[place] = float(count) / row["n_test"]
    return found
