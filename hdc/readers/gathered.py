"""A folder of files of arrays or of videos, whose names say what was recorded.

What a name says holds for all frames of the file. A file is a group, unless the template says more.
A label, session or group that the name does not say is that of the frames in the file, if it has
them: of a video, in the table beside it.
"""

from __future__ import annotations

import hashlib
import re
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache, cached_property
from pathlib import Path, PurePath

import numpy as np

from hdc.readers import ARRAY, VIDEO, kind_of
from hdc.readers.about import About, Columns, grouped
from hdc.readers.asked import Asked
from hdc.readers.files import Ambiguous, BadFrame, file_digest, wrong
from hdc.readers.recording import Recording, Window
from hdc.readers.template import Template

_NUMBERED = re.compile(r"(.*?)((?:[\W_]+[A-Za-z]*=?)?)(\d+)")
"""A name such as ball__t=0 or ball_run2: what it is of, what is between, and a number."""
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


def open_frames(
    root: Path,
    files: Sequence[tuple[str, Fields]],
    others: Sequence[str],
    window: Window,
    asked: Asked,
) -> Recording:
    """Open the frames of these files, one after the other; the `others` of the folder are left out.

    Raises:
        BadFrame: a file cannot be read, or its frames are not of the size and depth of the first.
        SettingError: ``frames`` is out of range.
        ValueError: a file or what its name says is not as described.
    """
    if asked.frames is not None and asked.frames < 1:
        raise wrong("frames", asked.frames, "null or an integer ≥ 1")
    if asked.skip_damaged:
        raise wrong("skip_damaged", True, f"false unless {root} is a folder of images")
    parts = [_part(root, file, fields, window, asked) for file, fields in files]
    first = parts[0].recording
    for part in parts:
        _check_alike(root / part.file, first, part.recording)
    about, notes = _about(root, parts, asked)
    frames = _Frames(parts)
    sizes = [len(part.recording) for part in parts]
    each = f"{min(sizes)}" if len({*sizes}) == 1 else f"{min(sizes)} to {max(sizes)}"
    taken_of_each = f", {asked.frames} of each taken" if asked.frames else ""
    found = f"{len(parts)} files of {each} frames{taken_of_each}"
    taken = {part.file for part in parts}
    return Recording.of(
        about,
        frames,
        window,
        digest=cache(frames.digest),
        image_shape=first.image_shape,
        other_files=tuple(file for file in others if file not in taken),
        notes=(found, *notes, *first.notes),
    )


# Each file ---------------------------------------------------------------------------------------


@dataclass(frozen=True)
class _Part:
    """A file, what its name says, its frames, and which of them are taken."""

    file: str
    fields: Fields
    recording: Recording
    rows: np.ndarray

    @cached_property
    def columns(self) -> dict[str, np.ndarray]:
        """What the file says of the frames that are taken; sessions and groups by their names."""
        columns = dict(self.recording.samples)
        for name in ("session", "group"):
            if f"{name}_name" in columns:
                columns[name] = columns.pop(f"{name}_name")
        del columns["order"]
        if self.recording.labels is not None:
            columns["label"] = np.array(self.recording.names)
        return {name: column[self.rows] for name, column in columns.items()}


def _part(root: Path, file: str, fields: Fields, window: Window, asked: Asked) -> _Part:
    path = root / file
    own = asked._replace(template=None, fewest_classes=0)

    def opened() -> Recording:
        if kind_of(path) == ARRAY:
            from hdc.readers import arrays

            return arrays.open_frames(path, window, own)
        if "label" in fields or "value" in fields:
            return _whole_film(path, window)
        from hdc.readers import video  # late: PyAV is of the extra files

        return video.open_frames(path, window, own)

    def each(index: np.ndarray) -> Iterator[np.ndarray]:
        return opened().each(index)  # not all files are in memory at once

    recording = replace(opened(), each=each)
    n = len(recording)
    most = min(asked.frames or n, n)
    rows = (2 * np.arange(most) + 1) * n // (2 * most)
    return _Part(file, fields, recording, rows)


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


def _check_alike(path: Path, first: Recording, other: Recording) -> None:
    wanted, found = (
        f"frames {shown.frame_shape} {shown.dtype}" for shown in (first, other)
    )
    if wanted != found:
        raise BadFrame(f"{path}: expected {wanted} as in the first file, found {found}")


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
    """What names and files say, and how they were read."""
    counts = [len(part.rows) for part in parts]
    member = np.repeat(np.arange(len(parts)), counts)
    said = {
        name: [parts[k].fields[name] for k in member.tolist()]
        for name in parts[0].fields
    }
    place: Callable[[int], str] = lambda i: str(root / parts[member[i]].file)  # noqa: E731
    columns = Columns.of_texts(root, len(member), place, said)
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
    names = np.array([part.file for part in parts])
    about = replace(about, samples={**about.samples, "file": names[member]})
    if "group" in said or max(counts) == 1:
        return about, notes
    if (own := about.samples.get("group")) is not None:
        member = np.unique(np.stack([member, own]), axis=1, return_inverse=True)[1]
    if about.labels is None:
        return replace(about, samples={**about.samples, "group": member}), notes
    about, alone = grouped(about, member)
    if alone:
        notes.append(f"{alone}: one file, whose frames are split")
    elif "group" not in about.samples:
        notes.append("each class is one file, whose frames are split")
    return about, notes


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


# Templates ---------------------------------------------------------------------------------------


def suggested(files: Sequence[str]) -> list[str]:
    """Templates that the names of files suggest, for each kind of file the likeliest first."""
    suffixes = Counter(PurePath(file).suffix for file in files)
    found: list[str] = []
    for suffix, _ in suffixes.most_common():
        names = [PurePath(file) for file in files if file.endswith(suffix)]
        depth = max(len(name.parts) for name in names)
        twins = numbered([name.stem for name in names if len(name.parts) == depth])
        if depth == 1:
            made = [twins, "{label}", "{session}"]
        elif depth == 2:
            # A number that begins anew in each session is no group: a file is one.
            of_day = twins and f"{{session}}/{twins.replace('{group}', '*')}"
            made = [of_day, "{label}/{group}", "{session}/{label}"]
        else:
            rest = "*/" * (depth - 3)
            made = ["{session}/{label}/*", "{label}/{session}/*"]
            made = [f"{rest}{one}" for one in made]
        found += [f"{one}{suffix}" for one in made if one]
    return found


def numbered(names: Sequence[str]) -> str:
    """The template of names that differ in a number at their end, such as ball__t=0 and ball__t=1;
    empty where they are not such: two things are there, and one of them twice."""
    read = [found.groups() for name in names if (found := _NUMBERED.fullmatch(name))]
    things = Counter(thing + between for thing, between, _ in set(read))
    if len(things) < 2 or max(things.values()) < 2:
        return ""
    between = {part for _, part, _ in read}
    if len(between) == 1 and between != {""}:
        return f"{{label}}{between.pop()}{{group}}"
    return "{label}{group:d}"
