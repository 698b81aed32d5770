"""Which files of a folder belong to a recording, and which class each is of.

Without a manifest.csv every sub-folder is a class, and every file in it an image of that class;
classes and files are in natural order (frame2 before frame10).

With one, its rows say which files belong to it and in which order. Columns: ``file``
(relative to the folder), ``label`` (name of the class), optional ``class_index`` (position of that
class among the classes, 0 … L − 1; without it they are in natural order), optional ``order`` (place
in time); any other column becomes ``recording.samples[column]``.
"""

from __future__ import annotations

import os
import stat
from dataclasses import dataclass
from pathlib import Path, PurePosixPath

import numpy as np

from hdc.readers.files import label, natural_key, read_csv, shown
from hdc.readers.recording import check_times

MANIFEST = "manifest.csv"
SUFFIXES = {
    ".png": "PNG",
    ".jpg": "JPEG",
    ".jpeg": "JPEG",
    ".bmp": "BMP",
    ".tif": "TIFF",
    ".tiff": "TIFF",
}
_IGNORED = ("thumbs.db", "desktop.ini", "__macosx", "@eadir")


@dataclass(frozen=True)
class Listing:
    """Files of a folder, their class names and properties, [N] each; classes in their order."""

    files: list[Path]
    labels: list[str]
    properties: dict[str, np.ndarray]
    classes: list[str] | None = None


def list_folder(root: Path, fewest_classes: int = 2) -> Listing:
    """Files of a folder as its manifest or its sub-folders say.

    Args:
        root: the folder.
        fewest_classes: a folder of fewer sub-folders is refused.

    Raises:
        ValueError: the folder or its manifest is not as described.
    """
    if (root / MANIFEST).exists():
        return _from_manifest(root)
    return _from_folders(root, fewest_classes)


def _from_folders(root: Path, fewest_classes: int) -> Listing:
    folders = []
    for entry in _entries(root):
        if stat.S_ISDIR(_status(entry).st_mode):
            folders.append(entry)
        elif entry.suffix.lower() in SUFFIXES:
            raise ValueError(
                f"{shown(entry)}: expected images in one sub-folder a class, found one outside"
            )
    if not folders:
        raise ValueError(
            f"{shown(root)}: expected one sub-folder a class, or a {MANIFEST}, found none"
        )
    if len(folders) < fewest_classes:
        raise ValueError(
            f"{shown(root)}: expected two classes or more, found only {shown(folders[0].name)!r}"
        )
    files, labels = [], []
    for folder in folders:
        name, inside = label(folder.name, shown(folder)), _entries(folder)
        if not inside:
            raise ValueError(f"{shown(folder)}: expected images of this class, found none")
        files += inside
        labels += [name] * len(inside)
    return Listing(files, labels, {})


def _entries(folder: Path) -> list[Path]:
    """Contents in natural order, without hidden files and what desktops and servers leave."""
    try:
        names = os.listdir(folder)
    except OSError as error:
        raise ValueError(
            f"{shown(folder)}: expected a readable folder, found: {error.strerror}"
        ) from error
    names = [name for name in names if name[0] != "." and name.lower() not in _IGNORED]
    return [folder / name for name in sorted(names, key=natural_key)]


def _status(path: Path) -> os.stat_result:
    try:
        return path.stat()
    except OSError as error:
        raise ValueError(
            f"{shown(path)}: expected a file or folder, found: {error.strerror}"
        ) from error


def _from_manifest(root: Path) -> Listing:
    table = root / MANIFEST
    files, labels, rows, seen = [], [], [], set()
    for where, row in read_csv(table, required=("file", "label")):
        relative = PurePosixPath(row["file"])
        if not row["file"] or relative.is_absolute() or ".." in relative.parts:
            raise ValueError(f"{where}: expected a path inside the folder, found {row['file']!r}")
        if relative in seen:
            raise ValueError(f"{where}: expected each file once, found {row['file']!r} again")
        labels.append(label(row["label"], where))
        seen.add(relative)
        rows.append(row)
        files.append(root / relative)
    columns = {name: _column([row[name] for row in rows]) for name in rows[0]}
    check_times(table, columns, len(rows))
    classes = None
    if "class_index" in columns:
        classes = _class_order(table, labels, columns.pop("class_index"))
    properties = {k: v for k, v in columns.items() if k not in ("file", "label")}
    return Listing(files, labels, properties, classes)


def _column(values: list[str]) -> np.ndarray:
    """Integers if all are, else finite numbers if all are, else text."""
    for kind in (np.int64, np.float64):
        try:
            numbers = np.array(values).astype(kind)
        except (ValueError, OverflowError):
            continue
        if np.isfinite(numbers).all():
            return numbers
    return np.array([shown(value) for value in values])


def _class_order(table: Path, labels: list[str], index: np.ndarray) -> list[str]:
    pairs = set(zip(index.tolist(), labels, strict=True))
    if index.dtype.kind != "i" or sorted(i for i, _ in pairs) != list(range(len(set(labels)))):
        raise ValueError(
            f"{shown(table)}: expected one class_index a label, 0 … {len(set(labels)) - 1}, "
            f"found {shown(sorted(pairs)[:8])}"
        )
    return [label for _, label in sorted(pairs)]


def image_files(root: Path) -> list[Path]:
    """Every image of a folder and its sub-folders, in natural order; no folder that is a link.

    Raises:
        ValueError: there is none, or the folder cannot be read.
    """
    found: list[Path] = []
    waiting = [root]
    while waiting:
        path = waiting.pop()
        if path == root or (path.is_dir() and not path.is_symlink()):
            waiting += reversed(_entries(path))
        elif path.suffix.lower() in SUFFIXES:
            found.append(path)
    if not found:
        raise ValueError(f"{shown(root)}: expected images ({', '.join(SUFFIXES)}), found none")
    return found
