"""Files of arrays by name: .npz, .npy, MATLAB's .mat, HDF5, stacks of TIFF. Nothing is unpickled.

An .npz and a .mat of version 5 are read as a whole, the others from disk as frames are asked for.
Vectors are in memory.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from hdc.readers.files import BadFrame

_PLAINLY = "expected numbers or text that are saved plainly, found others"
_ADVICE = (
    "in MATLAB, before saving: cellstr({0}) for text, double({0}) for numbers, "
    "cat(3, {0}{{:}}) for frames in cells"
)


class OnDisk:
    """An array that is read as it is asked for."""

    def __init__(self, like: Any, read: Callable[[Any], Any]) -> None:
        self.shape, self.dtype, self._read = like.shape, like.dtype, read

    def __getitem__(self, key: Any) -> np.ndarray:
        return np.asarray(self._read(key))

    @property
    def T(self) -> OnDisk:
        """With its axes in the other order, as MATLAB shows what it writes to HDF5."""

        def read(key: Any) -> np.ndarray:
            return self[key[::-1] if isinstance(key, tuple) else key].T

        turned = OnDisk(self, read)
        turned.shape = self.shape[::-1]
        return turned


@dataclass
class Store:
    """Arrays of a file.

    Attributes:
        arrays: anything with ``shape``, ``dtype`` and ``[…]``, by name.
        frames_last: MATLAB shows a stack as [H, W, N].
        unread: why arrays that are there are not read, by name.
        axes: of arrays whose file states them, by name.
        notes: how an array was read, by its name.
    """

    arrays: dict[str, Any]
    frames_last: bool = False
    unread: dict[str, str] = field(default_factory=dict)
    axes: dict[str, tuple[str, ...]] = field(default_factory=dict)
    notes: dict[str, list[str]] = field(default_factory=dict)

    def notes_on(self, name: str) -> list[str]:
        """How an array was read, and which others were not."""
        unread = [f"not read: {', '.join(self.unread)}"] if self.unread else []
        return [*self.notes.get(name, []), *unread]

    def advice(self) -> str:
        """Names and reasons of the arrays that are not read; empty if all are."""
        why = "; ".join(f"{name}: {why}" for name, why in self.unread.items())
        return f" (not read: {why})" if why else ""


_LOADED: ContextVar[dict[Path, Store] | None] = ContextVar("loaded", default=None)


@contextmanager
def loaded_once() -> Iterator[None]:
    """Within it a file is loaded once, however often its arrays are asked for."""
    kept = _LOADED.get()
    before = _LOADED.set({} if kept is None else kept)
    try:
        yield
    finally:
        _LOADED.reset(before)


def load(path: Path) -> Store:
    """The arrays of a file.

    Raises:
        ValueError: it is damaged, or of another kind.
    """
    kept = _LOADED.get()
    if kept is None:
        return _load(path)
    if path not in kept:
        kept[path] = _load(path)
    return replace(kept[path], arrays=dict(kept[path].arrays))


def _load(path: Path) -> Store:
    suffix = path.suffix.lower()
    readers = {
        ".mat": _matlab,
        ".npy": _npy,
        ".npz": _npz,
        ".h5": _hdf5,
        ".hdf5": _hdf5,
    }
    try:
        return readers.get(suffix, _tiff)(path)
    except (ImportError, BadFrame):
        raise
    except Exception as error:  # damage makes these libraries raise many types
        # NumPy would have people unpickle what they trust.
        found = str(error).partition(" If you trust")[0] or type(error).__name__
        raise ValueError(
            f"{path}: expected an intact {suffix}, found: {found}"
        ) from error


def _npy(path: Path) -> Store:
    return Store({"frames": _watched(path, np.load(path, mmap_mode="r"))})


def _npz(path: Path) -> Store:
    store = Store({})
    with np.load(path) as archive:
        for name in archive.files:
            try:
                found = archive[name]
            except ValueError as error:
                if "Object arrays" not in str(error):
                    raise
                store.unread[name] = (
                    "expected plain arrays, found Python objects, which are not opened here "
                    f"(if the file is your own, save np.array({name}.tolist()))"
                )
                continue
            if isinstance(found, np.ndarray):
                store.arrays[name] = found
            else:
                store.unread[name] = "expected an .npy, found another file"
    return store


def _tiff(path: Path) -> Store:
    from hdc.readers import tiff

    stacks = tiff.stacks(path)
    return Store(
        {name: _watched(path, stack) for name, stack in stacks.items()},
        axes={name: stack.axes for name, stack in stacks.items()},
        notes={name: stack.notes() for name, stack in stacks.items()},
    )


def _watched(path: Path, array: Any) -> OnDisk:
    """An array on disk that is read as long as its file stays as it was.

    A file that is rewritten meanwhile would end the process with a bus error.
    """

    def state() -> tuple[int, int]:
        status = path.stat()
        return status.st_size, status.st_mtime_ns

    opened = state()

    def read(key: Any) -> Any:
        if state() != opened:
            raise BadFrame(
                f"{path}: expected the file as it was opened, found it rewritten"
            )
        return np.array(array[key])

    return OnDisk(array, read)


# MATLAB and HDF5 ---------------------------------------------------------------------------------


def _matlab(path: Path) -> Store:
    """Version 5 and earlier, by SciPy; version 7.3 is HDF5."""
    from scipy.io import loadmat

    store = Store({}, frames_last=True)
    try:
        found = loadmat(path, simplify_cells=True)
    except NotImplementedError:
        return _hdf5(path)
    _add(store, {k: v for k, v in found.items() if not k.startswith("__")}, "")
    return store


def _add(store: Store, found: dict[str, Any], before: str) -> None:
    """Take arrays of a struct by their paths; an array of structs counts them from 1."""
    for name, item in found.items():
        path = f"{before}{name}"
        if isinstance(item, list) and all(isinstance(one, dict) for one in item):
            item = {str(k): one for k, one in enumerate(item, 1)}
        if isinstance(item, dict):
            _add(store, item, f"{path}/")
            continue
        array = np.asarray(item)
        if array.dtype == object and all(isinstance(c, str) for c in array.flat):
            array = np.array(array.ravel().tolist())  # a cell array of texts
        if array.dtype.kind == "U":
            array = np.asarray(
                np.char.rstrip(array)
            )  # rows of characters are equally long
        if array.dtype.kind not in "iufbU":
            store.unread[path] = f"{_PLAINLY} ({_ADVICE.format(name)})"
        else:
            store.arrays[path] = array


def _hdf5(path: Path) -> Store:
    import h5py

    file = h5py.File(path, "r", rdcc_nbytes=2**26)  # chunks of several frames
    store = Store({}, frames_last=path.suffix.lower() == ".mat")

    for name, item in _datasets(file, "", set(), store.arrays):
        store.frames_last |= "MATLAB_class" in item.attrs
        if why := _filled_in(path, item):
            store.unread[name] = why
            continue
        array = _dataset(path, item)
        if array is None:
            store.unread[name] = f"{_PLAINLY} ({_ADVICE.format(name)})"
        else:
            store.arrays[name] = array
    return store


def _datasets(
    group: Any, before: str, seen: set[Any], stated: dict[str, Any]
) -> Iterator[tuple[str, Any]]:
    """Path and dataset of all in a group, once; MATLAB's #refs# have one for each cell of text.

    Attributes of groups, such as the label of a trial, are added to what is ``stated``; names in
    capitals are reserved for programs.
    """
    import h5py

    for name, item in group.attrs.items():
        own = np.asarray(item)
        own = own.astype(str) if own.dtype.kind in "SO" else own
        if own.size == 1 and not (name.isupper() or name.startswith("MATLAB")):
            stated[f"{before}{name}"] = own
    for name in group:
        is_own = isinstance(group.get(name, getlink=True), h5py.HardLink)
        if name.startswith("#") or not is_own:
            continue
        item = group[name]
        place = h5py.h5o.get_info(item.id)
        if (key := (place.fileno, place.addr)) in seen:
            continue
        seen.add(key)
        if isinstance(item, h5py.Group):
            yield from _datasets(item, f"{before}{name}/", seen, stated)
        elif isinstance(item, h5py.Dataset):
            yield f"{before}{name}", item


def _dataset(path: Path, item: Any) -> Any:
    """A dataset as an array; None where it is none of numbers or text."""
    kind = item.attrs.get("MATLAB_class", b"")
    if "MATLAB_object_decode" in item.attrs or "MATLAB_empty" in item.attrs:
        return None
    if kind in (b"cell", b"char"):
        return _matlab_text(item, kind)
    texts = _texts(item)
    if texts is not None:
        return texts
    if item.dtype.kind not in "iufb":
        return None
    array = OnDisk(item, partial(_read, path, item))
    if len(item.shape) < 2:
        return array[()]
    if kind and len(item.shape) == 2 and 1 in item.shape:
        return array[:].ravel()  # a column or a row of MATLAB
    return array.T if kind else array


def _texts(item: Any) -> np.ndarray | None:
    """The texts of a dataset, or the names of an enumeration; None of numbers."""
    import h5py

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
    import h5py

    rows: Any = np.atleast_2d(item[()].T)
    if kind == b"cell":
        found = (h5py.h5r.dereference(cell, item.id) for cell in rows.flat)
        cells = [
            h5py.Dataset(one) for one in found if isinstance(one, h5py.h5d.DatasetID)
        ]
        if len(cells) < rows.size:
            return None
        if any(cell.attrs.get("MATLAB_class") != b"char" for cell in cells):
            return None
        rows = [cell[()].ravel() for cell in cells]
    return np.array(["".join(map(chr, row)).rstrip() for row in rows])


def _filled_in(path: Path, item: Any) -> str:
    """Why HDF5 would give numbers that nobody wrote; empty where it would not."""
    names = [name for name, *_ in item.external or ()]
    if item.is_virtual:
        names += [source.file_name for source in item.virtual_sources()]
    for name in names:
        if name != "." and not (path.parent / name).is_file():
            return f"expected its source {name}, found none"
    wanted, found = _chunks(item)
    if names or item.size == 0 or found == wanted:
        return ""
    return f"expected {wanted} chunks, found {found}: the others were not written"


def _chunks(item: Any) -> tuple[int, int]:
    """How many chunks a dataset has by its shape, and in its file."""
    if item.chunks is None:
        return 1, int(item.id.get_storage_size() > 0)
    sides = zip(item.shape, item.chunks, strict=True)
    return math.prod(-(-n // side) for n, side in sides), item.id.get_num_chunks()
