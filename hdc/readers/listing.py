"""Files of a folder that belong to a recording, with the label, values and order of each."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path, PurePath, PurePosixPath

import numpy as np

from hdc.readers.about import About, Asked, Columns
from hdc.readers.files import Ambiguous, SettingError, natural_key, read_csv, require
from hdc.readers.template import Template

MANIFEST = "manifest.csv"
SUFFIXES = (".png", ".jpg", ".jpeg", ".bmp", ".tif", ".tiff")


@dataclass(frozen=True)
class Listing:
    """N images, what a recording takes of each, and names of files that are not among them."""

    files: list[Path]
    about: About
    other_files: list[str]
    notes: list[str]


@dataclass(frozen=True)
class _Rows:
    """Images as they were found: where each is named, its path, and its texts by column."""

    places: list[str]
    names: list[str]
    texts: list[dict[str, str]]
    other_files: list[str]

    @classmethod
    def none(cls) -> _Rows:
        return cls([], [], [], [])

    def add(self, place: str, name: str, texts: dict[str, str]) -> None:
        self.places.append(place)
        self.names.append(name)
        self.texts.append(texts)

    def only(self, kept: np.ndarray, lack: str, notes: list[str]) -> _Rows:
        """Those of a mask [N]; what the others lack is noted."""
        if kept.all():
            return self
        first, n = int(kept.argmin()), len(kept)
        lacking = f"{n - int(kept.sum())} of {n} images are {lack}"
        notes.append(f"{lacking}, the first {self.names[first]}")
        rows = _Rows([], [], [], self.other_files)
        for k in np.flatnonzero(kept):
            rows.add(self.places[k], self.names[k], self.texts[k])
        return rows


def list_folder(
    root: Path,
    asked: Asked,
    template: str | None = None,
    image_column: str = "image",
    skip_missing: bool = False,
    whole: Callable[[Sequence[Path]], np.ndarray] | None = None,
) -> Listing:
    """List the files of a folder by its table or manifest, by a template, or by its sub-folders.

    ``whole`` says which of N files are whole images; the others are left out.

    Raises:
        SettingError: the template or a column cannot be, or a path has two readings.
        ValueError: the folder or its table is not as described, or a folder in it is a link.
    """
    pattern = None if template is None else Template(template)
    names, values = asked.named, asked.values
    where, base, notes = root, root, list[str]()
    if asked.table is not None:
        where = _table_path(root, asked.table)
        rows = _rows_of_table(where, image_column, names, pattern)
        base = _base(root, where, rows)
        rows = _there(where, base, rows, skip_missing, notes)
    elif pattern is None and (root / MANIFEST).exists():
        where, values = root / MANIFEST, names
        rows = _there(where, base, _rows_of_manifest(where, names), skip_missing, notes)
    else:
        wanted = f"a table with the columns {', '.join(names)}"
        require(not names, "table", None, wanted)
        rows, values = _rows_of_files(root, pattern, asked.fewest_classes), None
    if whole is not None:
        files = [base / name for name in rows.names]
        rows = rows.only(whole(files), "damaged", notes)
    if not rows.names:
        raise ValueError(_nothing_found(where, rows.other_files))
    columns = Columns.of(where, rows.places, rows.texts)
    return Listing(
        files=[base / name for name in rows.names],
        about=columns.about(values, asked.fewest_classes),
        other_files=rows.other_files,
        notes=[f"left out: {note}" for note in notes],
    )


def _there(
    table: Path, base: Path, rows: _Rows, skip_missing: bool, notes: list[str]
) -> _Rows:
    """Rows of a table whose images are there; a ValueError for others, unless they are skipped."""
    found = np.array([(base / name).is_file() for name in rows.names], bool)
    kept = rows.only(found, "missing", notes)
    if len(found) and not found.any():
        raise ValueError(
            f"{table}: expected images that it names beside it or in the folder, found none of "
            f"{len(found)}, the first {rows.names[0]}"
        )
    if notes and not skip_missing:
        raise ValueError(
            f"{table}: expected every image, found that {notes[0]} (--skip-missing leaves them out)"
        )
    _check_once(base, kept)
    return kept


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


def _table_path(root: Path, table: Path) -> Path:
    """The path of a table that is given as it is, or from the folder."""
    if table.exists() or table.is_absolute():
        return table
    return root / table


def _base(root: Path, table: Path, rows: _Rows) -> Path:
    """The folder that paths in a table are relative to: its own, or that of the recording.

    The first image that is there decides.

    Raises:
        ValueError: each of the two folders has an image of that name.
    """
    for name in rows.names:
        beside, inside = table.parent / name, root / name
        if beside.is_file():
            if inside.is_file() and not inside.samefile(beside):
                raise ValueError(
                    f"{table}: expected images beside it or in {root}, found {name} in both"
                )
            return table.parent
        if inside.is_file():
            return root
    return root


def _rows_of_table(
    table: Path,
    image_column: str,
    value_columns: Sequence[str],
    pattern: Template | None,
) -> _Rows:
    """Rows of a table of values, without those that are not as the template says."""
    rows = _Rows.none()
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
        rows.add(place, name, row | fields)
    return rows


def _rows_of_manifest(manifest: Path, value_columns: Sequence[str]) -> _Rows:
    rows = _Rows.none()
    for place, row in read_csv(manifest, ("file", "label", *value_columns)):
        rows.add(place, str(PurePosixPath(row.pop("file"))), row)
    return rows


# Folders -----------------------------------------------------------------------------------------


def _rows_of_files(root: Path, pattern: Template | None, fewest_classes: int) -> _Rows:
    """Images of a folder as the template says, or by sub-folders.

    Where no class is needed, images that all lie in the folder itself have none.
    """
    rows = _Rows.none()
    files = all_files(root)
    images = [file for file in files if is_image(file)]
    read: Callable[[str], dict[str, str] | None]
    read = _label if pattern is None else pattern.read
    if pattern is None:
        _check_depth(root, images)
        if fewest_classes == 0 and not any("/" in file for file in images):
            read = _unlabelled
    for file in files:
        fields = read(file) if is_image(file) else None
        if fields is None:
            rows.other_files.append(file)
            continue
        rows.add(str(root / file), file, fields)
    return rows


def _label(file: str) -> dict[str, str] | None:
    """The first folder is the class."""
    label, slash, _ = file.partition("/")
    return {"label": label} if slash else None


def _unlabelled(_: str) -> dict[str, str]:
    return {}


def _check_depth(root: Path, images: Sequence[str]) -> None:
    """Raise Ambiguous where every image in a folder lies in one of folders: which is the class?"""
    inside = [file for file in images if "/" in file]  # loose ones have no class
    depths = {file.count("/") for file in inside}
    if not depths or min(depths) < 2:
        return
    rest = "/*" * (min(depths) - 1)
    if len(depths) > 1:
        raise SettingError(
            f"{root}: expected images in folders of one depth, found {inside[0]} and "
            f"{max(inside, key=lambda file: file.count('/'))} (a manifest.csv names each)"
        )
    readings = (f"{{label}}/{{group}}{rest}", f"{{session}}/{{label}}{rest}")
    raise Ambiguous(
        f"{root}: folders of folders, such as {inside[0]}",
        [f"--template '{reading}'" for reading in readings],
    )


def all_files(root: Path) -> list[str]:
    """Paths of all files below a folder, relative to it, in natural order; no hidden ones.

    Hidden folders, such as ``.5/``, and those without a visible file are named, with a slash at the
    end.

    Raises:
        ValueError: a folder in it is a link: its files would count twice, or without an end.
        OSError: a folder in it cannot be read.
    """
    files = []
    for parent, folders, names in os.walk(root, onerror=_raise):
        inside = PurePath(parent).relative_to(root).as_posix()
        before = "" if inside == "." else f"{inside}/"
        shown, opened = _visible(names), _visible(folders)
        if before and not folders and not shown:
            files.append(before)
        files += [f"{before}{name}/" for name in set(folders) - set(opened)]
        folders[:] = opened
        for name in folders:
            _check_is_no_link(Path(parent, name))
        files += [before + name for name in shown]
    return sorted(files, key=lambda file: [*map(natural_key, file.split("/"))])


def _visible(names: Sequence[str]) -> list[str]:
    return [name for name in names if not name.startswith(".")]


def _raise(error: OSError) -> None:
    raise error


def _check_is_no_link(folder: Path) -> None:
    if folder.is_symlink():
        raise ValueError(
            f"{folder}: expected a folder, found a link to {os.readlink(folder)}, whose files "
            "might count twice; put the folder itself here, or take the link away"
        )


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
