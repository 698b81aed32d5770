"""Files of a folder that belong to a recording, with the label, values and order of each."""

from __future__ import annotations

import os
import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path, PurePosixPath

import numpy as np

from hdc.readers.files import SettingError, natural_key, read_csv, require
from hdc.readers.recording import check_times

MANIFEST = "manifest.csv"
SUFFIXES = (".png", ".jpg", ".jpeg", ".bmp", ".tif", ".tiff")
FIELDS = {
    "label": r"[^/]+?",
    "session": r"[^/]+?",
    "group": r"[^/]+?",
    "order": r"\d+(?:\.\d+)?",
    "value": r"[-+]?\d+(?:\.\d+)?",
}
"""Fields of a template, and what each may be in a file's path."""
FOLDERS = re.compile(r"(?P<label>[^/]+)/.+")
"""Paths where the first folder is the class."""


@dataclass(frozen=True)
class Listing:
    """Files and what is known of each, [N]; names of files that are not among them."""

    files: list[Path]
    labels: list[str] | None
    samples: dict[str, np.ndarray]
    classes: list[str] | None = None
    values: np.ndarray | None = None
    value_names: tuple[str, ...] = ()
    other_files: list[str] = field(default_factory=list)


def list_folder(
    root: Path,
    template: str | None = None,
    table: str | Path | None = None,
    image_column: str = "image",
    value_columns: Sequence[str] = (),
) -> Listing:
    """List the files of a folder by its table or manifest, by a template, or by its sub-folders.

    Raises:
        SettingError: the template or a column cannot be.
        ValueError: the folder or its table is not as described.
    """
    pattern = None if template is None else template_pattern(template)
    if table is not None:
        path = Path(table).expanduser()
        path = path if path.exists() or path.is_absolute() else root / path
        return _from_table(root, path, image_column, value_columns, pattern)
    if pattern is None and (root / MANIFEST).exists():
        return _from_table(root, root / MANIFEST, "file", value_columns, None)
    if value_columns:
        raise SettingError(
            f"table: expected a table with the columns {', '.join(value_columns)}, found none"
        )
    return _from_paths(root, pattern)


def all_files(root: Path) -> list[str]:
    """Paths of all files below a folder, relative to it, in natural order; no hidden ones."""
    files: list[str] = []
    seen: set[str] = set()

    def refuse(error: OSError) -> None:
        raise error

    for folder, folders, names in os.walk(root, onerror=refuse, followlinks=True):
        if (real := os.path.realpath(folder)) in seen:  # a link back to a folder above
            folders.clear()
            continue
        seen.add(real)
        folders[:] = [name for name in folders if not _hidden(name)]
        relative = PurePosixPath(Path(folder).relative_to(root))
        files += [str(relative / name) for name in names if not _hidden(name)]
    return sorted(files, key=lambda file: [natural_key(part) for part in file.split("/")])


def _hidden(name: str) -> bool:
    return name[0] == "." or name.lower() in ("thumbs.db", "desktop.ini", "__macosx", "@eadir")


def image_files(root: Path) -> list[Path]:
    """Every image of a folder and its sub-folders, in natural order.

    Raises:
        ValueError: there is none.
    """
    files = [root / file for file in all_files(root) if is_image(file)]
    if not files:
        raise ValueError(f"{root}: expected images ({', '.join(SUFFIXES)}), found none")
    return files


def is_image(file: str) -> bool:
    return file.lower().endswith(SUFFIXES)


def template_pattern(template: str) -> re.Pattern[str]:
    """Regular expression of a template such as ``{session}/{label}/*_{order}.png``.

    Fields are ``label``, ``session`` and ``group`` (any text within a name), ``order`` and
    ``value`` (numbers); ``*`` is any text within a name.

    Raises:
        SettingError: a field is unknown or there twice, or none says what to learn.
    """
    known = ", ".join(f"{{{name}}}" for name in FIELDS)
    pattern, seen = "", []
    for part in re.split(r"(\{[^{}]*\}|\*)", template.removeprefix("./")):
        if part.startswith("{") and part.endswith("}"):
            name = part[1:-1]
            unknown = name not in FIELDS or name in seen
            require(not unknown, "template", template, f"fields among {known}, each once")
            pattern += f"(?P<{name}>{FIELDS[name]})"
            seen.append(name)
        else:
            pattern += "[^/]*" if part == "*" else re.escape(part)
    return re.compile(pattern)


def _from_paths(root: Path, pattern: re.Pattern[str] | None) -> Listing:
    """Images whose path matches; without a pattern, in one sub-folder a class."""
    files, rows, other_files = [], [], []
    for file in all_files(root):
        match = (pattern or FOLDERS).fullmatch(file) if is_image(file) else None
        if match is None:
            other_files.append(file)
        else:
            files.append(root / file)
            rows.append(match.groupdict())
    if pattern and not {"label", "value"} & set(pattern.groupindex):
        raise SettingError("template: expected a field {label} or {value}, or a table, found none")
    if not files:
        expected = "images whose path is as the template says"
        if not pattern:
            expected = f"images in one sub-folder a class, a {MANIFEST}, or a template"
        found = f"{len(other_files)} other files, {', '.join(other_files[:3])}"
        raise ValueError(f"{root}: expected {expected}, found {found if other_files else 'none'}")
    columns = _transposed(rows)
    labels, values = columns.pop("label", None), columns.pop("value", None)
    return Listing(
        files,
        labels,
        _samples(columns),
        values=np.array(values, dtype=float)[:, None] if values else None,
        value_names=("value",) if values else (),
        other_files=other_files,
    )


def _samples(columns: dict[str, list[str]]) -> dict[str, np.ndarray]:
    """Columns as numbers where they are; sessions and groups of other names by natural rank."""
    samples = {}
    for name, texts in columns.items():
        samples[name] = _column(texts)
        if name in ("session", "group") and samples[name].dtype.kind == "U":
            samples[f"{name}_name"] = samples[name]
            ranks = {text: i for i, text in enumerate(sorted(set(texts), key=natural_key))}
            samples[name] = np.array([ranks[text] for text in texts])
    return samples


def _transposed(rows: list[dict[str, str]]) -> dict[str, list[str]]:
    return {name: [row[name] for row in rows] for name in rows[0]}


def _from_table(
    root: Path,
    table: Path,
    image_column: str,
    value_columns: Sequence[str],
    pattern: re.Pattern[str] | None,
) -> Listing:
    manifest = image_column == "file" and table == root / MANIFEST
    required = (image_column, *["label"] * manifest, *value_columns)
    rows: dict[str, dict[str, str]] = {}
    other_files = []
    for where, row in read_csv(table, required):
        name = str(PurePosixPath(row.pop(image_column)))
        match = pattern.fullmatch(name) if pattern else None
        if pattern and match is None:
            other_files.append(name)
            continue
        if name in rows:
            raise ValueError(f"{where}: expected each file once, found {name!r} again")
        rows[name] = row | (match.groupdict() if match else {})
    if not rows:
        raise ValueError(f"{table}: expected an image as the template says, found none")
    texts = _transposed(list(rows.values()))
    labels = texts.pop("label", None)
    columns = _samples(texts)
    classes = None
    if manifest and "class_index" in columns:
        classes = _class_order(table, labels or [], columns.pop("class_index"))
    if not value_columns and not manifest:
        known = ("order", "session", "group")
        value_columns = [n for n, c in columns.items() if c.dtype.kind != "U" and n not in known]
    for name in value_columns:
        if (column := columns[name]).dtype.kind == "U":
            raise ValueError(f"{table}: expected numbers in {name}, found {column[:9]}")
    if labels is None and not value_columns:
        raise ValueError(f"{table}: expected a column label or one of numbers, found none")
    check_times(table, columns, len(rows))
    beside = table.parent if (table.parent / next(iter(rows))).exists() else root
    return Listing(
        [beside / path for path in rows],
        labels,
        columns,
        classes,
        np.stack([columns[n].astype(float) for n in value_columns], 1) if value_columns else None,
        tuple(value_columns),
        other_files,
    )


def _column(texts: list[str]) -> np.ndarray:
    """Integers if all are, else finite numbers if all are, else text."""
    for kind in (np.int64, np.float64):
        try:
            numbers = np.array(texts).astype(kind)
        except (ValueError, OverflowError):
            continue
        if np.isfinite(numbers).all():
            return numbers
    return np.array(texts)


def _class_order(table: Path, labels: list[str], index: np.ndarray) -> list[str]:
    pairs = set(zip(index.tolist(), labels, strict=True))
    if sorted(i for i, _ in pairs) != list(range(len(set(labels)))):
        raise ValueError(
            f"{table}: expected one class_index a label, 0 … {len(set(labels)) - 1}, "
            f"found {sorted(pairs)[:8]}"
        )
    return [text for _, text in sorted(pairs)]
