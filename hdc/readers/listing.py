"""A folder: which files belong to the recording, and what their paths or a table say of each.

Its images are listed by a table or manifest, a template, or sub-folders. A folder without images
may be one of arrays or videos; see :mod:`hdc.readers.gathered`.
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Callable, Sequence
from pathlib import Path, PurePath, PurePosixPath, PureWindowsPath
from typing import Any

from hdc.readers import ARRAY, VIDEO, kind_of
from hdc.readers.about import Columns, natural_key
from hdc.readers.asked import Asked
from hdc.readers.files import Ambiguous, wrong
from hdc.readers.recording import Recording, Window
from hdc.readers.table import Rows, read_csv
from hdc.readers.template import Template, suggested

MANIFEST = "manifest.csv"
SUFFIXES = (".png", ".jpg", ".jpeg", ".bmp", ".tif", ".tiff")
Reader = Callable[[str], dict[str, str] | None]
"""Texts that the path of a file says, by column; None where it says none."""


def open_frames(root: Path, window: Window, asked: Asked) -> Recording:
    """The frames of a folder: its images, or else its files of arrays and videos.

    Raises:
        Ambiguous: it has several readings.
        BadFrame: a file is no usable image, or its size or depth is not that of the first.
        SettingError: the template or a column cannot be, or a path has two readings.
        ValueError: the folder or its table is not as described, or a folder in it is a link.
    """
    manifest = root / MANIFEST
    if asked.table is not None:
        table = asked.table if asked.table.exists() else root / asked.table
        rows = _table_rows(table, asked.image_column, asked.named)
        return _of_table(root, table, rows, window, asked, values=asked.values)
    if asked.template is None and manifest.exists():
        rows = _table_rows(manifest, "file", ("file", "label", *asked.named))
        return _of_table(root, manifest, rows, window, asked, values=asked.named)
    files = all_files(root)
    if asked.template is None:
        read = _by_folders(root, files, asked.fewest_classes)
    else:
        read = Template(asked.template).read
    rows, _ = _read(
        [(str(root / file), {"file": file}) for file in files],
        read,
    )
    images = [row for row in rows if is_image(row[1]["file"])]
    chosen = {row["file"] for _, row in images}
    others = [file for file in files if file not in chosen]
    if images:
        for name in ("axes", "labels"):
            if setting := getattr(asked, name):
                wanted = f"null unless {root} is a folder of arrays or videos"
                raise wrong(name, setting, wanted)
        settings: dict[str, Any] = {
            "values": asked.named or None,
            "other_files": tuple(others),
        }
        return _of_images(root, root, images, window, asked, **settings)
    return _of_recorded(root, files, rows, window, asked)


def _of_recorded(
    root: Path, files: Sequence[str], rows: Rows, window: Window, asked: Asked
) -> Recording:
    """The frames of a folder without images, or a ValueError of what is expected."""
    from hdc.readers import gathered

    recorded = [file for file in files if kind_of(root / file) in (ARRAY, VIDEO)]
    if asked.template is not None:
        said = {row.pop("file"): row for _, row in rows}
        chosen = {file: said[file] for file in recorded if file in said}
        if chosen:
            others = [file for file in files if file not in chosen]
            return gathered.open_files(root, chosen, others, window, asked)
    elif recorded:
        choices = [f"--template '{made}'" for made in suggested(recorded)]
        found = f"{root}: {len(recorded)} files of frames, such as {recorded[0]}"
        raise Ambiguous(found, choices)
    found = f"{len(files)} other files, {', '.join(files[:3])}" if files else "none"
    raise ValueError(
        f"{root}: expected images in one sub-folder per class, in a {MANIFEST}, or as the template "
        f"says (of the folder of one class give the one above), found {found}"
    )


def _of_images(
    root: Path,
    base: Path,
    rows: Rows,
    window: Window,
    asked: Asked,
    where: Path | None = None,
    **settings: Any,
) -> Recording:
    """Images of a folder, in rows with their names from ``base``; ``where`` names a table."""
    from hdc.readers.images import Images  # OpenCV

    files = [base / row["file"] for _, row in rows]
    for (_, row), file in zip(rows, files, strict=True):
        row["file"] = os.path.relpath(file, root)

    def digest() -> str:
        contents = (hashlib.sha256(file.read_bytes()).digest() for file in files)
        return hashlib.sha256(b"".join(contents)).hexdigest()

    columns, images = Columns.of_rows(where or root, rows), Images(files, window)
    settings |= {"image_shape": images.size, "is_decoded": True}
    return Recording.of(columns, images, window, asked, digest, **settings)


def _table_rows(table: Path, column: str, required: Sequence[str]) -> Rows:
    """Rows of a table, of which the `column` that names images is the ``file``."""
    rows = read_csv(table, required)
    for place, row in rows:
        if column not in row:
            raise ValueError(
                f"{table}: expected different columns, with {column}, found {[*row]} "
                "(--image-column names the column of images)"
            )
        name = row.pop(column)
        if not name:
            raise ValueError(f"{place}: expected a {column}, found none")
        row["file"] = PurePosixPath(name).as_posix()
    return rows


def _of_table(
    root: Path,
    table: Path,
    rows: Rows,
    window: Window,
    asked: Asked,
    **settings: Any,
) -> Recording:
    """The images of a table, relative to the folder or to the table, or in the folder by their
    names, such as images that came from another disk.

    Raises:
        ValueError: an image is missing, or there twice.
    """
    others: list[str] = []
    notes: list[str] = []
    if asked.template is not None:
        rows, others = _read(rows, Template(asked.template).read)
    names = [row["file"] for _, row in rows]
    bases = [
        base
        for base in (root, table.parent)
        if all((base / name).is_file() for name in names)
    ]
    if not bases:
        found = _by_names(root, table, names)
        notes.append(f"images found by their names: {names[0]} is {found[0]}")
        rows = [
            (place, {**row, "file": file})
            for (place, row), file in zip(rows, found, strict=True)
        ]
    seen: set[str] = set()
    for place, row in rows:
        if (file := os.path.normpath(row["file"])) in seen:
            raise ValueError(f"{place}: expected each file once, found {file!r} again")
        seen.add(file)
    settings |= {"other_files": tuple(others), "notes": notes}
    return _of_images(root, [*bases, root][0], rows, window, asked, table, **settings)


def _by_names(root: Path, table: Path, names: Sequence[str]) -> list[str]:
    """Files of a folder that have the names of these paths, each there once.

    Raises:
        ValueError: an image is missing.
    """
    places: dict[str, list[str]] = {}
    for file in all_files(root):
        places.setdefault(PurePath(file).name, []).append(file)
    found = [places.get(PureWindowsPath(name).name, []) for name in names]
    if any(len(own) != 1 for own in found):
        missing = [name for name in names if not (root / name).is_file()]
        raise ValueError(
            f"{table}: expected every image in {root} or beside the table, found that "
            f"{len(missing)} of {len(names)} are missing, the first {missing[0]}"
        )
    return [file for own in found for file in own]


def _read(rows: Rows, read: Reader) -> tuple[Rows, list[str]]:
    """Rows with what their names say, and names of the others: those that do not say it."""
    kept, others = [], []
    for place, row in rows:
        fields = read(row["file"])
        if fields is None:
            others.append(row["file"])
        else:
            kept.append((place, row | fields))
    return kept, others


def _by_folders(root: Path, files: Sequence[str], fewest_classes: int) -> Reader:
    """Reads the class of an image: its folder.

    Where no class is needed, images that all lie in the folder itself have none.

    Raises:
        Ambiguous: every image in a folder lies in one of folders: which is the class?
    """
    inside = [file for file in files if is_image(file) and "/" in file]
    depth = min((file.count("/") for file in inside), default=1)
    if depth > 1:
        rest = "/*" * (depth - 1)
        readings = (f"{{label}}/{{group}}{rest}", f"{{session}}/{{label}}{rest}")
        raise Ambiguous(
            f"{root}: folders of folders, such as {inside[0]}",
            [f"--template '{reading}'" for reading in readings],
        )
    loose: dict[str, str] | None = {} if fewest_classes == 0 and not inside else None
    return lambda file: {"label": file.split("/")[0]} if "/" in file else loose


# Folders -----------------------------------------------------------------------------------------


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
    return sorted(files, key=lambda file: [*map(natural_key, file.split("/"))])


def _raise(error: OSError) -> None:
    raise error


def is_image(file: str) -> bool:
    """Whether the name is that of an image."""
    return file.lower().endswith(SUFFIXES)
