"""A folder of files of arrays or of videos, or a file of several arrays, whose names are labels.

The fields of a name hold for all frames of the file. A file is a group, unless the template says
more. Labels, sessions and groups that the name does not say are read in the file, or in the table
of a video.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

from hdc.readers import ARRAY, arrays, kind_of
from hdc.readers.about import Columns
from hdc.readers.asked import Asked
from hdc.readers.axes import readings
from hdc.readers.files import Ambiguous, BadFrame, wrong
from hdc.readers.recording import Recording, Window, in_any_order
from hdc.readers.stores import load
from hdc.readers.template import Template

Fields = Mapping[str, str]
"""Texts that the name of a file says, by field."""
Part = tuple[str, str, Fields, Recording]
"""Where a file or an array is, its name, what that says, and its frames."""


def open_files(
    root: Path,
    files: Mapping[str, Fields],
    others: Sequence[str],
    window: Window,
    asked: Asked,
) -> Recording:
    """The frames of these files, one after the other; the `others` of the folder are left out.

    Raises:
        Ambiguous: an array of two axes may be a frame or vectors.
        BadFrame: a file cannot be read, or its frames are not of the size and depth of the first.
        ValueError: a file or its name is not as described.
    """
    parts = []
    for file, fields in files.items():
        opened = partial(_opened, root / file, fields, window, asked.of_part())
        # A file is opened again for its frames: not all files are in memory at once.
        found = replace(opened(), each=partial(_each, opened))
        parts.append((f"{root / file}", file, fields, found))
    joined = _joined(root, "files", parts, window, asked)
    return replace(joined, other_files=tuple(others))


def open_frames(path: Path, window: Window, asked: Asked) -> Recording:
    """The arrays of a file that a template names, one after the other.

    Raises:
        Ambiguous, BadFrame, SettingError, ValueError: see :func:`open_files`.
    """
    assert asked.template is not None
    if asked.dataset:
        raise wrong("template", asked.template, f"null with {path}:/{asked.dataset}")
    read, store = Template(asked.template).read, load(path)
    parts = []
    for name in store.arrays:
        if (fields := read(name)) is not None:
            own = asked.of_part()._replace(dataset=name)
            found = arrays.open_frames(path, window, own, store)
            parts.append((f"{path}:/{name}", name, fields, found))
    if not parts:
        names = ", ".join(store.arrays) or "none"
        raise ValueError(f"{path}: expected arrays {asked.template}, found {names}")
    return _joined(path, "arrays", parts, window, asked)


def _opened(path: Path, fields: Fields, window: Window, asked: Asked) -> Recording:
    if kind_of(path) == ARRAY:
        return arrays.open_frames(path, window, asked)
    from hdc.readers import video  # late: PyAV is of the extra files

    if "label" in fields or "value" in fields:
        return video.whole(path, window, asked)
    return video.open_frames(path, window, asked)


def _each(opened: Callable[[], Recording], index: np.ndarray) -> Iterator[np.ndarray]:
    return opened().each(index)


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
    root: Path, kind: str, parts: Sequence[Part], window: Window, asked: Asked
) -> Recording:
    """The frames of files or arrays of one kind, with what their names and files say."""
    first = parts[0][-1]
    wanted = f"frames {first.frame_shape} {first.dtype}"
    for where, *_, found in parts:
        own = f"frames {found.frame_shape} {found.dtype}"
        if wanted != own:
            raise BadFrame(
                f"{where}: expected {wanted} as in the first of the {kind}, found {own}"
            )
        says_how_many = found.labels is not None or found.values is not None
        if len(found.frame_shape) == 1 and asked.axes is None and not says_how_many:
            usual = [("height", "width"), *readings(2)]
            choices = [f"--axes {','.join(axes)}" for axes in usual]
            raise Ambiguous(f"{where}: an array of two axes", choices)
    founds = [found for *_, found in parts]
    frames, sizes = _Frames(founds), {*map(len, founds)}
    each = " to ".join(f"{size}" for size in sorted({min(sizes), max(sizes)}))
    unit = "frame" if each == "1" else "frames"
    columns, notes = _columns(root, parts, frames.file)
    has_groups = "group" in parts[0][2] or sizes == {1}
    return Recording.of(
        columns,
        frames,
        window,
        asked,
        lambda: repr([found.digest() for found in founds]),
        values=asked.named,
        parts=None if has_groups else frames.file,
        notes=(f"{len(parts)} {kind} of {each} {unit}", *notes, *first.notes),
        image_shape=first.image_shape,
    )


def _columns(
    root: Path, parts: Sequence[Part], part_of: np.ndarray
) -> tuple[Columns, list[str]]:
    """Columns that names and files say of the frames, whose parts are given [N]; and notes."""
    rows = [(where, {"file": name, **fields}) for where, name, fields, _ in parts]
    columns = Columns.of_rows(root, rows).take(part_of)
    said, files = {*parts[0][2]}, [found.statements for *_, found in parts]
    common = set.intersection(*(set(own.columns) for own in files))
    for name in sorted(common - said - {"order"}):
        found = [own.columns[name] for own in files]
        columns.columns[name] = np.concatenate(found)
    of_files = () if "label" in said else files[0].learnt
    columns.learnt = ("value",) if "value" in said else of_files
    both = "labels of the names of the files, not those in them"
    return columns, [both] if "label" in common & said else []
