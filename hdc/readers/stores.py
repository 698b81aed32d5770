"""Files of arrays by name: .npz, .npy, MATLAB's .mat, HDF5, stacks of TIFF. Nothing is unpickled.

An .npz, a .mat of version 5 and a compressed TIFF are read as a whole, the others from disk as
frames are asked for. Vectors are in memory.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any
from weakref import WeakValueDictionary

import numpy as np

from hdc.readers.files import BadFrame
from hdc.readers.store import OnDisk, Store, not_plain

_LOADED: WeakValueDictionary[tuple[Path, int, int], Store] = WeakValueDictionary()
"""Files that someone has open, by what tells them from a file that was written later."""


def load(path: Path) -> Store:
    """The arrays of a file, which is read once as long as someone has them.

    Raises:
        ValueError: it is damaged, or of another kind.
    """
    status = path.stat()
    key = (path, status.st_mtime_ns, status.st_size)
    if (store := _LOADED.get(key)) is None:
        _LOADED[key] = store = _read(path)
    return store


def _read(path: Path) -> Store:
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

    stacks = {str(number): pages for number, pages in enumerate(tiff.stacks(path))}
    axes = ("frame", "height", "width", "channel")
    return Store(
        {name: _watched(path, pages) for name, pages in stacks.items()},
        axes={name: axes[: pages.ndim] for name, pages in stacks.items()},
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
        array = _plain(item)
        if array.dtype.kind not in "iufbU":
            store.unread[path] = not_plain(name)
        else:
            store.arrays[path] = array


def _plain(item: Any) -> np.ndarray:
    """An array, of which cells of text and rows of characters are text."""
    array = np.asarray(item)
    if array.dtype == object and all(isinstance(c, str) for c in array.flat):
        array = np.array(array.ravel().tolist())
    if array.dtype.kind == "U":
        # MATLAB's rows of characters are equally long.
        array = np.asarray(np.char.rstrip(array))
    return array


def _hdf5(path: Path) -> Store:
    from hdc.readers import hdf5  # late: h5py is of the extra files

    return hdf5.load(path)
