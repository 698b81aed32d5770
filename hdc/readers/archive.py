"""An .npz archive: ``frames`` [N, H, W], ``labels`` [N], optional ``classes`` [L].

``frames`` is uint8 or uint16. ``labels`` are integers (indices into ``classes`` if it is there) or
strings; classes without names are in natural order. Any other array [N] of numbers or strings
becomes ``recording.samples[key]``. Array headers are read, and their sizes compared with what the
zip directory says, before an array is unpacked; an array of objects would have to be unpickled and
is refused, and so is an archive of a kind that numpy does not write. Frames that do not fit in
memory are mapped from the file, if it is not compressed.
"""

from __future__ import annotations

import math
import struct
import zipfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache, partial
from pathlib import Path

import numpy as np

from hdc.readers.files import MOST_LETTERS, file_digest, label, shown
from hdc.readers.recording import (
    Recording,
    check_number,
    check_times,
    class_indices,
    in_memory,
)
from hdc.readers.settings import Options, SettingError

_READ_ALWAYS = ("labels", "classes", "order", "session")  # refused if they are something else
_MOST_DIRECTORY_BYTES = 2**20
"""Of a zip: thousands of entries; each takes some 20 times as many bytes as a Python object."""


@dataclass(frozen=True)
class _Entry:
    """One array of an archive, known from its header."""

    member: zipfile.ZipInfo
    shape: tuple[int, ...]
    dtype: np.dtype
    fortran: bool
    start: int
    """Byte at which the values begin inside the member."""

    @property
    def nbytes(self) -> int:
        return math.prod(self.shape) * self.dtype.itemsize


def open_archive(path: Path, options: Options) -> Recording:
    """Open an .npz; see the module's description.

    Raises:
        ValueError: the archive or one of its arrays is not as described, or is too large.
    """
    with _named(path):
        _check_directory(path)
    with _named(path), zipfile.ZipFile(path) as archive:
        arrays = [member for member in archive.infolist() if member.filename.endswith(".npy")]
        entries = {member.filename.removesuffix(".npy"): member for member in arrays}
        if len(entries) < len(arrays):
            raise ValueError(f"{shown(path)}: expected each array once, found one again")
        if missing := [key for key in ("frames", "labels") if key not in entries]:
            raise ValueError(
                f"{shown(path)}: expected arrays frames and labels, found no {missing[0]}"
            )
        frames = _header(path, archive, "frames", entries["frames"])
        if len(frames.shape) != 3 or 0 in frames.shape:
            raise ValueError(
                f"{shown(path)}[frames]: expected shape [N, H, W], found {frames.shape}"
            )
        if frames.dtype.kind != "u" or frames.dtype.itemsize > 2:
            raise ValueError(
                f"{shown(path)}[frames]: expected uint8 or uint16, found {frames.dtype}"
            )
        n, height, width = frames.shape
        check_number(path, n)
        if height * width > options.max_pixels:
            raise ValueError(
                f"{shown(path)}[frames]: expected at most {options.max_pixels} pixels "
                f"(max_pixels), found {width} × {height}"
            )
        shape = options.window.shape(height, width)
        columns = {
            key: _header(path, archive, key, member)
            for key, member in entries.items()
            if key in _READ_ALWAYS or (key != "frames" and _is_column(archive, member, n))
        }
        if (total := sum(e.nbytes for e in columns.values())) > options.memory_bytes:
            raise ValueError(
                f"{shown(path)}: expected at most {options.memory_bytes} bytes "
                f"(memory_bytes) beside the frames, found {total}"
            )
        values = {key: _values(path, archive, key, e, options) for key, e in columns.items()}
        classes, labels = _labels(
            path, values.pop("labels"), values.pop("classes", None), n, options
        )
        check_times(path, values, n)
        read = _frames(path, archive, frames, options)
    return Recording(
        classes=classes,
        labels=labels,
        shape=shape,
        samples={"order": np.arange(n), **values},
        read=read,
        digest=cache(partial(file_digest, path)),
        window=options.window,
    )


def _check_directory(path: Path) -> None:
    """Refuse a directory of millions of entries before zipfile makes an object of each."""
    with path.open("rb") as file:
        file.seek(max(0, path.stat().st_size - 2**16 - 22))  # the longest comment, and the record
        tail = file.read()
    plain = tail[-22:-18] == b"PK\5\6"
    at = len(tail) - 22 if plain else tail.rfind(b"PK\5\6")
    (nbytes,) = struct.unpack_from("<I", tail, at + 12)
    if at >= 76 and tail[at - 20 : at - 16] == b"PK\6\7":  # beyond 4 GB: 64 bits, stated before
        (nbytes,) = struct.unpack_from("<Q", tail, at - 76 + 40)
    if nbytes > _MOST_DIRECTORY_BYTES:
        raise ValueError(
            f"a directory of {nbytes} bytes where {_MOST_DIRECTORY_BYTES} are the most"
        )


@contextmanager
def _named(path: Path) -> Iterator[None]:
    """Names the file in whatever zipfile, zlib and numpy say of broken bytes."""
    try:
        yield
    except Exception as error:  # a damaged archive makes them raise a dozen different types
        if isinstance(error, ValueError) and (
            isinstance(error, SettingError) or str(error).startswith(shown(path))
        ):
            raise
        found = shown(error) or type(error).__name__
        raise ValueError(f"{shown(path)}: expected an intact .npz, found: {found}") from error


def _header(path: Path, archive: zipfile.ZipFile, key: str, member: zipfile.ZipInfo) -> _Entry:
    entry = _peek(archive, member)
    if entry.dtype.hasobject:
        raise ValueError(
            f"{shown(path)}[{shown(key)}]: expected numbers or strings, found pickled objects, "
            "which are never loaded"
        )
    if min(entry.shape, default=0) < 0 or entry.start + entry.nbytes != member.file_size:
        raise ValueError(
            f"{shown(path)}[{shown(key)}]: expected {member.file_size - entry.start} bytes as the "
            f"archive says, found an array {entry.shape} of {entry.dtype}"
        )
    return entry


def _peek(archive: zipfile.ZipFile, member: zipfile.ZipInfo) -> _Entry:
    """The header of an array; numpy evaluates it as a literal of bounded length."""
    if member.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
        raise ValueError(f"an array of compression {member.compress_type}")
    with archive.open(member) as file:
        version = np.lib.format.read_magic(file)
        readers = {
            (1, 0): np.lib.format.read_array_header_1_0,
            (2, 0): np.lib.format.read_array_header_2_0,
        }
        if version not in readers:
            raise ValueError(f"an array of format {version}")
        shape, fortran, dtype = readers[version](file)
        return _Entry(member, shape, dtype, fortran, file.tell())


def _is_column(archive: zipfile.ZipFile, member: zipfile.ZipInfo, n: int) -> bool:
    entry = _peek(archive, member)
    return entry.shape == (n,) and entry.dtype.kind in "iufU"


def _values(
    path: Path, archive: zipfile.ZipFile, key: str, entry: _Entry, options: Options
) -> np.ndarray:
    """One array, unpacked; its size is known to be that of its header."""
    if entry.nbytes > options.memory_bytes:
        raise ValueError(
            f"{shown(path)}[{shown(key)}]: expected at most {options.memory_bytes} bytes "
            f"(memory_bytes), found {entry.nbytes}; frames saved by numpy.savez (not "
            "savez_compressed) are read as a stream"
        )
    with archive.open(entry.member) as file:
        array = np.lib.format.read_array(file, allow_pickle=False)
        file.read()  # to the end: zipfile compares the check sum there
    return array.astype(entry.dtype.newbyteorder("="), copy=False)


def _labels(
    path: Path, labels: np.ndarray, names: np.ndarray | None, n: int, options: Options
) -> tuple[tuple[str, ...], np.ndarray]:
    where = f"{shown(path)}[labels]"
    if labels.shape != (n,):
        raise ValueError(f"{where}: expected shape ({n},), one a frame, found {labels.shape}")
    if labels.dtype.kind == "f" and np.isnan(labels).any():
        first = int(np.flatnonzero(np.isnan(labels))[0])
        raise ValueError(f"{where}: expected integers or strings, found NaN at index {first}")
    if labels.dtype.kind not in "iuU":
        raise ValueError(f"{where}: expected integers or strings, found {labels.dtype}")
    if labels.dtype.itemsize > (most := np.dtype(f"U{MOST_LETTERS}").itemsize):
        raise ValueError(f"{where}: expected at most {most} bytes a label, found {labels.dtype}")
    values, index = np.unique(labels, return_inverse=True)
    texts = [label(str(value), where) for value in values.tolist()]
    classes = None
    if names is not None:
        classes = _classes(f"{shown(path)}[classes]", names)
        if labels.dtype.kind == "U":
            unknown = [repr(text) for text in texts if text not in classes]
        else:
            unknown = [str(value) for value in values if not 0 <= value < len(classes)]
            texts = [] if unknown else [classes[value] for value in values.tolist()]
        if unknown:
            raise ValueError(
                f"{where}: expected one of the {len(classes)} classes, found {unknown[0]}"
            )
    return class_indices([texts[i] for i in index.tolist()], where, options, classes)


def _classes(where: str, names: np.ndarray) -> list[str]:
    if names.ndim != 1 or names.dtype.kind != "U":
        raise ValueError(f"{where}: expected strings [L], found {names.dtype} {names.shape}")
    check_number(where, len(names))
    classes = [label(name, where) for name in names.tolist()]
    if len(set(classes)) < len(classes):
        raise ValueError(f"{where}: expected different names, found one again")
    return classes


def _frames(
    path: Path, archive: zipfile.ZipFile, entry: _Entry, options: Options
) -> Callable[[np.ndarray], np.ndarray]:
    window, native = options.window, entry.dtype.newbyteorder("=")
    if entry.nbytes <= options.memory_bytes:
        frames = _values(path, archive, "frames", entry, options)
        whole = window.crop is None and window.subsample == 1
        # Without a copy, a small window would keep all of the frames in memory.
        return in_memory(frames if whole else np.stack([window.of(image) for image in frames]))
    if entry.member.compress_type != zipfile.ZIP_STORED or entry.fortran:
        _values(path, archive, "frames", entry, options)  # raises: too large to unpack
        raise ValueError(f"{shown(path)}[frames]: expected rows of pixels, found columns")
    with archive.open(entry.member) as file:
        while file.read(2**24):  # to the end: zipfile compares the check sum there
            pass
    mapped = np.memmap(path, entry.dtype, "r", _offset(path, entry), entry.shape)
    # Frame by frame, so that only the pixels of the window are copied.
    return lambda index: (
        np.stack([window.of(mapped[i]) for i in index]).astype(native, copy=False)
        if len(index)
        else np.empty((0, *window.shape(*entry.shape[1:])), native)
    )


def _offset(path: Path, entry: _Entry) -> int:
    """Byte of the file at which an uncompressed member's values begin (after its local header)."""
    with path.open("rb") as file:
        file.seek(entry.member.header_offset)
        name, extra = struct.unpack("<26xHH", file.read(30))
    return entry.member.header_offset + 30 + name + extra + entry.start
