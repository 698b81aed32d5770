"""Arrays of HDF5, and of MATLAB's .mat of version 7.3, read from disk as frames are asked for."""

from __future__ import annotations

import math
from functools import partial
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from hdc.readers.files import BadFrame
from hdc.readers.store import OnDisk, Store, not_plain


def load(path: Path) -> Store:
    """The arrays of a file of HDF5, or of MATLAB's version 7.3.

    Attributes of groups, such as the label of a trial, are among them.
    """
    file = h5py.File(path, "r", rdcc_nbytes=2**26)  # chunks of several frames
    is_matlab = path.suffix.lower() == ".mat"
    store = Store(_attributes(file, ""), frames_last=is_matlab)
    names: list[str] = []
    file.visit(names.append)  # each object once; no links to other files
    for name in names:
        if name.startswith("#"):  # MATLAB's #refs# have one for each cell of text
            continue
        item = file[name]
        if isinstance(item, h5py.Group):
            store.arrays |= _attributes(item, f"{name}/")
        elif isinstance(item, h5py.Dataset):
            store.frames_last |= "MATLAB_class" in item.attrs
            why = _missing_filter(item) or _filled_in(path, item)
            array = None if why else _dataset(path, item)
            if array is None:
                store.unread[name] = why or not_plain(name)
            else:
                store.arrays[name] = array
    return store


def _attributes(group: Any, before: str) -> dict[str, np.ndarray]:
    """A group's single attributes by their paths; names in capitals are of programs."""
    found = {}
    for name, item in group.attrs.items():
        own = np.asarray(item)
        if own.size == 1 and not (name.isupper() or name.startswith("MATLAB")):
            found[f"{before}{name}"] = (
                own.astype(str) if own.dtype.kind in "SO" else own
            )
    return found


def _dataset(path: Path, item: Any) -> Any:
    """A dataset as an array; None where it is none of numbers or text."""
    kind = item.attrs.get("MATLAB_class", b"")
    if {"MATLAB_object_decode", "MATLAB_empty"} & item.attrs.keys():
        return None
    if kind in (b"cell", b"char"):
        return _matlab_text(item, kind)
    texts = _texts(item)
    if texts is not None or item.dtype.kind not in "iufb":
        return texts
    array = OnDisk(item, partial(_read, path, item))
    if len(item.shape) < 2:
        return array[()]
    if kind and len(item.shape) == 2 and 1 in item.shape:
        return array[:].ravel()  # a column or a row of MATLAB
    return array.T if kind else array


def _texts(item: Any) -> np.ndarray | None:
    """The texts of a dataset, or the names of an enumeration; None of numbers."""
    names = h5py.check_enum_dtype(item.dtype)
    if names and len(item.shape) == 1:
        by_number = {number: name for name, number in names.items()}
        return np.array([by_number.get(n, str(n)) for n in item[()].tolist()])
    if h5py.check_string_dtype(item.dtype):
        return np.array(np.ravel(item.asstr()[()]).tolist())
    return None


def _read(path: Path, item: Any, key: Any) -> Any:
    """A part of a dataset; a BadFrame names a filter that is missing, or damage."""
    try:
        return item[key]
    except (OSError, RuntimeError) as error:
        wanted = f"{path}[{item.name[1:]}]: expected a dataset that can be read"
        raise BadFrame(f"{wanted}, found: {error}") from error


def _matlab_text(item: Any, kind: bytes) -> np.ndarray | None:
    """Rows of characters, or a cell array of them; None of other cells."""
    rows: Any = np.atleast_2d(item[()].T)
    if kind == b"cell":
        file = item.file
        cells = [file[reference] for reference in rows.flat]
        if any(cell.attrs.get("MATLAB_class") != b"char" for cell in cells):
            return None
        rows = [cell[()].ravel() for cell in cells]
    return np.array(["".join(map(chr, row)).rstrip() for row in rows])


def _missing_filter(item: Any) -> str:
    """Why the chunks of a dataset cannot be read, if a filter is not installed; or nothing."""
    made = item.id.get_create_plist()
    for number in range(made.get_nfilters()):
        code, _, _, name = made.get_filter(number)
        if not h5py.h5z.filter_avail(code):
            return (
                f"expected a filter that is installed, found {name.decode()} ({code})"
            )
    return ""


def _filled_in(path: Path, item: Any) -> str:
    """Why HDF5 would give numbers that nobody wrote; empty where it would not."""
    sources = _sources(item)
    for name in sources:
        if name != "." and not (path.parent / name).is_file():
            return f"expected its source {name}, found none"
    wanted, found = (0, 0) if sources else _chunks(item)
    if found == wanted:
        return ""
    return f"expected {wanted} chunks, found {found}: the others were not written"


def _sources(item: Any) -> list[str]:
    """Names of the files that a dataset lies in, if in others; "." is its own."""
    if item.is_virtual:
        return [source.file_name for source in item.virtual_sources()]
    return [name for name, *_ in item.external or ()]


def _chunks(item: Any) -> tuple[int, int]:
    """How many chunks a dataset has by its shape, and in its file."""
    if item.chunks is None:
        return int(item.size > 0), int(item.id.get_storage_size() > 0)
    sides = zip(item.shape, item.chunks, strict=True)
    return math.prod(-(-n // side) for n, side in sides), item.id.get_num_chunks()
