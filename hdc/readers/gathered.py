"""A folder of files of arrays or of videos, or a file of several arrays, whose names are labels.

The fields of a name hold for all frames of the file. A file is a group, unless the template says
more. Labels, sessions and groups that the name does not say are read in the file, or in the table
of a video.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache, cached_property, partial
from pathlib import Path

import numpy as np

from hdc.readers import ARRAY, VIDEO, arrays, kind_of, stores
from hdc.readers.about import About, Columns, grouped
from hdc.readers.asked import Asked
from hdc.readers.axes import READINGS
from hdc.readers.files import Ambiguous, BadFrame, file_digest, wrong
from hdc.readers.recording import Recording, Window
from hdc.readers.template import Template, suggested

Fields = Mapping[str, str]
"""Texts that the name of a file says, by field."""


def files_of(
    root: Path, others: Sequence[str], template: str | None
) -> list[tuple[str, Fields]]:
    """Files of arrays and videos among the `others` of a folder, with what their names say.

    Raises:
        Ambiguous: there is no template; those that their names suggest are named.
    """
    files = [file for file in others if kind_of(root / file) in (ARRAY, VIDEO)]
    if template is None:
        if not files:
            return []
        choices = [f"--template '{made}'" for made in suggested(files)]
        found = f"{root}: {len(files)} files of frames, such as {files[0]}"
        raise Ambiguous(found, choices)
    read = Template(template).read
    found_all = [(file, read(file)) for file in files]
    return [(file, fields) for file, fields in found_all if fields is not None]


def open_files(
    root: Path,
    files: Sequence[tuple[str, Fields]],
    others: Sequence[str],
    window: Window,
    asked: Asked,
) -> Recording:
    """Open the frames of these files, one after the other; the `others` of the folder are left out.

    Raises:
        Ambiguous: an array of two axes may be a frame or vectors.
        BadFrame: a file cannot be read, or its frames are not of the size and depth of the first.
        SettingError: ``frames`` is out of range.
        ValueError: a file or its name is not as described.
    """
    if asked.skip_damaged:
        raise wrong("skip_damaged", True, f"false unless {root} is a folder of images")
    parts = []
    for file, fields in files:
        opened = partial(_opened, root / file, fields, window, asked.of_part())
        recording = replace(opened(), each=partial(_each, opened))
        parts.append(_part(f"{root / file}", file, fields, recording, asked))
    taken = {part.name for part in parts}
    return replace(
        _joined(root, "files", parts, window, asked),
        other_files=tuple(file for file in others if file not in taken),
    )


def open_frames(path: Path, window: Window, asked: Asked) -> Recording:
    """Open the arrays of a file that a template names, one after the other.

    Raises:
        Ambiguous, BadFrame, SettingError, ValueError: see :func:`open_files`.
    """
    assert asked.template is not None
    if asked.dataset:
        raise wrong("template", asked.template, f"null with {path}:/{asked.dataset}")
    read = Template(asked.template).read
    parts = []
    with stores.loaded_once():
        names = [*stores.load(path).arrays]
        for name in names:
            if (fields := read(name)) is not None:
                own = asked.of_part()._replace(dataset=name)
                recording = arrays.open_frames(path, window, own)
                parts.append(_part(f"{path}:/{name}", name, fields, recording, asked))
    if not parts:
        found = ", ".join(names) or "none"
        raise ValueError(f"{path}: expected arrays {asked.template}, found {found}")
    return _joined(path, "arrays", parts, window, asked)


# Each file ---------------------------------------------------------------------------------------


@dataclass(frozen=True)
class _Part:
    """A file or an array, the fields of its name, its frames, and the rows that are taken."""

    where: str
    name: str
    fields: Fields
    recording: Recording
    rows: np.ndarray

    @cached_property
    def columns(self) -> dict[str, np.ndarray]:
        """Columns in the file of the frames that are taken; sessions and groups by their names."""
        columns = dict(self.recording.samples)
        for name in ("session", "group"):
            if f"{name}_name" in columns:
                columns[name] = columns.pop(f"{name}_name")
        del columns["order"]
        if self.recording.labels is not None:
            columns["label"] = np.array(self.recording.names)
        return {name: column[self.rows] for name, column in columns.items()}


def _part(
    where: str, name: str, fields: Fields, recording: Recording, asked: Asked
) -> _Part:
    if asked.frames is not None and asked.frames < 1:
        raise wrong("frames", asked.frames, "null or an integer ≥ 1")
    n, shape = len(recording), recording.frame_shape
    says_how_many = recording.labels is not None or recording.values is not None
    if len(shape) == 1 and asked.axes is None and not says_how_many:
        choices = [f"--axes {axes}" for axes in ("height,width", *READINGS[2])]
        raise Ambiguous(f"{where}: an array of two axes", choices)
    most = min(asked.frames or n, n)
    rows = (2 * np.arange(most) + 1) * n // (2 * most)
    return _Part(where, name, fields, recording, rows)


def _opened(path: Path, fields: Fields, window: Window, asked: Asked) -> Recording:
    if kind_of(path) == ARRAY:
        return arrays.open_frames(path, window, asked)
    if "label" in fields or "value" in fields:
        return _whole_film(path, window)
    from hdc.readers import video  # late: PyAV is of the extra files

    return video.open_frames(path, window, asked)


def _each(opened: Callable[[], Recording], index: np.ndarray) -> Iterator[np.ndarray]:
    """Frames of a file that is opened again: not all files are in memory at once."""
    return opened().each(index)


def _whole_film(path: Path, window: Window) -> Recording:
    """All frames of a video."""
    from hdc.readers.film import Film

    film = Film(path, window, 0)
    film.expect()
    numbers = np.array(film.numbers)
    return Recording.of(
        About({"order": numbers, "frame": numbers}),
        film,
        window,
        digest=lambda: file_digest(path),
        notes=tuple(film.notes),
    )


def _joined(
    root: Path, kind: str, parts: Sequence[_Part], window: Window, asked: Asked
) -> Recording:
    """The frames of files or arrays of one kind, with what their names and files say."""
    first = parts[0].recording
    wanted = f"frames {first.frame_shape} {first.dtype}"
    for part in parts:
        found = f"frames {part.recording.frame_shape} {part.recording.dtype}"
        if wanted != found:
            raise BadFrame(
                f"{part.where}: expected {wanted} as in the first of the {kind}, found {found}"
            )
    about, notes = _about(root, parts, asked)
    frames = _Frames(parts)
    sizes = [len(part.recording) for part in parts]
    each = f"{min(sizes)}" if len({*sizes}) == 1 else f"{min(sizes)} to {max(sizes)}"
    unit = "frame" if each == "1" else "frames"
    taken = f", {asked.frames} of each taken" if asked.frames else ""
    return Recording.of(
        about,
        frames,
        window,
        digest=cache(frames.digest),
        image_shape=first.image_shape,
        notes=(f"{len(parts)} {kind} of {each} {unit}{taken}", *notes, *first.notes),
    )


class _Frames:
    """Frames of several files, one after the other."""

    def __init__(self, parts: Sequence[_Part]) -> None:
        self._parts = parts
        self._file = np.repeat(np.arange(len(parts)), [len(p.rows) for p in parts])
        self._row = np.concatenate([part.rows for part in parts])
        self.shape, self.dtype = (
            parts[0].recording.frame_shape,
            parts[0].recording.dtype,
        )

    def place(self, i: int) -> str:
        """The file of a frame, and its place there."""
        return self._parts[self._file[i]].recording.place(int(self._row[i]))

    def digest(self) -> str:
        """That of the files and of the frames that are taken."""
        rows = hashlib.sha256(self._row.astype("<i8").tobytes()).hexdigest()
        return repr(([part.recording.digest() for part in self._parts], rows))

    def each(self, index: np.ndarray) -> Iterator[np.ndarray]:
        """Frames of the indices; a file is opened once for those that follow one another."""
        files = self._file[index]
        if (np.diff(files) >= 0).all():
            return self._in_order(index)
        order = np.argsort(files, kind="stable")
        found = dict(zip(order.tolist(), self._in_order(index[order]), strict=True))
        return (found[k] for k in range(len(index)))

    def _in_order(self, index: np.ndarray) -> Iterator[np.ndarray]:
        files = self._file[index]
        for file in np.unique(files):
            rows = self._row[index[files == file]]
            yield from self._parts[file].recording.each(rows)


# What is said of the frames ----------------------------------------------------------------------


def _about(root: Path, parts: Sequence[_Part], asked: Asked) -> tuple[About, list[str]]:
    """Labels, values and other columns of the names and files, and notes on how they were read."""
    counts = [len(part.rows) for part in parts]
    member = np.repeat(np.arange(len(parts)), counts)
    said = {
        name: [parts[k].fields[name] for k in member.tolist()]
        for name in parts[0].fields
    }
    columns = Columns.of_texts(
        root, len(member), lambda i: parts[member[i]].where, said
    )
    common = set.intersection(*(set(part.columns) for part in parts))
    for name in sorted(common - set(said)):
        columns.columns[name] = np.concatenate([part.columns[name] for part in parts])
    notes = []
    if "label" in common & set(said):
        notes.append("labels of the names of the files, not those in them")
    values = _values(parts, asked, "label" in said)
    columns.columns |= values
    columns.learnt = ("value",) if "value" in said else tuple(values)
    about = columns.about(asked.named, asked.fewest_classes)
    names = np.array([part.name for part in parts])
    about = replace(about, samples={**about.samples, "file": names[member]})
    if "group" in said or max(counts) == 1:
        return about, notes
    about, note = _by_files(about, member)
    return about, notes + note


def _by_files(about: About, member: np.ndarray) -> tuple[About, list[str]]:
    """Frames whose files [N] are groups, parted by the groups in them; and a note of the split."""
    if (own := about.samples.get("group")) is not None:
        pairs = np.stack([member, own])
        member = np.unique(pairs, axis=1, return_inverse=True)[1]
    if about.labels is None:
        return replace(about, samples={**about.samples, "group": member}), []
    about, alone = grouped(about, member)
    if alone:
        return about, [f"{alone}: one file, whose frames are split"]
    is_split = "group" not in about.samples
    return about, ["each class is one file, whose frames are split"] * is_split


def _values(
    parts: Sequence[_Part], asked: Asked, has_labels: bool
) -> dict[str, np.ndarray]:
    """Numbers to learn that all files have, by name."""
    names = parts[0].recording.value_names
    if (has_labels and not asked.named) or any(
        part.recording.value_names != names for part in parts
    ):
        return {}
    columns = {}
    for k, name in enumerate(names):
        values = [np.asarray(p.recording.values)[p.rows, k] for p in parts]
        columns[name] = np.concatenate(values)
    return columns
