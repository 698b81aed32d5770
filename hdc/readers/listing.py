"""Files of a folder that belong to a recording, with the label, values and order of each."""

from __future__ import annotations

import os
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path, PurePath, PurePosixPath

import numpy as np

from hdc.readers.columns import Columns
from hdc.readers.files import natural_key, read_csv, require
from hdc.readers.recording import check_times
from hdc.readers.template import Template

MANIFEST = "manifest.csv"
SUFFIXES = (".png", ".jpg", ".jpeg", ".bmp", ".tif", ".tiff")
FOLDERS = re.compile(r"(?P<label>[^/]+)/.+")
"""Paths where the first folder is the class."""


@dataclass(frozen=True)
class Listing:
    """N images and what is known of each; names of files that are not among them."""

    files: list[Path]
    labels: list[str] | None
    classes: list[str] | None  # in the order that a manifest gives
    samples: dict[str, np.ndarray]
    values: np.ndarray | None  # float64 [N, k]
    value_names: tuple[str, ...]
    other_files: list[str]


@dataclass(frozen=True)
class _Rows:
    """Images as they were found: where each is named, its path, and its texts by column."""

    places: list[str]
    names: list[str]
    texts: list[dict[str, str]]
    other_files: list[str]


def list_folder(
    root: Path,
    template: str | None = None,
    table: str | Path | None = None,
    image_column: str = "image",
    value_columns: Sequence[str] = (),
) -> Listing:
    """List the files of a folder by its table or manifest, by a template, or by its sub-folders.

    Raises:
        SettingError: the template or a column cannot be, or a path has two readings.
        ValueError: the folder or its table is not as described, or a folder in it is a link.
    """
    pattern = None if template is None else Template(template)
    if table is not None:
        where = _table_path(root, table)
        rows = _rows_of_table(where, image_column, value_columns, pattern)
        base = _base(root, where, rows)
        _check_once(base, rows)
        return _listing(where, base, rows, list(value_columns) or None)
    manifest = root / MANIFEST
    if pattern is None and manifest.exists():
        rows = _rows_of_manifest(manifest, value_columns)
        _check_once(root, rows)
        return _listing(manifest, root, rows, list(value_columns), by_index=True)
    wanted = f"a table with the columns {', '.join(value_columns)}"
    require(not value_columns, "table", None, wanted)
    rows = _rows_of_files(root, pattern)
    return _listing(root, root, rows, None)


def _listing(
    where: Path,
    base: Path,
    rows: _Rows,
    value_columns: list[str] | None,
    by_index: bool = False,
) -> Listing:
    """The listing of rows; without ``value_columns`` all columns of numbers are values."""
    if not rows.names:
        raise ValueError(_nothing_found(where, rows.other_files))
    columns = Columns.of(rows.places, rows.texts)
    labels = columns.pop_labels()
    samples = columns.samples()
    check_times(where, samples, len(rows.names))
    if value_columns is None:
        value_columns = columns.numeric()
    if labels is None and not value_columns:
        raise ValueError(
            f"{where}: expected a label of each image, or numbers, found neither"
        )
    classes = None
    if by_index and labels and "class_index" in samples:
        classes = _classes(where, labels, samples.pop("class_index").tolist())
    return Listing(
        files=[base / name for name in rows.names],
        labels=labels,
        classes=classes,
        samples=samples,
        values=columns.values(value_columns),
        value_names=tuple(value_columns),
        other_files=rows.other_files,
    )


def _classes(where: Path, labels: list[str], indices: list[int]) -> list[str]:
    """Names of the classes in the order of their indices."""
    pairs = sorted(set(zip(indices, labels, strict=True)))
    if len(pairs) > len(set(labels)):
        raise ValueError(f"{where}: expected one class_index per label, found {pairs}")
    return [label for _, label in pairs]


def _check_once(base: Path, rows: _Rows) -> None:
    """Raise a ValueError for a file that is there twice, by whatever spelling of its folder."""
    folders: dict[PurePath, Path] = {}
    seen = set()
    for place, name in zip(rows.places, rows.names, strict=True):
        path = PurePath(name)
        if path.parent not in folders:
            folders[path.parent] = (base / path.parent).resolve()
        file = folders[path.parent] / path.name
        if file in seen:
            raise ValueError(f"{place}: expected each file once, found {name!r} again")
        seen.add(file)


# Tables ------------------------------------------------------------------------------------------


def _table_path(root: Path, table: str | Path) -> Path:
    """The path of a table that is given as it is, or from the folder."""
    path = Path(table).expanduser()
    if path.exists() or path.is_absolute():
        return path
    return root / path


def _base(root: Path, table: Path, rows: _Rows) -> Path:
    """What the paths in a table are relative to: its own folder, or that of the recording."""
    if rows.names and (table.parent / rows.names[0]).is_file():
        return table.parent
    return root


def _rows_of_table(
    table: Path,
    image_column: str,
    value_columns: Sequence[str],
    pattern: Template | None,
) -> _Rows:
    """Rows of a table of values, without those that are not as the template says."""
    rows = _Rows([], [], [], [])
    for place, row in read_csv(table, value_columns):
        if image_column not in row:
            raise ValueError(
                f"{table}: expected different columns, with {image_column}, found "
                f"{list(row)} (--image-column names the column of images)"
            )
        name = str(PurePosixPath(row.pop(image_column)))
        if name == ".":
            raise ValueError(f"{place}: expected a {image_column}, found none")
        fields = {} if pattern is None else pattern.read(name)
        if fields is None:
            rows.other_files.append(name)
            continue
        rows.places.append(place)
        rows.names.append(name)
        rows.texts.append(row | fields)
    return rows


def _rows_of_manifest(manifest: Path, value_columns: Sequence[str]) -> _Rows:
    rows = _Rows([], [], [], [])
    for place, row in read_csv(manifest, ("file", "label", *value_columns)):
        rows.places.append(place)
        rows.names.append(str(PurePosixPath(row.pop("file"))))
        rows.texts.append(row)
    return rows


# Folders -----------------------------------------------------------------------------------------


def _rows_of_files(root: Path, pattern: Template | None) -> _Rows:
    """Images of a folder as the template says, or by sub-folders."""
    rows = _Rows([], [], [], [])
    for file in all_files(root):
        fields = None
        if is_image(file):
            fields = _label(file) if pattern is None else pattern.read(file)
        if fields is None:
            rows.other_files.append(file)
            continue
        rows.places.append(str(root / file))
        rows.names.append(file)
        rows.texts.append(fields)
    return rows


def _label(file: str) -> dict[str, str] | None:
    match = FOLDERS.fullmatch(file)
    return None if match is None else match.groupdict()


def all_files(root: Path) -> list[str]:
    """Paths of all files below a folder, relative to it, in natural order; no hidden ones.

    Raises:
        ValueError: a folder in it is a link: its files would count twice, or without an end.
        OSError: a folder in it cannot be read.
    """
    files = []
    for parent, folders, names in os.walk(root, onerror=_raise):
        folders[:] = [name for name in folders if not name.startswith(".")]
        for name in folders:
            _check_is_no_link(Path(parent, name))
        inside = PurePath(parent).relative_to(root).as_posix()
        before = "" if inside == "." else f"{inside}/"
        files += [before + name for name in names if name[0] != "."]
    return sorted(files, key=_path_key)


def _raise(error: OSError) -> None:
    raise error


def _check_is_no_link(folder: Path) -> None:
    if folder.is_symlink():
        raise ValueError(
            f"{folder}: expected a folder, found a link to {os.readlink(folder)}, whose files "
            "might count twice; put the folder itself here, or take the link away"
        )


def _path_key(file: str) -> list[tuple[tuple[int, int, str], ...]]:
    return [natural_key(part) for part in file.split("/")]


def is_image(file: str) -> bool:
    """Whether the name is that of an image."""
    return file.lower().endswith(SUFFIXES)


def image_files(root: Path) -> list[Path]:
    """Every image of a folder and its sub-folders, in natural order.

    Raises:
        ValueError: there is none, or a folder in it is a link.
    """
    files = [root / file for file in all_files(root) if is_image(file)]
    if not files:
        raise ValueError(f"{root}: expected images ({', '.join(SUFFIXES)}), found none")
    return files


def _nothing_found(where: Path, other_files: list[str]) -> str:
    """Why a folder or table gives no images, and what may have been meant."""
    wanted = (
        f"{where}: expected images in one sub-folder per class, in a {MANIFEST}, or as the "
        "template says"
    )
    if not other_files:
        return f"{wanted}, found none"
    loose = [file for file in other_files if is_image(file) and "/" not in file]
    if not where.is_dir() or len(loose) < len(other_files):
        found = ", ".join(other_files[:3])
        return f"{wanted}, found {len(other_files)} other files, {found}"
    images = "1 image" if len(loose) == 1 else f"{len(loose)} images"
    if _class_folders(where.resolve().parent) > 1:
        meant = _parent_of(where)
        return f"{where} holds {images} and no class folders; did you mean {meant}?"
    return f"{wanted}, found {images} and no sub-folder"


def _class_folders(folder: Path) -> int:
    """How many sub-folders have an image at their top."""
    found = 0
    for sub in folder.iterdir():
        if sub.is_dir() and os.access(sub, os.R_OK | os.X_OK):
            found += any(is_image(entry.name) for entry in os.scandir(sub))
    return found


def _parent_of(folder: Path) -> Path:
    """The folder above, as the user would write it."""
    written = folder.parent
    return folder.resolve().parent if written == folder or not folder.name else written
