"""A folder of files of arrays or of videos, or a file of several arrays, whose names are labels.

The fields of a name hold for all frames of the file. A file is a group, unless the template says
more. Labels, sessions and groups that the name does not say are read in the file, or in the table
of a video.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from hdc.readers import ARRAY, arrays, kind_of
from hdc.readers.about import Columns
from hdc.readers.axes import readings
from hdc.readers.files import Ambiguous, BadFrame, wrong
from hdc.readers.recording import Asked, Recording, in_any_order
from hdc.readers.stores import load
from hdc.readers.table import Rows
from hdc.readers.template import Template


def open_files(
    root: Path, rows: Rows, others: tuple[str, ...], asked: Asked
) -> Recording:
    """The frames of files of a folder, one after the other.

    Args:
        root: the folder.
        rows: where each file is, its name as ``file``, and what that says.
        others: files that are left out.
        asked: settings of the recording.

    Raises:
        Ambiguous: an array of two axes may be a frame or vectors.
        BadFrame: a file cannot be read, or its frames are not of the size and depth of the first.
        ValueError: a file or its name is not as described.
    """
    own = asked.of_part()
    parts = [_opened(root / row["file"], {*row}, own) for _, row in rows]
    return _joined(root, "files", rows, parts, asked, other_files=others)


def open_frames(path: Path, asked: Asked) -> Recording:
    """The arrays of a file that a template names, one after the other.

    Raises:
        Ambiguous, BadFrame, SettingError, ValueError: see :func:`open_files`.
    """
    assert asked.template is not None
    if asked.dataset:
        raise wrong("template", asked.template, f"null with {path}:/{asked.dataset}")
    read, store = Template(asked.template).read, load(path)
    rows: Rows = []
    for name in store.arrays:
        if (said := read(name)) is not None:
            rows.append((f"{path}:/{name}", {"file": name, **said}))
    if not rows:
        names = ", ".join(store.arrays) or "none"
        raise ValueError(f"{path}: expected arrays {asked.template}, found {names}")
    parts = [arrays.open_frames(path, asked.of_part(row["file"])) for _, row in rows]
    return _joined(path, "arrays", rows, parts, asked)


def _opened(path: Path, said: set[str], asked: Asked) -> Recording:
    """The frames of a file. It is opened again for them: not all files are in memory at once."""
    if kind_of(path) == ARRAY:
        reader = arrays.open_frames
    else:
        from hdc.readers import video  # late: PyAV is of the extra files

        reader = video.whole if said & {"label", "value"} else video.open_frames
    opened = partial(reader, path, asked)
    return replace(opened(), each=lambda index: opened().each(index))


class _Frames:
    """Frames of several files, one after the other."""

    def __init__(self, parts: Sequence[Recording]) -> None:
        self._parts, sizes = parts, [*map(len, parts)]
        self.file = np.repeat(np.arange(len(parts)), sizes)
        self._row = np.concatenate([*map(np.arange, sizes)])
        self.shape, self.dtype = parts[0].frame_shape, parts[0].dtype

    def place(self, i: int) -> str:
        """The file of a frame, and its place there."""
        return self._parts[self.file[i]].place(int(self._row[i]))

    def each(self, index: np.ndarray) -> Iterator[np.ndarray]:
        """Frames of the indices; a file is opened once."""
        return in_any_order(index, self._ordered)

    def _ordered(self, index: np.ndarray) -> Iterator[np.ndarray]:
        files = self.file[index]
        for file in np.unique(files):
            yield from self._parts[file].each(self._row[index[files == file]])


def _joined(
    root: Path,
    kind: str,
    rows: Rows,
    parts: Sequence[Recording],
    asked: Asked,
    **settings: Any,
) -> Recording:
    """The frames of files or arrays of one kind, with what their names and files say."""
    for (where, _), part in zip(rows, parts, strict=True):
        _check_part(where, part, parts[0], asked)
    frames = _Frames(parts)
    columns, notes = _columns(root, rows, parts, frames.file)
    has_groups = "group" in rows[0][1] or len(frames.file) == len(parts)
    return Recording.of(
        columns,
        frames,
        asked,
        lambda: repr([part.digest() for part in parts]),
        parts=None if has_groups else frames.file,
        notes=(f"{len(parts)} {kind}", *notes, *parts[0].notes),
        image_shape=parts[0].image_shape,
        **settings,
    )


def _check_part(where: str, part: Recording, first: Recording, asked: Asked) -> None:
    """Raise a BadFrame for frames unlike the frames of the first part, and an Ambiguous for a table
    of numbers of which nothing says whether it is one frame."""
    wanted, found = (f"frames {one.frame_shape} {one.dtype}" for one in (first, part))
    if found != wanted:
        raise BadFrame(f"{where}: expected {wanted} as in the first, found {found}")
    says_how_many = part.labels is not None or part.values is not None
    if len(part.frame_shape) == 1 and asked.axes is None and not says_how_many:
        usual = [("height", "width"), *readings(2)]
        choices = [f"--axes {','.join(axes)}" for axes in usual]
        raise Ambiguous(f"{where}: an array of two axes", choices)


def _columns(
    root: Path, rows: Rows, parts: Sequence[Recording], part_of: np.ndarray
) -> tuple[Columns, list[str]]:
    """Columns that names and files say of the frames, whose parts are given [N]; and notes."""
    columns = Columns.of_rows(root, rows).take(part_of)
    said, files = {*rows[0][1]}, [part.statements for part in parts]
    common = set.intersection(*(set(own.columns) for own in files))
    for name in sorted(common - said - {"order"}):
        found = [own.columns[name] for own in files]
        columns.columns[name] = np.concatenate(found)
    if "value" not in said:
        columns.learnt = () if "label" in said else files[0].learnt
    both = "labels of the names of the files, not those in them"
    return columns, [both] if "label" in common & said else []
