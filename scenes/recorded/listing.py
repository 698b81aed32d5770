"""Which files of a folder belong to the scene, and which class each is of.

Without a manifest.csv every sub-folder is a class, and every file in it an image of that class;
classes and files are in natural order (frame2 before frame10).

With one, its rows say which files belong to the scene and in which order. Columns: ``file``
(relative to the folder), ``label`` (name of the class), optional ``class_index`` (position of that
class among the classes, 0 … L − 1; without it they are in natural order), optional ``order`` (place
in time); any other column becomes ``scene.samples[column]``.
"""

from __future__ import annotations

import os
import stat
from dataclasses import dataclass
from pathlib import Path, PurePosixPath

import numpy as np

from scenes.recorded.files import label, natural_key, read_csv, shown
from scenes.recorded.header import SUFFIXES
from scenes.recorded.scene import check_times

MANIFEST = "manifest.csv"


@dataclass(frozen=True)
class Listing:
    """Files of a folder, their class names and properties, [N] each; classes in their order."""

    files: list[Path]
    labels: list[str]
    properties: dict[str, np.ndarray]
    classes: list[str] | None = None


def list_folder(root: Path) -> Listing:
    """Files of a folder as its manifest or its sub-folders say.

    Raises:
        ValueError: the folder or its manifest is not as described.
    """
    return _from_manifest(root) if (root / MANIFEST).exists() else _from_folders(root)


def _from_folders(root: Path) -> Listing:
    folders = []
    for entry in _entries(root):
        if stat.S_ISDIR(_status(entry).st_mode):
            folders.append(entry)
        elif entry.suffix.lower() in SUFFIXES:
            raise ValueError(
                f"{shown(entry)}: expected images in one sub-folder a class, found one outside"
            )
    if not folders:
        raise ValueError(f"{shown(root)}: expected one sub-folder a class, found none")
    if len(folders) == 1:
        raise ValueError(
            f"{shown(root)}: expected two classes or more, found only {shown(folders[0].name)!r}"
        )
    files, labels = [], []
    for folder in folders:
        inside = _entries(folder)
        if not inside:
            raise ValueError(f"{shown(folder)}: expected images of this class, found none")
        files += inside
        labels += [shown(folder.name)] * len(inside)
    return Listing(files, labels, {})


def _entries(folder: Path) -> list[Path]:
    """Contents in natural order, without hidden files and what desktops leave behind."""
    try:
        names = os.listdir(folder)
    except OSError as error:
        raise ValueError(
            f"{shown(folder)}: expected a readable folder, found: {error.strerror}"
        ) from error
    ignored = ("thumbs.db", "desktop.ini")
    names = [name for name in names if name[0] != "." and name.lower() not in ignored]
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
    rows = read_csv(table, required=("file", "label"))
    files, labels, seen = [], [], set()
    for line, row in enumerate(rows, start=2):
        relative = PurePosixPath(row["file"])
        if not row["file"] or relative.is_absolute() or ".." in relative.parts:
            raise ValueError(
                f"{shown(table)}, row {line}: expected a path inside the folder, "
                f"found {row['file']!r}"
            )
        if relative in seen:
            raise ValueError(
                f"{shown(table)}, row {line}: expected each file once, found {row['file']!r} again"
            )
        labels.append(label(row["label"], f"{shown(table)}, row {line}"))
        seen.add(relative)
        files.append(root / relative)
    columns = {name: _column([row[name] for row in rows]) for name in rows[0]}
    check_times(table, columns)
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
