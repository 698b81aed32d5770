"""Files of arrays by name: .npz, .npy, MATLAB's .mat, HDF5, stacks of TIFF. Nothing is unpickled.

An .npz and a .mat of version 5 are read as a whole, the others from disk as frames are asked for.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

NUMPY = (".npz", ".npy")
HDF5 = (".h5", ".hdf5")
TIFF = (".tif", ".tiff")
SUFFIXES = (*NUMPY, ".mat", *HDF5, *TIFF)


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


def load(path: Path) -> Store:
    """The arrays of a file.

    Raises:
        ValueError: it is damaged, or of another kind.
    """
    suffix = path.suffix.lower()
    if suffix in TIFF:
        from hdc.readers import tiff

        stacks = tiff.stacks(path)
        axes = {name: stack.axes for name, stack in stacks.items()}
        notes = {name: stack.notes() for name, stack in stacks.items()}
        return Store(dict(stacks), axes=axes, notes=notes)
    try:
        if suffix in NUMPY:
            return _numpy(path)
        return _hdf5(path) if suffix in HDF5 else _matlab(path)
    except ImportError:
        raise
    except Exception as error:  # damage makes these libraries raise many types
        # NumPy would have people unpickle what they trust.
        found = str(error).partition(" If you trust")[0] or type(error).__name__
        raise ValueError(
            f"{path}: expected an intact {suffix}, found: {found}"
        ) from error


def _numpy(path: Path) -> Store:
    if path.suffix.lower() == ".npy":
        return Store({"frames": np.load(path, mmap_mode="r", allow_pickle=False)})
    arrays = {}
    with np.load(path, allow_pickle=False) as archive:
        for name in archive.files:
            try:
                arrays[name] = archive[name]
            except ValueError as error:
                raise ValueError(f"{error}: {_plain(path, name)}") from error
    return Store(arrays)


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
    """A dataset of HDF5 with its axes in the order that MATLAB shows."""

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
        array = _dataset(item)
        if array is None:
            store.unread[name] = "no numbers or text that are saved plainly"
        elif array.shape:
            store.arrays[name] = array

    file.visititems(visit)
    return store


def _dataset(item: Any) -> Any:
    """A dataset as an array; None where it is none of numbers or text."""
    import h5py

    kind = item.attrs.get("MATLAB_class", b"")
    if "MATLAB_object_decode" in item.attrs or "MATLAB_empty" in item.attrs:
        return None
    if kind == b"cell":
        cells = [item.file[reference] for reference in np.ravel(item[()])]
        is_text = all(c.attrs.get("MATLAB_class") == b"char" for c in cells)
        return np.array([_text(np.ravel(c[()])) for c in cells]) if is_text else None
    if kind == b"char":
        rows = [_text(row) for row in np.atleast_2d(item[()].T)]
        return _unpadded(np.array(rows))
    if h5py.check_string_dtype(item.dtype):
        return np.array(np.ravel(item.asstr()[()]).tolist())
    if item.dtype.kind not in "iufb":
        return None
    return Reversed(item) if kind else item


def _text(codes: Iterable[int]) -> str:
    return "".join(chr(code) for code in codes)
