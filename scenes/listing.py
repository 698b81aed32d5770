"""The public data sets: which are present, and one script that downloads the others.

``python -m scenes.measured`` prints both. Commit, digest, licence and citation of a data set are in
its file of configs/scene.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from hydra.errors import InstantiationException
from omegaconf import OmegaConf
from rich.console import Console
from rich.table import Table

from scenes.composed import config_of, scene_of
from scenes.fibre import PRESSED
from scenes.source import DATA, Source

CONFIGS = Path(__file__).resolve().parents[1] / "configs" / "scene"
HEADINGS = (
    *("Recording", "Present", "Frames", "Pixels", "Classes"),
    *("Split", "Sessions", "Groups", "Licence"),
)
SPLITS = {"random": "random", "ordered": "in time", "session": "in time"}
"""Kinds of splits in the words of TabArena; the others are "grouped"."""


def public_names() -> list[str]:
    """Names of configs/scene whose frames lie in a public repository."""
    return [file.stem for file in sorted(CONFIGS.glob("*.yaml")) if _is_public(file)]


def _is_public(file: Path) -> bool:
    """Whether a config itself names a repository; one that builds on another config does not."""
    scene = OmegaConf.select(OmegaConf.load(file), "scene", default={})
    return "source" in scene or _is_fibre(scene)


def _is_fibre(scene: Any) -> bool:
    return scene.get("_target_") == "scenes.fibre.FibreScene"


def sources(scene: Any) -> list[Source]:
    """The repositories that the config of a public scene reads, one or two."""
    found = []
    if _is_fibre(scene):
        found.append(PRESSED)
    if scene.get("source"):
        found.append(Source(**scene.source))
    return found


def overview(names: Sequence[str]) -> tuple[Table, list[str]]:
    """A table of these data sets, and the commands that download the missing repositories."""
    table = Table(*HEADINGS, padding=(0, 0, 0, 1))
    table.columns[0].no_wrap = table.columns[1].no_wrap = True
    commands: dict[str, None] = {}  # in order, each once
    for name in names:
        config = config_of([f"scene={name}"])
        wanted = sources(config.scene)
        absent = [source for source in wanted if source.find() is None]
        licences = ", ".join(source.licence for source in wanted)
        if absent:
            table.add_row(name, "no", *[""] * 6, licences)
        else:
            table.add_row(name, *_present(name, config.split), licences)
        commands |= dict.fromkeys(source.command() for source in absent)
    return table, list(commands)


def _present(name: str, split: Any) -> tuple[str, ...]:
    """Whether the files can be read; number and shape of the frames; classes; how they are split;
    and numbers of sessions and groups, where they are known."""
    try:
        scene = scene_of([f"scene={name}"])
    except InstantiationException:
        return "unreadable", *[""] * 6
    height, width = scene.shape
    return (
        "yes",
        str(len(scene)),
        f"{height} × {width}",
        str(len(scene.classes)),
        SPLITS.get(split.kind, "grouped"),
        _count(scene, "session"),
        _count(scene, split.group or "group"),
    )


def _count(scene: Any, name: str) -> str:
    """Number of sessions, or of pairs of a class and a group; empty where unknown."""
    if name not in scene.samples:
        return ""
    of = scene.labels if name != "session" else np.zeros_like(scene.labels)
    return str(len(set(zip(of.tolist(), scene.samples[name].tolist(), strict=True))))


def show() -> None:
    """Print the table, and the script where a recording is missing."""
    table, commands = overview(public_names())
    Console().print(table)
    if not commands:
        return
    print("This script gets the missing recordings:\n")
    if DATA not in os.environ:
        print(f"export {DATA}=~/measured")
    print("\n".join(commands))
