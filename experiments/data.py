"""From a scene to the frames a run trains and tests on: split, memory, disk cache."""

from __future__ import annotations

import hashlib
import math
import os
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import Tensor

from experiments.clock import Clock
from scenes.frames import Scene
from scenes.split import KINDS, by_session, learning_curve_subsets, split

IN_MEMORY_BYTES = 512 * 2**20  # more frames than this are read while the model asks for them
_BATCH = 16


class LazyFrames:
    """Frames of a scene that are made, or read, when a model asks; the clock is held meanwhile.

    Args:
        scene: where they come from.
        indices: which samples, int64 [N].
        clock: held while frames are acquired.
    """

    def __init__(self, scene: Scene, indices: np.ndarray, clock: Clock):
        self.scene, self.indices, self.clock = scene, indices, clock
        self.shape = (len(indices), *scene.shape)

    def __len__(self) -> int:
        return len(self.indices)

    def __getitem__(self, index: Any) -> Tensor:
        with self.clock.held():
            chosen = self.indices[index.numpy(force=True) if isinstance(index, Tensor) else index]
            frames = self.scene.frames(np.atleast_1d(chosen))
            return frames if np.ndim(chosen) else frames[0]


class CachedScene:
    """A scene whose frames lie in one file on disk.

    Args:
        scene: the scene they were made from.
        path: uint8 or uint16 .npy [N, H, W].

    Raises:
        ValueError: naming the file, if it is not that.
    """

    def __init__(self, scene: Scene, path: Path):
        self.classes, self.labels, self.shape = scene.classes, scene.labels, scene.shape
        self.samples, self.origin, self._scene = scene.samples, scene.origin, scene
        expected = f"{path}: expected {len(self)} frames {self.shape} (remove it to make it anew)"
        try:
            header = np.load(path, mmap_mode="r", allow_pickle=False)
        except (ValueError, EOFError) as error:
            raise ValueError(f"{expected}, found: {error}") from error
        if header.shape != (len(self), *self.shape):
            raise ValueError(f"{expected}, found shape {header.shape}")
        self._path, self._dtype, self._start = path, header.dtype, header.offset

    def __len__(self) -> int:
        return len(self.labels)

    def fingerprint(self) -> str:
        return self._scene.fingerprint()

    def frames(self, indices: Any) -> Tensor:
        """Read, not mapped: the pages of a map count as memory of the process once seen."""
        wanted = np.arange(len(self))[np.asarray(indices)]
        frames = np.empty((len(wanted), *self.shape), self._dtype)
        with self._path.open("rb") as file:
            for frame, index in zip(frames, wanted.tolist(), strict=True):
                file.seek(self._start + index * frame.nbytes)
                if file.readinto(frame.data) != frame.nbytes:
                    raise ValueError(f"{self._path}: expected {len(self)} frames, found it cut off")
        return torch.from_numpy(frames)


def cached(scene: Scene, folder: Path, progress: Callable[[int, int], None]) -> Scene:
    """The scene with its frames on disk, made there first if need be, whole or not at all.

    Recorded scenes stay as they are: their frames lie on disk already.

    Args:
        scene: any scene.
        folder: of the cache; a file is named after the scene's fingerprint.
        progress: called with (frames made, frames in all).
    """
    if scene.origin == "recorded":
        return scene
    path = folder / f"{scene.fingerprint()[:24]}.npy"
    if not path.exists():
        folder.mkdir(parents=True, exist_ok=True)
        n = len(scene.labels)
        handle, temporary = tempfile.mkstemp(dir=folder, suffix=".partial")
        try:
            # Written, not mapped: a full disk is then an error and not a signal.
            with os.fdopen(handle, "wb") as file:
                for start in range(0, n, _BATCH):
                    stop = min(n, start + _BATCH)
                    frames = scene.frames(np.arange(start, stop)).numpy(force=True)
                    if start == 0:
                        header = np.lib.format.header_data_from_array_1_0(frames)
                        header |= {"shape": (n, *scene.shape), "fortran_order": False}
                        np.lib.format.write_array_header_1_0(file, header)
                    file.write(np.ascontiguousarray(frames).data)
                    progress(stop, n)
                file.flush()
                os.fsync(file.fileno())
            os.chmod(temporary, 0o644)
            os.replace(temporary, path)
        except BaseException:
            Path(temporary).unlink(missing_ok=True)
            raise
    return CachedScene(scene, path)


class PixelSubset:
    """A scene of which D pixels are seen, in one row; a smaller D sees some of a larger one's.

    Args:
        scene: any scene.
        pixels: D.
        seed: of the choice.

    Raises:
        ValueError: if the frames have fewer pixels.
    """

    def __init__(self, scene: Scene, pixels: int, seed: int):
        all_pixels = math.prod(scene.shape)
        if isinstance(pixels, bool) or not isinstance(pixels, int) or not 2 <= pixels <= all_pixels:
            raise ValueError(
                f"data.pixels: expected an integer in [2, {all_pixels}], found {pixels!r}"
            )
        self.classes, self.labels, self.samples = scene.classes, scene.labels, scene.samples
        self.origin, self.shape, self._scene = scene.origin, (1, pixels), scene
        self._chosen = np.sort(np.random.default_rng(seed).permutation(all_pixels)[:pixels])

    def __len__(self) -> int:
        return len(self.labels)

    def fingerprint(self) -> str:
        digest = hashlib.sha256(self._scene.fingerprint().encode() + self._chosen.tobytes())
        return digest.hexdigest()

    def frames(self, indices: Any) -> Tensor:
        pixels = self._scene.frames(indices).flatten(1)
        return pixels[:, torch.from_numpy(self._chosen)].unsqueeze(1)


def choose(scene: Scene, cfg: Any, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Training and test indices as the ``split`` part of the config says.

    Raises:
        ValueError: naming the key of a value that does not fit.
    """
    # A scene of several sessions trains and tests within the first, unless the split crosses them.
    session = scene.samples.get("session", np.zeros(len(scene.labels), np.int64))
    if cfg["kind"] not in (*KINDS, "session"):
        expected = ", ".join((*KINDS, "session"))
        raise ValueError(f"split.kind: expected one of {expected}, found {cfg['kind']!r}")
    if cfg["kind"] == "session":
        first, test = by_session(session, *np.unique(session)[[0, -1]].tolist())
        train, _ = split(scene.labels[first], test_fraction=cfg["test_fraction"], seed=seed)
        train = first[train]
    else:
        first = np.flatnonzero(session == session.min())
        train, test = (
            first[part]
            for part in split(
                scene.labels[first],
                test_fraction=cfg["test_fraction"],
                kind=cfg["kind"],
                seed=seed,
                order=scene.samples["order"][first],
            )
        )
    if cfg["n_train"] is not None:
        n = cfg["n_train"]
        try:
            train = learning_curve_subsets(train, scene.labels, [n], seed)[n]
        except ValueError as error:
            raise ValueError(str(error).replace("split.sizes", "split.n_train")) from error
    return train, test


def take(scene: Scene, indices: np.ndarray, clock: Clock) -> Tensor | LazyFrames:
    """The frames of these samples: in memory if they fit, else made when asked for."""
    one = scene.frames(indices[:1])
    if one.nbytes * len(indices) > IN_MEMORY_BYTES:
        return LazyFrames(scene, indices, clock)
    frames = torch.empty(len(indices), *scene.shape, dtype=one.dtype)
    for start in range(0, len(indices), _BATCH):
        frames[start : start + _BATCH] = scene.frames(indices[start : start + _BATCH]).cpu()
    return frames


def digest(frames: Tensor | LazyFrames, labels: np.ndarray) -> str:
    """SHA-256 of frames and labels in their order."""
    state = hashlib.sha256(np.ascontiguousarray(labels, dtype="<i8").data)
    for start in range(0, len(frames), _BATCH):
        state.update(frames[start : start + _BATCH].contiguous().numpy(force=True).data)
    return state.hexdigest()
