"""Files of a folder that belong to a recording, with the label, values and order of each."""

from __future__ import annotations

import os
import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path, PurePosixPath

import numpy as np

from hdc.readers.files import SettingError, label, natural_key, read_csv, require, shown
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
    return _from_template(root, pattern) if pattern else _from_folders(root)


def all_files(root: Path) -> list[str]:
    """Paths of all files below a folder, relative to it, in natural order; no hidden ones."""
    files: list[str] = []
    seen: set[str] = set()

    def refuse(error: OSError) -> None:
        raise ValueError(
            f"{shown(error.filename)}: expected a readable folder, found: {error.strerror}"
        ) from error

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
        ValueError: there is none, or a folder cannot be read.
    """
    files = [root / file for file in all_files(root) if is_image(file)]
    if not files:
        raise ValueError(f"{shown(root)}: expected images ({', '.join(SUFFIXES)}), found none")
    return files


def is_image(file: str) -> bool:
    return file.lower().endswith(SUFFIXES)


def _from_folders(root: Path) -> Listing:
    files = all_files(root)
    inside = [file for file in files if is_image(file) and "/" in file]
    if not inside:
        raise ValueError(
            f"{shown(root)}: expected images in one sub-folder a class, a {MANIFEST}, or a "
            f"template, found {'images in no sub-folder' if any(map(is_image, files)) else 'none'}"
        )
    labels = [label(file.split("/")[0], shown(root / file)) for file in inside]
    other_files = sorted(set(files) - set(inside), key=natural_key)
    return Listing([root / file for file in inside], labels, {}, other_files=other_files)


# Templates ---------------------------------------------------------------------------------------


def template_pattern(template: str) -> re.Pattern[str]:
    """Regular expression of a template such as ``{session}/{label}/*_{order}.png``.

    Fields are ``label``, ``session`` and ``group`` (any text within a name), ``order`` and
    ``value`` (numbers); ``*`` is any text within a name.

    Raises:
        SettingError: a field is unknown or there twice, or none says what to learn.
    """
    known = ", ".join(f"{{{name}}}" for name in FIELDS)
    pattern, seen = "", []
    for part in re.split(r"(\{[^{}]*\}|\*)", template):
        if part.startswith("{"):
            name = part[1:-1]
            unknown = name not in FIELDS or name in seen
            require(not unknown, "template", template, f"fields among {known}, each once")
            pattern += f"(?P<{name}>{FIELDS[name]})"
            seen.append(name)
        else:
            require("{" not in part and "}" not in part, "template", template, "whole fields")
            pattern += "[^/]*" if part == "*" else re.escape(part)
    return re.compile(pattern.removeprefix(re.escape("./")))


def _from_template(root: Path, pattern: re.Pattern[str]) -> Listing:
    files, fields, other_files = [], [], []
    for file in all_files(root):
        match = pattern.fullmatch(file) if is_image(file) else None
        if match is None:
            other_files.append(file)
        else:
            files.append(file)
            fields.append(match.groupdict())
    if not {"label", "value"} & set(pattern.groupindex):
        raise SettingError("template: expected a field {label} or {value}, or a table, found none")
    if not files:
        raise ValueError(
            f"{shown(root)}: expected images whose path is as the template says, found none in "
            f"{len(other_files)} files, such as {shown((*other_files, 'none')[0])}"
        )
    columns = _transposed(fields)
    labels, values = columns.pop("label", None), columns.pop("value", None)
    for text, file in zip(labels or [], files, strict=labels is not None):
        label(text, shown(root / file))
    return Listing(
        [root / file for file in files],
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


# Tables ------------------------------------------------------------------------------------------


def _from_table(
    root: Path,
    table: Path,
    image_column: str,
    value_columns: Sequence[str],
    pattern: re.Pattern[str] | None,
) -> Listing:
    manifest = image_column == "file" and table == root / MANIFEST
    required = (image_column, *["label"] * manifest, *value_columns)
    names: list[str] = []
    seen: set[str] = set()
    rows, other_files = [], []
    for where, row in read_csv(table, required=required):
        name = row.pop(image_column)
        path = PurePosixPath(name)
        if not name or path.is_absolute() or ".." in path.parts:
            raise ValueError(f"{where}: expected a path inside the folder, found {name!r}")
        match = pattern.fullmatch(str(path)) if pattern else None
        if pattern and match is None:
            other_files.append(name)
            continue
        row |= match.groupdict() if match else {}
        if "label" in row:
            label(row["label"], where)
        if str(path) in seen:
            raise ValueError(f"{where}: expected each file once, found {name!r} again")
        seen.add(str(path))
        names.append(str(path))
        rows.append(row)
    if not names:
        raise ValueError(f"{shown(table)}: expected an image as the template says, found none")
    texts = _transposed(rows)
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
            raise ValueError(f"{shown(table)}: expected numbers in {name}, found {column[:9]}")
    if labels is None and not value_columns:
        raise ValueError(f"{shown(table)}: expected a column label or one of numbers, found none")
    check_times(table, columns, len(rows))
    beside = table.parent if (table.parent / names[0]).exists() else root
    return Listing(
        [beside / path for path in names],
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
    return np.array([shown(text) for text in texts])


def _class_order(table: Path, labels: list[str], index: np.ndarray) -> list[str]:
    pairs = set(zip(index.tolist(), labels, strict=True))
    if index.dtype.kind != "i" or sorted(i for i, _ in pairs) != list(range(len(set(labels)))):
        raise ValueError(
            f"{shown(table)}: expected one class_index a label, 0 … {len(set(labels)) - 1}, "
            f"found {shown(sorted(pairs)[:8])}"
        )
    return [text for _, text in sorted(pairs)]
