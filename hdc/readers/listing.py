"""A folder of images: which files belong to it, with the label, values and order of each."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cache
from pathlib import Path, PurePath, PurePosixPath

import numpy as np

from hdc.readers.about import Asked, Columns, natural_key
from hdc.readers.files import Ambiguous, BadFrame, SettingError, wrong
from hdc.readers.recording import Recording, Window, with_progress
from hdc.readers.table import Rows, read_csv
from hdc.readers.template import Template

MANIFEST = "manifest.csv"
SUFFIXES = (".png", ".jpg", ".jpeg", ".bmp", ".tif", ".tiff")


Row = tuple[str, dict[str, str]]


@dataclass
class _Listing:
    """Images as they were found.

    Attributes:
        where: the folder or the table, for errors.
        base: the folder that their names are relative to.
        rows: place and texts of each; its name is the ``file``.
        others: names of files that are not among them.
        notes: why others are left out, a phrase each.
    """

    where: Path
    base: Path
    rows: Rows
    others: list[str]
    notes: list[str] = field(default_factory=list)

    def file(self, row: Row) -> Path:
        return self.base / row[1]["file"]

    def keep(self, kept: Sequence[bool], lack: str) -> None:
        """Leave rows out, and note what they lack."""
        rows = [row for row, keep in zip(self.rows, kept, strict=True) if keep]
        if len(rows) < len(self.rows):
            counted = f"{len(self.rows) - len(rows)} of {len(self.rows)} images"
            first = self.rows[[*kept].index(False)][1]["file"]
            self.notes.append(f"{counted} are {lack}, the first {first}")
        self.rows = rows


def open_frames(root: Path, window: Window, asked: Asked) -> Recording:
    """Open the images of a folder, listed by its table or manifest, a template, or sub-folders.

    With ``check`` every image is decoded at once.

    Raises:
        BadFrame: a file is no usable image, or its size or depth is not that of the first.
        SettingError: the template or a column cannot be, or a path has two readings.
        ValueError: the folder or its table is not as described, or a folder in it is a link.
    """
    from hdc.readers.images import Images, ahead, decode, is_whole  # OpenCV

    listing, values = _listed(root, asked)
    if asked.skip_damaged:
        files = [listing.file(row) for row in listing.rows]
        whole = with_progress(ahead(is_whole, files), len(files), "Looking for damage")
        listing.keep([*whole], "damaged")
    if not listing.rows:
        raise ValueError(_nothing_found(listing))
    files = [listing.file(row) for row in listing.rows]
    columns = Columns.of_rows(listing.where, listing.rows)
    del columns.columns["file"]
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
    return images.recording(
        replace(about, samples={**about.samples, "file": names}),
        digest=cache(digest),
        other_files=tuple(listing.others),
        notes=tuple(f"left out: {note}" for note in listing.notes),
    )


def _listed(root: Path, asked: Asked) -> tuple[_Listing, Sequence[str] | None]:
    """The images of a folder, and which of their columns are values."""
    pattern = None if asked.template is None else Template(asked.template)
    if asked.table is not None:
        table = asked.table
        if not table.exists():
            table = root / table  # which is an absolute one as it is
        rows, others = _rows_of_table(table, asked, pattern)
        listing = _Listing(table, _base(root, table, rows), rows, others)
        _check_there(listing, asked.skip_missing)
        return listing, asked.values
    if pattern is None and (root / MANIFEST).exists():
        rows = read_csv(root / MANIFEST, ("file", "label", *asked.named))
        listing = _Listing(root / MANIFEST, root, rows, [])
        _check_there(listing, asked.skip_missing)
        return listing, asked.named
    if asked.named:
        wanted = f"a table with the columns {', '.join(asked.named)}"
        raise wrong("table", None, wanted)
    return _Listing(root, root, *_rows_of_files(root, pattern, asked)), None


def _check_there(listing: _Listing, skip_missing: bool) -> None:
    """Raise a ValueError for rows of a table whose images are missing, unless they are skipped, and
    for a file that is there twice, by whatever spelling of its folder."""
    where, n = listing.where, len(listing.rows)
    first = listing.rows[0][1]["file"] if n else ""
    listing.keep([listing.file(row).is_file() for row in listing.rows], "missing")
    if n and not listing.rows:
        raise ValueError(
            f"{where}: expected images that it names beside it or in the folder, found none of "
            f"{n}, the first {first}"
        )
    if listing.notes and not skip_missing:
        found = f"{listing.notes[0]} (--skip-missing leaves them out)"
        raise ValueError(f"{where}: expected every image, found that {found}")
    folder_of = cache(os.path.realpath)
    seen = set()
    for place, row in listing.rows:
        path = listing.base / row["file"]
        file = (folder_of(path.parent), path.name)
        if file in seen:
            raise ValueError(
                f"{place}: expected each file once, found {row['file']!r} again"
            )
        seen.add(file)


# Tables ------------------------------------------------------------------------------------------


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
            found = f"{row['file']} in both"
            raise ValueError(
                f"{table}: expected images beside it or in {root}, found {found}"
            )
        return table.parent
    return root


def _rows_of_table(
    table: Path, asked: Asked, pattern: Template | None
) -> tuple[Rows, list[str]]:
    """Rows of a table of values, and names of images that are not as the template says."""
    rows: Rows = []
    others = []
    for place, row in read_csv(table, asked.named):
        if asked.image_column not in row:
            raise ValueError(
                f"{table}: expected different columns, with {asked.image_column}, found "
                f"{[*row]} (--image-column names the column of images)"
            )
        name = str(PurePosixPath(row.pop(asked.image_column)))
        if name == ".":
            raise ValueError(f"{place}: expected a {asked.image_column}, found none")
        fields = {} if pattern is None else pattern.read(name)
        if fields is None:
            others.append(name)
        else:
            rows.append((place, row | fields | {"file": name}))
    return rows, others


# Folders -----------------------------------------------------------------------------------------


def _rows_of_files(
    root: Path, pattern: Template | None, asked: Asked
) -> tuple[Rows, list[str]]:
    """Images of a folder as the template says, or by sub-folders, and all other files.

    Where no class is needed, images that all lie in the folder itself have none.
    """
    files = all_files(root)
    inside = [file for file in files if is_image(file) and "/" in file]
    if pattern is None:
        _check_depth(root, inside)
    unlabelled = pattern is None and asked.fewest_classes == 0 and not inside

    def read(file: str) -> dict[str, str] | None:
        if pattern is not None:
            return pattern.read(file)
        label, slash, _ = file.partition("/")
        return {"label": label} if slash else ({} if unlabelled else None)

    rows: Rows = []
    others = []
    for file in files:
        fields = read(file) if is_image(file) else None
        if fields is None:
            others.append(file)
        else:
            rows.append((str(root / file), fields | {"file": file}))
    return rows, others


def _check_depth(root: Path, inside: Sequence[str]) -> None:
    """Raise Ambiguous where every image in a folder lies in one of folders: which is the class?"""
    depths = {file.count("/") for file in inside}
    if not depths or min(depths) < 2:
        return
    if len(depths) > 1:
        deepest = max(inside, key=lambda file: file.count("/"))
        raise SettingError(
            f"{root}: expected images in folders of one depth, found {inside[0]} and {deepest} "
            "(a manifest.csv names each)"
        )
    rest = "/*" * (min(depths) - 1)
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


def image_files(root: Path) -> list[Path]:
    """Every image of a folder and its sub-folders, in natural order.

    Raises:
        ValueError: there is none, or a folder in it is a link.
    """
    files = [root / file for file in all_files(root) if is_image(file)]
    if not files:
        raise ValueError(f"{root}: expected images ({', '.join(SUFFIXES)}), found none")
    return files


def _nothing_found(listing: _Listing) -> str:
    """Why a folder or table gives no images, and what may have been meant."""
    where, others = listing.where, listing.others
    wanted = (
        f"images in one sub-folder per class, in a {MANIFEST}, or as the template says"
    )
    if where.is_dir() and any(is_image(name) and "/" not in name for name in others):
        above = where.parent if where.name else where.resolve().parent
        wanted += f" (of the folder of one class give the one above, {above})"
    found = f"{len(others)} other files, {', '.join(others[:3])}" if others else "none"
    return f"{where}: expected {wanted}, found {found}"
