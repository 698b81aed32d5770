"""Public recordings of optical sensors as scenes; ``python -m scenes.measured`` lists them.

A recording is a YAML of a dozen lines, such as configs/scene/gelsight.yaml. Frames are
read where they lie (:mod:`scenes.source`) and never copied: most repositories state no licence.
"""

from __future__ import annotations

import copy
import hashlib
import posixpath
import re
import sys
from collections.abc import Mapping, Sequence
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import Tensor

from hdc import readers
from scenes.frames import level_classes, row_numbers
from scenes.source import Source
from scenes.validate import require

MEMORY_BYTES = 2**30  # decoded frames are kept up to this size
CONFIGS = Path(__file__).resolve().parents[1] / "configs" / "scene"


class MeasuredScene:
    """Frames that a camera took, in folders of a public repository.

    Args:
        source: the repository, arguments of :class:`scenes.source.Source`.
        template, table, image_column, crop, subsample: see :func:`hdc.readers.open_recording`.
        folders: folders of the repository. Of two or more, each is a session.
        values: continuous quantities, a mapping each: ``name``, ``unit``, and a ``column`` of the
            table or ``labels``, the value of each label.
        levels: classes where there are no labels: the name of a ``value`` and the upper ``edges``
            of its classes.
        unknown: labels of frames that are no class.
        saturated: why accuracies on this recording rank nothing, or null.

    Attributes:
        unknown: the scene of the frames that are no class, or None. It has indices of its own, so
            no split can train on them.
        sha256: digest of the files that are read; others: see :class:`scenes.frames.Scene`.

    Raises:
        FileNotFoundError: the repository is not there; the message says how to get it.
        ValueError: its files are not those of ``source.sha256``, or a setting does not fit.
    """

    origin = "measured"
    cacheable = False

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
        crop: Sequence[int] | None = None,
        subsample: int = 1,
        saturated: str | None = None,
    ) -> None:
        self.source = Source(**source)
        self.saturated = saturated
        root = self.source.folder()
        columns = [value["column"] for value in values if "column" in value]
        try:
            self._parts = [
                readers.open_recording(
                    root / folder,
                    template=template,
                    table=table,
                    image_column=image_column,
                    value_columns=columns,
                    window=readers.Window(crop, subsample),
                    check=False,  # the digest says whether they are the files that were looked at
                    fewest_classes=1,
                )
                for folder in folders
            ]
        except readers.SettingError as error:
            raise ValueError(f"scene.{error}") from error
        self.shape = self._parts[0].shape
        files = [
            posixpath.normpath(f"{folder}/{file}")
            for folder, part in zip(folders, self._parts, strict=True)
            for file in [*part.samples["file"].tolist(), *([table] if table else [])]
        ]
        self.sha256 = self.source.check(root, files)
        self._settings = (self.sha256, tuple(crop or ()), subsample)
        self._decoded = _decoded(*self._settings)
        self.samples: Mapping[str, np.ndarray] = _samples(self._parts)

        names = np.array(
            [name for part in self._parts if part.classes for name in part.names]
        )
        classes = tuple(sorted(set(names.tolist()), key=readers.natural_key))
        self.value_names, self.units = (
            tuple(v[key] for v in values) for key in ("name", "unit")
        )
        self.values = np.full((len(self.samples["order"]), len(values)), np.nan)
        for k, value in enumerate(values):
            if "column" in value:
                at = columns.index(value["column"])
                column = [np.asarray(part.values)[:, at] for part in self._parts]
                self.values[:, k] = np.concatenate(column)
            for name, number in value.get("labels", {}).items():
                self.values[names == name, k] = number
        if levels is not None:
            k = self.value_names.index(levels["value"])
            classes, labels = level_classes(
                self.values[:, k], levels["edges"], self.units[k]
            )
            top = f"a last edge of {self.values[:, k].max():g} or more"
            require(
                labels.max() < len(classes), "scene.levels.edges", levels["edges"], top
            )
            names = np.array(classes)[labels]
        require(
            len(classes) > 0,
            "scene.levels",
            levels,
            "edges of a value: no image has a label",
        )
        apart = np.isin(names, list(unknown))
        self.unknown: MeasuredScene | None = None
        if apart.any():
            self.unknown = copy.copy(self)
            self.unknown._keep(apart, names, classes)
        self._keep(~apart, names, classes)

    def _keep(
        self, chosen: np.ndarray, names: np.ndarray, classes: tuple[str, ...]
    ) -> None:
        """Keep some of the frames; names [N] of the classes of all."""
        self._rows = np.flatnonzero(chosen)
        self.classes = tuple(name for name in classes if name in names[chosen])
        self.labels = np.array([self.classes.index(name) for name in names[chosen]])
        self.samples = {name: column[chosen] for name, column in self.samples.items()}
        self.values = self.values[chosen]

    def __len__(self) -> int:
        return len(self.labels)

    def frames(self, indices: Sequence[int] | np.ndarray | Tensor) -> Tensor:
        """Frames uint8 or uint16 [len(indices), H, W]."""
        rows = self._rows[row_numbers(indices, len(self))].tolist()
        frames = {row: self._decoded[row] for row in rows if row in self._decoded}
        missing, first = [row for row in dict.fromkeys(rows) if row not in frames], 0
        for part in self._parts:
            inside = [row for row in missing if first <= row < first + len(part)]
            for row, frame in zip(
                inside, part.stream([r - first for r in inside]), strict=True
            ):
                frames[row] = frame
                if (len(self._decoded) + 1) * frame.nbytes <= MEMORY_BYTES:
                    self._decoded[row] = frame
            first += len(part)
        if not rows:
            return torch.empty((0, *self.shape), dtype=torch.uint8)
        return torch.from_numpy(np.stack([frames[row] for row in rows]))

    def fingerprint(self) -> str:
        """SHA-256 over the files, the pixels kept of them, classes, labels, values and order."""
        digest = hashlib.sha256(
            repr((self._settings, self.classes, self.value_names)).encode()
        )
        for array in (self._rows, self.labels, self.values, self.samples["order"]):
            digest.update(np.ascontiguousarray(array, dtype="<f8").data)
        return digest.hexdigest()


@lru_cache(maxsize=4)
def _decoded(
    sha256: str, crop: tuple[int, ...], subsample: int
) -> dict[int, np.ndarray]:
    """Frames by row, shared by all scenes of the same files and window in this process."""
    return {}


def _samples(parts: Sequence[readers.Recording]) -> dict[str, np.ndarray]:
    """File and place in time of each frame; session and group as far as all parts know them."""
    kept = ("file", "group", "group_name", "session", "session_name")
    common = [name for name in kept if all(name in part.samples for part in parts)]
    starts = np.cumsum([0, *(part.order.max() + 1 for part in parts[:-1])])
    order = [part.order + start for part, start in zip(parts, starts, strict=True)]
    samples = {n: np.concatenate([part.samples[n] for part in parts]) for n in common}
    if len(parts) > 1:
        samples["session"] = np.repeat(
            np.arange(len(parts)), [len(part) for part in parts]
        )
    return {"order": np.concatenate(order), **samples}


def main(arguments: Sequence[str] | None = None) -> None:
    """List the named scenes, or all public ones: what was read, or the command that gets it."""
    from hydra.errors import InstantiationException

    from scenes.export import compose

    files = [
        f
        for f in CONFIGS.glob("*.yaml")
        if re.search("source:|FibreScene", f.read_text())
    ]
    given = list(sys.argv[1:] if arguments is None else arguments)
    for name in given or sorted(file.stem for file in files):
        try:
            scene = compose([f"scene={name}"])
        except InstantiationException as error:
            print(f"{name}: {error.__cause__}")
            continue
        source, counts = scene.source, ", ".join(map(str, np.bincount(scene.labels)))
        print(
            f"{name}: {len(scene)} frames {scene.shape}, {scene.origin}; a class {counts}"
        )
        print(
            f"  github.com/{source.repository} @ {source.commit}, sha256 {scene.sha256}"
        )
        print(f"  licence: {source.licence}; {source.cite}")


if __name__ == "__main__":
    main()
