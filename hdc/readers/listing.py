"""A folder: which files belong to the recording, and what their paths or a table say of each.

Its images are listed by a table or manifest, a template, or sub-folders. A folder without images
may be one of arrays or videos; see :mod:`hdc.readers.gathered`.
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Callable, Sequence
from pathlib import Path, PurePath, PurePosixPath, PureWindowsPath

from hdc.readers import ARRAY, VIDEO, kind_of
from hdc.readers.about import Columns, path_key
from hdc.readers.files import Ambiguous, wrong
from hdc.readers.recording import Asked, Recording
from hdc.readers.table import Rows, columns_in, read_csv
from hdc.readers.template import Template, suggested

MANIFEST = "manifest.csv"
SUFFIXES = (".png", ".jpg", ".jpeg", ".bmp", ".tif", ".tiff")
Reader = Callable[[str], dict[str, str] | None]
"""Texts that the path of a file says, by column; None where it says none."""


def open_frames(root: Path, asked: Asked) -> Recording:
    """The frames of a folder: its images, or else its files of arrays and videos.

    Raises:
        Ambiguous: it has several readings.
        BadFrame: a file is no usable image, or its size or depth is not that of the first.
        SettingError: the template or a column cannot be, or a path has two readings.
        ValueError: the folder or its table is not as described, or a folder in it is a link.
    """
    if (table := _table(root, asked)) is not None:
        return _of_table(root, table, asked)
    files = all_files(root)
    named = [(str(root / file), {"file": file}) for file in files]
    rows = _said(named, _reader(root, files, asked))
    images = [row for row in rows if is_image(row[1]["file"])]
    if images:
        columns = Columns.of_rows(root, images)
        return _of_images(root, columns, _others(files, images), asked)
    recorded = [row for row in rows if _is_recorded(root / row[1]["file"])]
    if asked.template is None or not recorded:
        raise _unread(root, files, asked)
    from hdc.readers import gathered

    return gathered.open_files(root, recorded, _others(files, recorded), asked)


def _unread(root: Path, files: Sequence[str], asked: Asked) -> ValueError:
    """The error of a folder of which no file is read: what is there, and what to type."""
    recorded = [file for file in files if _is_recorded(root / file)]
    if recorded and asked.template is None:
        made = suggested(recorded, ("{label}", "{session}"))
        found = f"{root}: {len(recorded)} files of frames, such as {recorded[0]}"
        return Ambiguous(found, [f"--template '{template}'" for template in made])
    found = f"{len(files)} other files, {', '.join(files[:3])}" if files else "none"
    return ValueError(
        f"{root}: expected images in one sub-folder per class, in a {MANIFEST}, or as the template "
        f"says (of the folder of one class give the one above), found {found}"
    )


def _of_images(
    root: Path,
    columns: Columns,
    others: tuple[str, ...],
    asked: Asked,
    notes: Sequence[str] = (),
) -> Recording:
    """The images of a folder, of which a column is the ``file``."""
    from hdc.readers.images import Images  # OpenCV

    if asked.axes:
        wanted = f"null unless {root} is a folder of arrays or videos"
        raise wrong("axes", asked.axes, wanted)
    files = [root / name for name in columns.columns["file"].tolist()]
    images = Images(files, asked.window)

    def digest() -> str:
        contents = (hashlib.sha256(file.read_bytes()).digest() for file in files)
        return hashlib.sha256(b"".join(contents)).hexdigest()

    return Recording.of(
        columns,
        images,
        asked,
        digest,
        notes=notes,
        other_files=others,
        image_shape=images.size,
        is_decoded=True,
    )


# Tables ------------------------------------------------------------------------------------------


def _table(root: Path, asked: Asked) -> Path | None:
    """The table of a folder: that which is asked for, or its manifest."""
    if asked.table is not None:
        return asked.table if asked.table.exists() else root / asked.table
    manifest = root / MANIFEST
    return manifest if asked.template is None and manifest.exists() else None


def _of_table(root: Path, table: Path, asked: Asked) -> Recording:
    """The images of a table, or of the manifest of the folder.

    Raises:
        ValueError: an image is missing, or there twice.
    """
    column, labels = asked.image_column, []
    if asked.table is None:
        column, labels = "file", ["label"]
    elif (found := columns_in(table)) and column not in found:
        wanted = f"one of {', '.join(found)} ({table}; --image-column names it)"
        raise wrong("image_column", column, wanted)
    rows = read_csv(table, (column, *labels, *asked.values))
    for _, row in rows:
        row["file"] = PurePosixPath(row.pop(column)).as_posix()
    names = [row["file"] for _, row in rows]
    if asked.template is not None:
        rows = _said(rows, Template(asked.template).read)
    others, notes = _others(names, rows), _locate(root, table, rows)
    columns = Columns.of_rows(table, rows)
    if asked.table is None:
        columns.learnt = ()
    return _of_images(root, columns, others, asked, notes)


def _locate(root: Path, table: Path, rows: Rows) -> list[str]:
    """Have each row of a table name its image as it lies from the folder; notes say how.

    Images are in the folder, or beside the table, or else files in the folder that have their
    names, such as images that came from another disk.

    Raises:
        ValueError: an image is missing, or there twice.
    """
    names, notes = [row["file"] for _, row in rows], []
    for base in (root, table.parent):
        files = [str(base / name) for name in names]
        if all(map(os.path.isfile, files)):
            break
    else:
        files = _by_names(root, table, names)
        notes = [
            f"images found by their names: {names[0]} is {os.path.relpath(files[0], root)}"
        ]
    seen: set[str] = set()
    for (place, row), file in zip(rows, files, strict=True):
        row["file"] = name = os.path.relpath(file, root)
        if name in seen:
            raise ValueError(f"{place}: expected each file once, found {name!r} again")
        seen.add(name)
    return notes


def _by_names(root: Path, table: Path, names: Sequence[str]) -> list[str]:
    """Files of a folder that have the names of these paths, each there once.

    Raises:
        ValueError: an image is missing.
    """
    places: dict[str, list[str]] = {}
    for file in all_files(root):
        places.setdefault(PurePath(file).name, []).append(str(root / file))
    found = [places.get(PureWindowsPath(name).name, []) for name in names]
    if any(len(own) != 1 for own in found):
        missing = [name for name in names if not (root / name).is_file()]
        raise ValueError(
            f"{table}: expected every image in {root} or beside the table, found that "
            f"{len(missing)} of {len(names)} are missing, the first {missing[0]}"
        )
    return [file for own in found for file in own]


# Templates and sub-folders -----------------------------------------------------------------------


def _said(rows: Rows, read: Reader) -> Rows:
    """Those rows of files whose paths say something, with what they say."""
    read_rows = ((place, row, read(row["file"])) for place, row in rows)
    return [(place, row | said) for place, row, said in read_rows if said is not None]


def _others(files: Sequence[str], rows: Rows) -> tuple[str, ...]:
    """The files that are not in these rows."""
    kept = {row["file"] for _, row in rows}
    return tuple(file for file in files if file not in kept)


def _reader(root: Path, files: Sequence[str], asked: Asked) -> Reader:
    """Reads what the template says; without one the class of an image: its folder.

    Where no class is needed, images that all lie in the folder itself have none.

    Raises:
        Ambiguous: every image in a folder lies in one of folders: which is the class?
    """
    if asked.template is not None:
        return Template(asked.template).read
    inside = [file for file in files if is_image(file) and "/" in file]
    depth = min((file.count("/") for file in inside), default=1)
    if depth > 1:
        rest = "/*" * (depth - 1)
        readings = (f"{{label}}/{{group}}{rest}", f"{{session}}/{{label}}{rest}")
        raise Ambiguous(
            f"{root}: folders of folders, such as {inside[0]}",
            [f"--template '{reading}'" for reading in readings],
        )
    needs_none = asked.fewest_classes == 0 and not inside
    loose: dict[str, str] | None = {} if needs_none else None
    return lambda file: {"label": file.split("/")[0]} if "/" in file else loose


# Files -------------------------------------------------------------------------------------------


def all_files(root: Path) -> list[str]:
    """Paths of all files below a folder, relative to it, in natural order; no hidden ones.

    Raises:
        ValueError: a folder in it is a link: its files would count twice, or without an end.
        OSError: a folder in it cannot be read.
    """
    files = []
    for parent, folders, names in os.walk(root, onerror=_raise):
        folders[:] = [name for name in folders if not name.startswith(".")]
        for folder in (Path(parent, name) for name in folders):
            if folder.is_symlink():
                raise ValueError(
                    f"{folder}: expected a folder, found a link to {os.readlink(folder)}, whose "
                    "files might count twice; put the folder itself here, or take the link away"
                )
        shown = (Path(parent, name) for name in names if not name.startswith("."))
        files += [file.relative_to(root).as_posix() for file in shown]
    return sorted(files, key=path_key)


def _raise(error: OSError) -> None:
    raise error


def is_image(file: str) -> bool:
    """Whether the name is that of an image."""
    return file.lower().endswith(SUFFIXES)


def _is_recorded(file: Path) -> bool:
    """Whether a file is one of arrays or a video."""
    return kind_of(file) in (ARRAY, VIDEO)
