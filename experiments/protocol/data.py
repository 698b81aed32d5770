"""From a config to a scene, and on to the frames of a run: pixels, memory, disk cache."""

from __future__ import annotations

import hashlib
import math
import os
import platform
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import torch
from filelock import FileLock
from rich.console import Console
from torch import Tensor

from experiments.protocol.clock import Clock
from experiments.protocol.model import instantiate
from experiments.records import revision
from experiments.records.configs import SEEDS
from experiments.records.console import say
from experiments.records.environment import changes
from experiments.records.files import results_dir
from scenes.frames import Scene

# More frames than this are read while the model asks for them.
IN_MEMORY_BYTES = 512 * 2**20
_BATCH = 16


def at_seed(config: Any, seed: int) -> Any:
    """The resolved config of a scene with every seed in it set, as ``seed.run`` sets them."""
    if isinstance(config, Mapping):
        return {k: seed if k in SEEDS else at_seed(v, seed) for k, v in config.items()}
    if isinstance(config, list | tuple):
        return [at_seed(part, seed) for part in config]
    return config


def scene_at(
    config: Mapping[str, Any],
    seed: int,
    cache: bool,
    console: Console,
) -> Scene:
    """The scene of a resolved config at a seed of sensor and samples, cached where asked for."""
    scene: Scene = instantiate(at_seed(config, seed), "scene")
    return cached(scene, config, console) if cache else scene


class LazyFrames:
    """Frames of a scene that are made, or read, when a model asks; the clock is held meanwhile.

    Args:
        scene: where they come from.
        indices: which samples, int64 [N].
        clock: held while frames are acquired.
    """

    def __init__(
        self,
        scene: Scene,
        indices: np.ndarray,
        clock: Clock,
    ):
        self.scene, self.indices, self.clock = scene, indices, clock
        self.shape = (len(indices), *scene.shape)

    def __len__(self) -> int:
        return len(self.indices)

    def __getitem__(self, index: Any) -> Tensor:
        with self.clock.held():
            if isinstance(index, Tensor):
                index = index.numpy(force=True)
            chosen = self.indices[index]
            frames = self.scene.frames(np.atleast_1d(chosen))
            if np.ndim(chosen) == 0:
                return frames[0]
            return frames


class DerivedScene:
    """A scene with the samples of another one, whose frames are had in another way.

    Args:
        scene: has the samples.
        frames: gives the frames of samples by their indices.
        shape: of a frame; None for that of the scene.
    """

    def __init__(
        self,
        scene: Scene,
        frames: Callable[[Any], Tensor],
        shape: tuple[int, int] | None = None,
    ):
        self.classes, self.labels = scene.classes, scene.labels
        self.samples, self.origin = scene.samples, scene.origin
        self.shape = shape or scene.shape
        self.frames, self.fingerprint = frames, scene.fingerprint


def cached(scene: Scene, config: Any, console: Console) -> Scene:
    """The scene with its frames in a file, made there first if need be, whole or not at all.

    Recorded and measured scenes stay as they are. A file is named after the scene's fingerprint and
    the revisions of its parts, changes of the scenes that are in no commit, the libraries and the
    kind of processor.

    Args:
        scene: where the frames come from.
        config: of the scene; a fingerprint says nothing of the code of its parts.
        console: says what is kept.

    Raises:
        OSError: naming the file, if it cannot be written.
    """
    if scene.origin == "recorded" or not getattr(scene, "cacheable", True):
        return scene
    code = [revision.revisions(config), changes("scenes")]
    versions = [torch.__version__, np.__version__, platform.machine()]
    parts = [scene.fingerprint(), code, versions]
    folder = results_dir() / "cache"
    path = folder / f"{hashlib.sha256(repr(parts).encode()).hexdigest()[:24]}.npy"
    folder.mkdir(parents=True, exist_ok=True)
    with FileLock(path.with_suffix(".lock")):  # made by one process; others wait for it
        if not path.exists():
            try:
                _make(scene, path)
            except OSError as error:
                raise OSError(error.errno, error.strerror, str(path)) from error
            size = path.stat().st_size / 1e6
            text = f"kept {size:.0f} MB of frames in {folder} (cache=false keeps none)"
            say(console, text, "dim")

    def read(indices: Any) -> Tensor:
        # From a map that is closed again: its pages count as memory of the process.
        mapped = np.load(path, mmap_mode="r", allow_pickle=False)
        return torch.from_numpy(mapped[np.asarray(indices, dtype=np.int64)])

    return DerivedScene(scene, read)


def _make(scene: Scene, path: Path) -> None:
    """Write all frames; what a killed process left is overwritten."""
    n, partial = len(scene.labels), path.with_suffix(".partial")
    try:
        # Written, not mapped: a full disk is then an error and not a signal.
        with partial.open("wb") as file:
            for start in range(0, n, _BATCH):
                frames = scene.frames(np.arange(start, min(n, start + _BATCH)))
                pixels = frames.contiguous().numpy(force=True)
                if start == 0:
                    header = np.lib.format.header_data_from_array_1_0(pixels)
                    header["shape"] = n, *scene.shape
                    np.lib.format.write_array_header_1_0(file, header)
                file.write(pixels.data)
            file.flush()
            os.fsync(file.fileno())
        partial.replace(path)
    finally:
        partial.unlink(missing_ok=True)


def pixel_subset(scene: Scene, pixels: int, seed: int) -> Scene:
    """A scene of which D pixels are seen, in one row; a smaller D sees some of a larger one's.

    Raises:
        ValueError: if the frames have fewer pixels.
    """
    every = math.prod(scene.shape)
    if type(pixels) is not int or not 2 <= pixels <= every:
        expected = f"an integer in [2, {every}]"
        raise ValueError(f"data.pixels: expected {expected}, found {pixels!r}")
    in_random_order = np.random.default_rng(seed).permutation(every)
    chosen = torch.from_numpy(np.sort(in_random_order[:pixels]))

    def seen(indices: Any) -> Tensor:
        return scene.frames(indices).flatten(1)[:, chosen].unsqueeze(1)

    return DerivedScene(scene, seen, (1, pixels))


def take(
    scene: Scene,
    indices: np.ndarray,
    clock: Clock,
) -> Tensor | LazyFrames:
    """The frames of these samples: in memory if they fit, else made when asked for."""
    first = scene.frames(indices[:1])
    if first.nbytes * len(indices) > IN_MEMORY_BYTES:
        return LazyFrames(scene, indices, clock)
    frames = torch.empty(len(indices), *scene.shape, dtype=first.dtype)
    for start in range(0, len(indices), _BATCH):
        part = slice(start, start + _BATCH)
        frames[part] = scene.frames(indices[part])
    return frames


def fitting(frames: Tensor | LazyFrames) -> int:
    """How many of these frames are held in memory at most."""
    return max(1, IN_MEMORY_BYTES // max(1, frames[:1].nbytes))


def digest(frames: Tensor | LazyFrames, labels: np.ndarray) -> str:
    """SHA-256 of frames and labels in their order."""
    state = hashlib.sha256(np.ascontiguousarray(labels, dtype="<i8").data)
    for start in range(0, len(frames), _BATCH):
        part = frames[start : start + _BATCH].contiguous()
        state.update(part.numpy(force=True).data)
    return state.hexdigest()
