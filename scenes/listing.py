"""The public data sets: which are present, and one script that downloads the others.

``python -m scenes.measured`` prints both. ``python -m scenes.measured NAME …`` reads the named ones
and prints commit, digest, licence and citation of each.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from hydra.errors import InstantiationException
from hydra.utils import get_object
from omegaconf import OmegaConf
from rich.console import Console
from rich.table import Table

from scenes.export import config_of, scene_of
from scenes.fibre import PRESSED, FibreScene
from scenes.source import DATA, Source

CONFIGS = Path(__file__).resolve().parents[1] / "configs" / "scene"
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
    return "_target_" in scene and get_object(scene._target_) is FibreScene


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
    table = Table(padding=(0, 0, 0, 1))
    for heading in ("Recording", "Present"):
        table.add_column(heading, no_wrap=True)
    for heading in ("Frames", "Pixels", "Classes", "Split", "Sessions", "Groups"):
        table.add_column(heading)
    table.add_column("Licence")
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
        return "unreadable", *[""] * 6  # details say what was found
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


def details(name: str) -> str:
    """Contents and source of a data set, or how to get it."""
    try:
        scene = scene_of([f"scene={name}"])
    except InstantiationException as error:
        return f"{name}: {error.__cause__}"
    counts = ", ".join(map(str, np.bincount(scene.labels)))
    source = scene.source
    return (
        f"{name}: {len(scene)} frames {scene.shape}, {scene.origin}; per class: {counts}\n"
        f"  github.com/{source.repository} @ {source.commit}\n"
        f"  sha256 {scene.sha256}\n"
        f"  licence: {source.licence}; {source.cite}"
    )


def show(names: Sequence[str]) -> None:
    """Print the details of the named data sets, or the overview of all."""
    known = public_names()
    for name in names:
        if name not in known:
            sys.exit(f"error: expected names among {', '.join(known)}, found {name}")
        print(details(name))
    if names:
        return
    table, commands = overview(known)
    Console().print(table)
    if not commands:
        return
    print("This script gets the missing recordings:\n")
    if DATA not in os.environ:
        print(f"export {DATA}=~/measured")
    print("\n".join(commands))
