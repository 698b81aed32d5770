"""Files of a folder that belong to a recording, with the label, values and order of each."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from glob import glob
from pathlib import Path, PurePath, PurePosixPath

import numpy as np

from hdc.readers.files import natural_key, read_csv, require
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
    """N images and what is known of each; names of files that are not among them."""

    files: list[Path]
    labels: list[str] | None
    classes: list[str] | None  # in the order that a manifest gives
    samples: dict[str, np.ndarray]
    values: np.ndarray | None  # float64 [N, k]
    value_names: tuple[str, ...]
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
        SettingError: the template or a column cannot be.
        ValueError: the folder or its table is not as described.
    """
    pattern = None if template is None else template_pattern(template)
    manifest = table is None and pattern is None and (root / MANIFEST).exists()
    where = base = root
    if table is not None or manifest:
        where = Path(table or root / MANIFEST).expanduser()
        where = where if where.exists() or where.is_absolute() else root / where
        required = (
            *(("file", "label") if manifest else (image_column,)),
            *value_columns,
        )
        rows, other_files = _table_rows(where, required, pattern)
        if (where.parent / next(iter(rows), "")).is_file():
            base = where.parent
    else:
        wanted = ", ".join(value_columns)
        require(not wanted, "table", None, f"a table with the columns {wanted}")
        rows, other_files = {}, []
        for file in all_files(root):
            match = (pattern or FOLDERS).fullmatch(file)
            if match and file.lower().endswith(SUFFIXES):
                rows[file] = match.groupdict()
            else:
                other_files.append(file)
    if not rows:
        found = f"{len(other_files)} other files, {', '.join(other_files[:3])}"
        raise ValueError(
            f"{where}: expected images in one sub-folder per class, in a {MANIFEST}, or as the "
            f"template says, found {found if other_files else 'none'}"
        )
    texts = {
        name: [row[name] for row in rows.values()] for name in next(iter(rows.values()))
    }
    labels = texts.pop("label", None)
    samples = _samples(texts)
    check_times(where, samples, len(rows))
    classes = None
    if manifest and labels and "class_index" in samples:
        pairs = set(zip(samples.pop("class_index").tolist(), labels, strict=True))
        classes = [label for _, label in sorted(pairs)]
        if len(classes) > len(set(labels)):
            raise ValueError(
                f"{where}: expected one class_index per label, found {sorted(pairs)}"
            )
    if not value_columns and not manifest:
        known = ("order", "session", "group")
        value_columns = [
            n for n, c in samples.items() if c.dtype.kind != "U" and n not in known
        ]
    for name in value_columns:
        if (column := samples[name]).dtype.kind == "U":
            raise ValueError(f"{where}: expected numbers in {name}, found {column[:9]}")
    if labels is None and not value_columns:
        raise ValueError(
            f"{where}: expected a label of each image, or numbers, found neither"
        )
    return Listing(
        [base / file for file in rows],
        labels,
        classes,
        samples,
        np.stack([samples[n].astype(float) for n in value_columns], 1)
        if value_columns
        else None,
        tuple(value_columns),
        other_files,
    )


def _table_rows(
    table: Path, required: Sequence[str], pattern: re.Pattern[str] | None
) -> tuple[dict[str, dict[str, str]], list[str]]:
    """Values by column of each image, and the files that are not as the template says."""
    rows: dict[str, dict[str, str]] = {}
    other_files = []
    for where, row in read_csv(table, required):
        name = str(PurePosixPath(row.pop(required[0])))
        match = pattern.fullmatch(name) if pattern else None
        if pattern and match is None:
            other_files.append(name)
        elif name in rows:
            raise ValueError(f"{where}: expected each file once, found {name!r} again")
        else:
            rows[name] = row | (match.groupdict() if match else {})
    return rows, other_files


def all_files(root: Path) -> list[str]:
    """Paths of all files below a folder, relative to it, in natural order; no hidden ones."""
    found = glob("**", root_dir=root, recursive=True)
    files = [PurePath(name).as_posix() for name in found if (root / name).is_file()]
    return sorted(
        files, key=lambda file: [natural_key(part) for part in file.split("/")]
    )


def image_files(root: Path) -> list[Path]:
    """Every image of a folder and its sub-folders, in natural order.

    Raises:
        ValueError: there is none.
    """
    files = [root / file for file in all_files(root) if file.lower().endswith(SUFFIXES)]
    if not files:
        raise ValueError(f"{root}: expected images ({', '.join(SUFFIXES)}), found none")
    return files


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
            require(
                not unknown, "template", template, f"fields among {known}, each once"
            )
            pattern += f"(?P<{name}>{FIELDS[name]})"
            seen.append(name)
        else:
            pattern += "[^/]*" if part == "*" else re.escape(part)
    return re.compile(pattern)


def _samples(columns: dict[str, list[str]]) -> dict[str, np.ndarray]:
    """Columns as numbers where they are; sessions and groups of other names by natural rank."""
    samples = {}
    for name, texts in columns.items():
        samples[name] = _column(texts)
        if name in ("session", "group") and samples[name].dtype.kind == "U":
            samples[f"{name}_name"] = samples[name]
            ranks = {
                text: i for i, text in enumerate(sorted(set(texts), key=natural_key))
            }
            samples[name] = np.array([ranks[text] for text in texts])
    return samples


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
