"""Public data sets of optical sensors as scenes; ``python -m scenes.measured`` lists them.

A data set is a YAML file of a dozen lines, such as configs/scene/gelsight.yaml. Frames are read
from a checkout (:mod:`scenes.source`) and never copied, because most repositories state no licence.
"""

from __future__ import annotations

import copy
import hashlib
import posixpath
from collections.abc import Iterator, Mapping, Sequence
from functools import lru_cache
from typing import Any

import numpy as np
import torch
from torch import Tensor

from hdc import readers
from scenes.frames import Indices, level_classes, row_numbers
from scenes.source import PublicScene, Source
from scenes.validate import require

MEMORY_BYTES = 2**30  # decoded frames are kept up to this size


class MeasuredScene(PublicScene):
    """Frames that a camera took, in folders of a public repository.

    Args:
        source: the repository, arguments of :class:`scenes.source.Source`.
        template, table, image_column, subsample: see :func:`hdc.readers.open_recording`.
        folders: folders of the repository. Where there are two or more, each is a session.
        values: continuous quantities, a mapping each: ``name``, ``unit`` and the ``column`` of the
            table.
        levels: classes where there are no labels: the name of a ``value`` and the upper ``edges``
            of its classes.
        unknown: labels of frames that belong to no class.
        damaged: files that are damaged in their repository; they are left out.
        rename: new names of labels, such as where a class is spelled in two ways.

    Attributes:
        unknown: the scene of the frames that belong to no class, or None. It has indices of its
            own, so no split can train on them.
        others: see :class:`scenes.source.PublicScene`.

    Raises:
        FileNotFoundError: the repository is not there; the message says how to get it.
        ValueError: its files do not have the digest ``source.sha256``, or a setting does not fit.
    """

    def __init__(
        self,
        source: Mapping[str, Any],
        template: str | None = None,
        table: str | None = None,
        image_column: str = "image",
        folders: Sequence[str] = (".",),
        values: Sequence[Mapping[str, Any]] = (),
        levels: Mapping[str, Any] | None = None,
        unknown: Sequence[str] = (),
        subsample: int = 1,
        rename: Mapping[str, str] | None = None,
        damaged: Sequence[str] = (),
    ) -> None:
        self.source = Source(**source)
        root = self.source.folder()
        try:
            self._parts = [
                readers.open_recording(
                    root / folder,
                    template=template,
                    table=table,
                    image_column=image_column,
                    value_columns=[value["column"] for value in values],
                    window=readers.Window(None, subsample),
                    check=False,  # the digest says whether they are the files that were looked at
                    fewest_classes=1,
                )
                for folder in folders
            ]
        except readers.SettingError as error:
            raise ValueError(f"scene.{error}") from error
        self.shape = self._parts[0].frame_shape
        files = []
        for folder, part in zip(folders, self._parts, strict=True):
            names = part.samples["file"].tolist()
            files += [posixpath.normpath(f"{folder}/{name}") for name in names]
        tables = [
            posixpath.normpath(f"{folder}/{table}") for folder in folders if table
        ]
        self.sha256 = self.source.check(root, [*files, *tables])
        for name in damaged:
            expected = "a file of a frame of this recording"
            require(name in files, "scene.damaged", name, expected)
        self._settings = (self.sha256, subsample)
        self._decoded = _decoded(*self._settings)
        self.samples: Mapping[str, np.ndarray] = _samples(self._parts)
        self.value_names = tuple(value["name"] for value in values)
        self.units = tuple(value["unit"] for value in values)
        names = _labels(self._parts, rename or {})
        self.values = _values(self._parts)
        if levels is None:
            found = set(names.tolist())
            classes = tuple(sorted(found, key=readers.natural_key))
        else:
            classes, names = self._levels(levels)
        expected = "edges of a value: no image has a label"
        require(len(classes) > 0, "scene.levels", levels, expected)
        whole = ~np.isin(files, list(damaged))
        apart = np.isin(names, list(unknown))
        self.unknown: MeasuredScene | None = None
        if apart.any():
            self.unknown = copy.copy(self)
            self.unknown._keep(apart & whole, names, classes)
        self._keep(~apart & whole, names, classes)

    def _levels(self, levels: Mapping[str, Any]) -> tuple[tuple[str, ...], np.ndarray]:
        """Names of the classes [L] of a value, and the class name of each frame [N]."""
        names, name = self.value_names, levels["value"]
        expected = f"a name in scene.values ({', '.join(names)})"
        require(name in names, "scene.levels.value", name, expected)
        k = names.index(name)
        value, edges = self.values[:, k], levels["edges"]
        classes, labels = level_classes(value, edges, self.units[k])
        expected = f"a last edge of {value.max():g} or more"
        all_below = labels.max() < len(classes)
        require(all_below, "scene.levels.edges", edges, expected)
        return classes, np.array(classes)[labels]

    def _keep(
        self,
        chosen: np.ndarray,
        names: np.ndarray,
        classes: tuple[str, ...],
    ) -> None:
        """Keep some of the frames; names [N] of the classes of all."""
        self._rows = np.flatnonzero(chosen)
        kept = names[chosen]
        self.classes = tuple(name for name in classes if name in kept)
        labels = [self.classes.index(name) for name in kept]
        self.labels = np.array(labels)
        self.samples = {key: column[chosen] for key, column in self.samples.items()}
        self.values = self.values[chosen]

    def frames(self, indices: Indices) -> Tensor:
        """Frames uint8 or uint16 [len(indices), H, W]."""
        rows = self._rows[row_numbers(indices, len(self))].tolist()
        if not rows:
            return torch.empty((0, *self.shape), dtype=torch.uint8)
        missing = [row for row in dict.fromkeys(rows) if row not in self._decoded]
        frames = self._decoded | dict(self._read(missing))
        if len(frames) * frames[rows[0]].nbytes <= MEMORY_BYTES:
            self._decoded.update(frames)
        return torch.from_numpy(np.stack([frames[row] for row in rows]))

    def _read(self, rows: Sequence[int]) -> Iterator[tuple[int, np.ndarray]]:
        """Yield each of these rows with its frame, one folder after the other."""
        first = 0
        for part in self._parts:
            inside = [row for row in rows if first <= row < first + len(part)]
            frames = part.stream([row - first for row in inside])
            yield from zip(inside, frames, strict=True)
            first += len(part)

    def fingerprint(self) -> str:
        """SHA-256 over the files, the pixels kept of them, classes, labels, values and order."""
        settings = repr((self._settings, self.classes, self.value_names))
        digest = hashlib.sha256(settings.encode())
        order = self.samples["order"]
        for array in (self._rows, self.labels, self.values, order):
            digest.update(np.ascontiguousarray(array, dtype="<f8").data)
        return digest.hexdigest()


@lru_cache(maxsize=4)
def _decoded(sha256: str, subsample: int) -> dict[int, np.ndarray]:
    """Frames by row, shared by all scenes of the same files and pixels in this process."""
    return {}


def _samples(parts: Sequence[readers.Recording]) -> dict[str, np.ndarray]:
    """File and place in time of each frame; session and group as far as all parts know them."""
    orders, start = [], 0
    for part in parts:
        orders.append(part.order + start)
        start += part.order.max() + 1
    samples = {"order": np.concatenate(orders)}
    for name in ("file", "group", "session", "session_name"):
        if all(name in part.samples for part in parts):
            columns = [part.samples[name] for part in parts]
            samples[name] = np.concatenate(columns)
    if len(parts) > 1:
        sizes = [len(part) for part in parts]
        samples["session"] = np.repeat(np.arange(len(parts)), sizes)
    return samples


def _labels(
    parts: Sequence[readers.Recording], rename: Mapping[str, str]
) -> np.ndarray:
    """Name of each frame's label [N], or an empty name."""
    names = []
    for part in parts:
        if part.classes:
            names += [rename.get(name, name) for name in part.names]
    return np.array(names)


def _values(parts: Sequence[readers.Recording]) -> np.ndarray:
    """Continuous quantities float64 [N, k] of the columns that were read."""
    read = [
        np.empty((len(part), 0)) if part.values is None else part.values
        for part in parts
    ]
    return np.concatenate(read)


if __name__ == "__main__":
    from scenes.listing import show

    show()
