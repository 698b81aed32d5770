"""Files of arrays by name: .npz, .npy, MATLAB's .mat, HDF5, stacks of TIFF. Nothing is unpickled.

An .npz and a .mat of version 5 are read as a whole, the others from disk as frames are asked for.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from hdc.readers.files import BadFrame

NUMPY = (".npz", ".npy")
HDF5 = (".h5", ".hdf5")
TIFF = (".tif", ".tiff")
SUFFIXES = (*NUMPY, ".mat", *HDF5, *TIFF)


class Refused:
    """An array that is there and not read; whoever asks for its content is told why."""

    def __init__(self, shape: tuple[int, ...], dtype: Any, why: str) -> None:
        self.shape, self.dtype, self.why = shape, np.dtype(dtype), why

    def __getitem__(self, _: Any) -> np.ndarray:
        raise BadFrame(self.why)


class Watched:
    """An array on disk that is read as it is asked for, as long as its file stays as it was.

    A file that is rewritten meanwhile would end the process with a bus error.
    """

    def __init__(self, path: Path, array: Any) -> None:
        self._path, self._array = path, array
        self._state = self._look()
        self.shape, self.dtype = array.shape, array.dtype

    def _look(self) -> tuple[int, int]:
        status = self._path.stat()
        return status.st_size, status.st_mtime_ns

    def __getitem__(self, key: Any) -> np.ndarray:
        if self._look() != self._state:
            raise BadFrame(
                f"{self._path}: expected the file as it was opened, found it rewritten"
            )
        return np.array(self._array[key])


@dataclass
class Store:
    """Arrays of a file.

    Attributes:
        arrays: anything with ``shape``, ``dtype`` and ``[…]``, by name.
        frames_last: MATLAB shows a stack as [H, W, N].
        unread: names of what is there and not read, and why.
        axes: of arrays whose file states them, by name.
        notes: how an array was read, by its name.
    """

    arrays: dict[str, Any]
    frames_last: bool = False
    unread: dict[str, str] = field(default_factory=dict)
    axes: dict[str, tuple[str, ...]] = field(default_factory=dict)
    notes: dict[str, list[str]] = field(default_factory=dict)

    def advice(self) -> str:
        """Why something is not read, and how to save it anew; empty if it is read."""
        if not self.unread:
            return ""
        first, why = next(iter(self.unread.items()))
        return (
            f" (not read: {', '.join(self.unread)}: {why}; in MATLAB, before saving: "
            f"cellstr({first}) for text, double({first}) for numbers, cat(3, {first}{{:}}) for "
            "frames in cells)"
        )


_LOADED: ContextVar[dict[Path, Store] | None] = ContextVar("loaded", default=None)


@contextmanager
def loaded_once() -> Iterator[None]:
    """Within it a file is loaded once, however often its arrays are asked for."""
    before = _LOADED.set({})
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
    if suffix in TIFF:
        from hdc.readers import tiff

        stacks = tiff.stacks(path)
        axes = {name: stack.axes for name, stack in stacks.items()}
        notes = {name: stack.notes() for name, stack in stacks.items()}
        watched = {name: Watched(path, stack) for name, stack in stacks.items()}
        return Store(watched, axes=axes, notes=notes)
    try:
        if suffix in NUMPY:
            return _numpy(path)
        return _hdf5(path) if suffix in HDF5 else _matlab(path)
    except (ImportError, BadFrame):
        raise
    except Exception as error:  # damage makes these libraries raise many types
        # NumPy would have people unpickle what they trust.
        found = str(error).partition(" If you trust")[0] or type(error).__name__
        raise ValueError(
            f"{path}: expected an intact {suffix}, found: {found}"
        ) from error


def _numpy(path: Path) -> Store:
    if path.suffix.lower() == ".npy":
        array = np.load(path, mmap_mode="r", allow_pickle=False)
        return Store({"frames": Watched(path, array)})
    store = Store({})
    with np.load(path, allow_pickle=False) as archive:
        for name in archive.files:
            try:
                found = archive[name]
            except ValueError as error:
                if "Object arrays" not in str(error):
                    raise
                why = f"{path}: expected plain arrays, found: {_plain(path, name)}"
                store.arrays[name] = Refused((), object, why)
                continue
            if isinstance(found, np.ndarray):
                store.arrays[name] = found
            else:
                store.unread[name] = "no .npy"
    return store


def _plain(path: Path, name: str) -> str:
    """How to save an array of objects anew; that opens it as only its owner may."""
    text = f"a = dict(np.load({path.name!r}, allow_pickle=True)); "
    return (
        f"{name} holds Python objects, which are not opened here; if the file is your own: "
        f"{text}a[{name!r}] = np.array(a[{name!r}].tolist()); np.savez({path.name!r}, **a)"
    )


# MATLAB ------------------------------------------------------------------------------------------


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
    """Take arrays of a struct, and of those in it, by their paths."""
    for name, item in found.items():
        path = f"{before}{name}"
        if isinstance(item, dict):
            _add(store, item, f"{path}/")
            continue
        array = np.asarray(item)
        if array.dtype == object and all(isinstance(c, str) for c in array.flat):
            array = np.array(array.ravel().tolist())  # a cell array of texts
        if array.dtype.kind not in "iufbU":
            store.unread[path] = "no numbers or text that MATLAB saves plainly"
        elif array.ndim:
            store.arrays[path] = _unpadded(array)


def _unpadded(array: np.ndarray) -> np.ndarray:
    """Texts without the spaces that make rows of characters equally long."""
    return np.char.rstrip(array) if array.dtype.kind == "U" else array


class Reversed:
    """A dataset with its axes in the order that MATLAB shows."""

    def __init__(self, dataset: Any) -> None:
        self._dataset = dataset
        self.shape = dataset.shape[::-1]
        self.dtype = dataset.dtype

    def __getitem__(self, key: Any) -> np.ndarray:
        backwards = key[::-1] if isinstance(key, tuple) else key
        return np.asarray(self._dataset[backwards]).T


def _hdf5(path: Path) -> Store:
    import h5py

    file = h5py.File(path, "r", rdcc_nbytes=2**26)  # chunks of several frames
    store = Store({}, frames_last=path.suffix.lower() == ".mat")

    def visit(name: str, item: Any) -> None:
        if not isinstance(item, h5py.Dataset) or name.startswith("#"):
            return
        if "MATLAB_class" in item.attrs:
            store.frames_last = True
        array = _dataset(path, item)
        if array is None:
            store.unread[name] = "no numbers or text that are saved plainly"
        elif array.shape:
            store.arrays[name] = array

    file.visititems(visit)
    return store


class Dataset:
    """A dataset of HDF5; its errors name the file."""

    def __init__(self, path: Path, dataset: Any) -> None:
        self._where, self._dataset = f"{path}[{dataset.name[1:]}]", dataset
        self.shape, self.dtype = dataset.shape, dataset.dtype

    def __getitem__(self, key: Any) -> np.ndarray:
        try:
            return np.asarray(self._dataset[key])
        except (OSError, RuntimeError) as error:
            wanted = "a dataset that can be read"
            raise BadFrame(
                f"{self._where}: expected {wanted}, found: {error}"
            ) from error


def _dataset(path: Path, item: Any) -> Any:
    """A dataset as an array; None where it is none of numbers or text."""
    import h5py

    kind = item.attrs.get("MATLAB_class", b"")
    if "MATLAB_object_decode" in item.attrs or "MATLAB_empty" in item.attrs:
        return None
    if why := _filled_in(path, item):
        return Refused(item.shape, item.dtype, why)
    if kind in (b"cell", b"char"):
        return _matlab_text(item, kind)
    if h5py.check_enum_dtype(item.dtype) and len(item.shape) == 1:
        return _enumerated(item, h5py.check_enum_dtype(item.dtype))
    if h5py.check_string_dtype(item.dtype):
        return np.array(np.ravel(item.asstr()[()]).tolist())
    if item.dtype.kind not in "iufb":
        return None
    array = Dataset(path, item)
    return Reversed(array) if kind else array


def _enumerated(item: Any, names: dict[str, int]) -> np.ndarray:
    """The names [N] of an enumeration's numbers."""
    by_number = {number: name for name, number in names.items()}
    return np.array([by_number.get(n, str(n)) for n in item[()].tolist()])


def _matlab_text(item: Any, kind: bytes) -> np.ndarray | None:
    """Rows of characters, or a cell array of them; None of other cells."""
    if kind == b"char":
        rows = [_text(row) for row in np.atleast_2d(item[()].T)]
        return _unpadded(np.array(rows))
    cells = [item.file[reference] for reference in np.ravel(item[()])]
    if not all(cell.attrs.get("MATLAB_class") == b"char" for cell in cells):
        return None
    return np.array([_text(np.ravel(cell[()])) for cell in cells])


def _filled_in(path: Path, item: Any) -> str:
    """Why HDF5 would give numbers that nobody wrote; empty where it would not."""
    where = f"{path}[{item.name[1:]}]"
    names = [name for name, *_ in item.external or ()]
    if item.is_virtual:
        names += [source.file_name for source in item.virtual_sources()]
    for name in names:
        if name != "." and not (path.parent / name).is_file():
            return f"{where}: expected its source {name}, found none"
    if names:
        return ""
    wanted, found = _chunks(item)
    if found < wanted:
        return f"{where}: expected {wanted} chunks, found {found}: the others were not written"
    return ""


def _chunks(item: Any) -> tuple[int, int]:
    """How many chunks a dataset has, and how many of them were written."""
    if item.size == 0:
        return 0, 0
    if item.chunks is None:
        return 1, int(item.id.get_storage_size() > 0)
    sides = zip(item.shape, item.chunks, strict=True)
    return math.prod(-(-n // side) for n, side in sides), item.id.get_num_chunks()


def _text(codes: Iterable[int]) -> str:
    return "".join(chr(code) for code in codes)
