"""A scene once for each seed, for measurements over several: the frames that runs see, too."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import hydra
from rich.console import Console
from rich.progress import Progress

from experiments import data, record
from scenes.frames import Scene


def at_seed(scene: Any, seed: int) -> Any:
    """The configuration of a scene with every ``seed`` in it set, as ``seed.run`` sets them."""
    if isinstance(scene, Mapping):
        return {k: seed if k == "seed" else at_seed(v, seed) for k, v in scene.items()}
    return [at_seed(part, seed) for part in scene] if isinstance(scene, list | tuple) else scene


def scenes(
    config: Mapping[str, Any], seeds: Sequence[int], cache: bool, console: Console
) -> Iterator[tuple[int, Scene]]:
    """(seed, scene) for each seed.

    Args:
        config: of the scene, resolved.
        seeds: of sensor and samples.
        cache: keep the frames in ``cache/`` of the results folder, where runs find them.
        console: shows the progress of making frames.
    """
    for seed in seeds:
        scene: Scene = hydra.utils.instantiate(at_seed(config, seed), _convert_="all")
        yield seed, _cached(scene, console) if cache else scene


def _cached(scene: Scene, console: Console) -> Scene:
    folder = record.results_dir() / "cache"
    with Progress(console=console, transient=True, disable=not console.is_terminal) as bars:
        bar = bars.add_task("make frames", total=len(scene.labels))
        return data.cached(scene, folder, lambda done, _: bars.update(bar, completed=done))
