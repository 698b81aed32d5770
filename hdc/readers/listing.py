"""A folder of images: which files belong to it, with the label, values and order of each.

A folder without images may be one of arrays or videos; see :mod:`hdc.readers.gathered`.
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cache
from pathlib import Path, PurePath, PurePosixPath, PureWindowsPath
from typing import NamedTuple

import numpy as np

from hdc.readers import gathered
from hdc.readers.about import Columns, natural_key
from hdc.readers.asked import Asked
from hdc.readers.files import Ambiguous, BadFrame, SettingError, wrong
from hdc.readers.recording import Recording, Window, with_progress
from hdc.readers.table import Rows, read_csv
from hdc.readers.template import Template

MANIFEST = "manifest.csv"
SUFFIXES = (".png", ".jpg", ".jpeg", ".bmp", ".tif", ".tiff")
Reader = Callable[[str], dict[str, str] | None]
"""Texts that the path of an image says, by column; None where it says none."""


class _Listing(NamedTuple):
    """Images as they were found.

    Attributes:
        where: the folder or the table, for errors.
        base: the folder that their names are relative to.
        rows: place and texts of each; its name is the ``file``.
        others: names of files that are not among them.
        notes: which others are left out and why, or how images were found, a phrase each.
    """

    where: Path
    base: Path
    rows: Rows
    others: list[str]
    notes: list[str]

    @property
    def files(self) -> list[Path]:
        return [self.base / row["file"] for _, row in self.rows]

    def only(self, kept: Sequence[bool], lack: str) -> _Listing:
        """Those that are kept; what the others lack is noted."""
        if all(kept):
            return self
        n, first = len(kept), self.rows[kept.index(False)][1]["file"]
        lacking = (
            f"left out: {n - sum(kept)} of {n} images are {lack}, the first {first}"
        )
        rows = [row for row, keep in zip(self.rows, kept, strict=True) if keep]
        return self._replace(rows=rows, notes=[*self.notes, lacking])


def open_frames(root: Path, window: Window, asked: Asked) -> Recording:
    """Open the frames of a folder: its images, or else its files of arrays and videos.

    Images are listed by its table or manifest, a template, or sub-folders. With ``check`` every
    one is decoded at once.

    Raises:
        BadFrame: a file is no usable image, or its size or depth is not that of the first.
        SettingError: the template or a column cannot be, or a path has two readings.
        ValueError: the folder or its table is not as described, or a folder in it is a link.
    """
    listing, values = _listed(root, asked)
    if not listing.rows and asked.table is None:
        others = [file for file in listing.others if not is_image(file)]
        if files := gathered.files_of(root, others, asked.template):
            return gathered.open_files(root, files, listing.others, window, asked)
    if values is None and asked.named:
        wanted = f"a table with the columns {', '.join(asked.named)}"
        raise wrong("table", None, wanted)
    for name in ("axes", "labels", "frames"):
        if setting := getattr(asked, name):
            wanted = f"null unless {root} is a folder of arrays or videos"
            raise wrong(name, setting, wanted)
    return _of_images(root, listing, values, window, asked)


def _of_images(
    root: Path,
    listing: _Listing,
    values: Sequence[str] | None,
    window: Window,
    asked: Asked,
) -> Recording:
    from hdc.readers.images import Images, ahead, decode, is_whole  # OpenCV

    if asked.skip_damaged:
        whole = ahead(is_whole, listing.files)
        shown = with_progress(whole, len(listing.rows), "Looking for damage")
        listing = listing.only([*shown], "damaged")
    if not listing.rows:
        raise ValueError(_nothing_found(listing))
    files = listing.files
    for _, row in listing.rows:
        del row["file"]
    columns = Columns.of_rows(listing.where, listing.rows).known_as(asked)
    about = columns.about(values, asked.fewest_classes)
    names = np.array([os.path.relpath(file, root) for file in files])

    def digest() -> str:
        contents = (hashlib.sha256(file.read_bytes()).digest() for file in files)
        return hashlib.sha256(b"".join(contents)).hexdigest()

    def decoded(i: int) -> np.ndarray:
        try:
            return decode(files[i])
        except BadFrame as error:
            advice = "--skip-damaged leaves such images out"
            raise BadFrame(f"{error} ({advice})") from error

    images = Images(len(files), decoded, lambda i: str(files[i]), window)
    if asked.check:
        images.check(asked.memory_bytes)
    return Recording.of(
        replace(about, samples={**about.samples, "file": names}),
        images,
        window,
        digest=cache(digest),
        image_shape=images.size,
        other_files=tuple(listing.others),
        notes=tuple(listing.notes),
    )


def _listed(root: Path, asked: Asked) -> tuple[_Listing, Sequence[str] | None]:
    """The images of a folder, and which of their columns are values."""
    read = None if asked.template is None else Template(asked.template).read
    manifest = root / MANIFEST
    if asked.table is not None:
        table = asked.table if asked.table.exists() else root / asked.table
        rows = _table_rows(table, asked.image_column, asked.named)
        return _of_table(root, table, rows, read, asked), asked.values
    if read is None and manifest.exists():
        rows = _table_rows(manifest, "file", ("file", "label", *asked.named))
        return _of_table(root, manifest, rows, read, asked), asked.named
    files = all_files(root)
    rows = [(str(root / file), {"file": file}) for file in files if is_image(file)]
    others = [file for file in files if not is_image(file)]
    by = read or _by_folders(root, files, asked.fewest_classes)
    return _Listing(root, root, *_read(rows, others, by), []), None


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
    root: Path, table: Path, rows: Rows, read: Reader | None, asked: Asked
) -> _Listing:
    """The images of a table: beside it, in the folder, or there under another path."""
    rows, others = _read(rows, [], read or (lambda _: {}))
    found = _Listing(table, _base(root, table, rows), rows, others, [])
    if not any(file.is_file() for file in found.files):
        found = _moved(root, found)
    return _there(found, asked.skip_missing)


def _moved(root: Path, listing: _Listing) -> _Listing:
    """The same with files of the same names in a folder, such as one that came from another disk;
    as it is where a name is not there once."""
    places: dict[str, list[str]] = {}
    for parent, _, names in os.walk(root):
        for name in names:
            own = os.path.relpath(Path(parent, name), root)
            places.setdefault(name, []).append(own)
    rows = []
    for place, row in listing.rows:
        files = places.get(PureWindowsPath(row["file"]).name, [])
        if len(files) != 1:
            return listing
        rows.append((place, {**row, "file": files[0]}))
    if not rows:
        return listing
    stated, found = (some[0][1]["file"] for some in (listing.rows, rows))
    note = f"images found by their names: {stated} is {found}"
    return listing._replace(base=root, rows=rows, notes=[note])


def _read(rows: Rows, others: list[str], read: Reader) -> tuple[Rows, list[str]]:
    """Rows with what their names say, and names of all others: those that do not say it."""
    kept = []
    for place, row in rows:
        fields = read(row["file"])
        if fields is None:
            others.append(row["file"])
        else:
            kept.append((place, row | fields))
    return kept, others


def _there(listing: _Listing, skip_missing: bool) -> _Listing:
    """Rows of a table whose images are there.

    Raises:
        ValueError: others are not skipped, or a file is there twice, by whatever spelling.
    """
    where, n = listing.where, len(listing.rows)
    found = listing.only([file.is_file() for file in listing.files], "missing")
    if n and not found.rows:
        raise ValueError(
            f"{where}: expected images that it names beside it or in the folder, found none of "
            f"{n}, the first {listing.rows[0][1]['file']}"
        )
    if found is not listing and not skip_missing:
        missing = found.notes[-1].removeprefix("left out: ")
        raise ValueError(
            f"{where}: expected every image, found that {missing} (--skip-missing leaves "
            "them out)"
        )
    folder_of = cache(os.path.realpath)
    seen = set()
    for (place, row), path in zip(found.rows, found.files, strict=True):
        file = (folder_of(path.parent), path.name)
        if file in seen:
            raise ValueError(
                f"{place}: expected each file once, found {row['file']!r} again"
            )
        seen.add(file)
    return found


def _base(root: Path, table: Path, rows: Rows) -> Path:
    """The folder that paths in a table are relative to: its own, or that of the recording.

    The first image that is there decides.

    Raises:
        ValueError: each of the two folders has an image of that name.
    """
    for _, row in rows:
        beside, inside = table.parent / row["file"], root / row["file"]
        if not beside.is_file():
            continue
        if inside.is_file() and not inside.samefile(beside):
            raise ValueError(
                f"{table}: expected images beside it or in {root}, found {row['file']} in both"
            )
        return table.parent
    return root


def _by_folders(root: Path, files: Sequence[str], fewest_classes: int) -> Reader:
    """Reads the class of an image: its folder.

    Where no class is needed, images that all lie in the folder itself have none.

    Raises:
        Ambiguous: every image in a folder lies in one of folders: which is the class?
        SettingError: images lie at several depths.
    """
    inside = [file for file in files if is_image(file) and "/" in file]
    depths = {file.count("/") for file in inside}
    if min(depths, default=1) > 1 and len(depths) > 1:
        deepest = max(inside, key=lambda file: file.count("/"))
        raise SettingError(
            f"{root}: expected images in folders of one depth, found {inside[0]} and {deepest} "
            "(a manifest.csv names each)"
        )
    if min(depths, default=1) > 1:
        rest = "/*" * (min(depths) - 1)
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
        shown = [name for name in names if not name.startswith(".")]
        if before and not folders and not shown:
            files.append(before)
        files += [f"{before}{name}/" for name in folders if name.startswith(".")]
        folders[:] = [name for name in folders if not name.startswith(".")]
        for folder in (Path(parent, name) for name in folders):
            if folder.is_symlink():
                raise ValueError(
                    f"{folder}: expected a folder, found a link to {os.readlink(folder)}, whose "
                    "files might count twice; put the folder itself here, or take the link away"
                )
        files += [before + name for name in shown]
    return sorted(files, key=lambda file: [*map(natural_key, file.split("/"))])


def _raise(error: OSError) -> None:
    raise error


def is_image(file: str) -> bool:
    """Whether the name is that of an image."""
    return file.lower().endswith(SUFFIXES)


def _nothing_found(listing: _Listing) -> str:
    """Why a folder or table gives no images."""
    where, others = listing.where, listing.others
    wanted = (
        f"images in one sub-folder per class, in a {MANIFEST}, or as the template says"
    )
    found = f"{len(others)} other files, {', '.join(others[:3])}" if others else "none"
    if where.is_dir():
        wanted += " (of the folder of one class give the one above)"
    return f"{where}: expected {wanted}, found {found}"
