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
HDF5 = (".h5", ".hdf5", ".hdf")
TIFF = (".tif", ".tiff")
SUFFIXES = (*NUMPY, ".mat", *HDF5, *TIFF)
_IS_HDF5 = b"\x89HDF\r\n\x1a\n"


@dataclass
class Store:
    """Arrays of a file.

    Attributes:
        arrays: anything with ``shape``, ``dtype`` and ``[…]``, by name.
        frames_last: MATLAB shows a stack as [H, W, N].
        unread: names of what is there and not read, and why.
        notes: how an array was read, by its name.
    """

    arrays: dict[str, Any]
    frames_last: bool = False
    unread: dict[str, str] = field(default_factory=dict)
    notes: dict[str, list[str]] = field(default_factory=dict)

    def advice(self) -> str:
        """What is not read, why, and how to save it anew; or nothing."""
        if not self.unread:
            return ""
        first, why = next(iter(self.unread.items()))
        return (
            f" (not read: {', '.join(self.unread)}: {why}; in MATLAB: {first} = cellstr({first}) "
            f"for text, double({first}) for numbers, then save again)"
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
        notes = {name: stack.notes() for name, stack in stacks.items()}
        return Store(dict(stacks), notes=notes)
    try:
        if suffix in NUMPY:
            return _numpy(path)
        if suffix == ".mat" and not _is_hdf5(path):
            return _matlab(path)
        return _hdf5(path)
    except ImportError:
        raise
    except Exception as error:  # damage makes these libraries raise many types
        found = str(error) or type(error).__name__
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


def _is_hdf5(path: Path) -> bool:
    with path.open("rb") as file:
        start = file.read(520)
    return _IS_HDF5 in (start[:8], start[512:])


# MATLAB ------------------------------------------------------------------------------------------


def _matlab(path: Path) -> Store:
    """Version 5 and earlier, by SciPy."""
    from scipy.io import loadmat

    store = Store({}, frames_last=True)
    found = loadmat(path, simplify_cells=True)
    _add(store, {k: v for k, v in found.items() if not k.startswith("__")}, "")
    return store


def _add(store: Store, found: dict[str, Any], before: str) -> None:
    """Take arrays of a struct, and of those in it, by their paths."""
    for name, item in found.items():
        path = f"{before}{name}"
        if isinstance(item, dict):
            _add(store, item, f"{path}/")
            continue
        array: np.ndarray | None = np.asarray(item)
        if np.asarray(item).dtype == object:
            array = _of_cells(np.ravel(item).tolist())
        if array is None or array.dtype.kind not in "iufbU":
            store.unread[path] = "no numbers or text that MATLAB saves plainly"
        elif array.ndim:
            store.arrays[path] = array


def _of_cells(cells: list[Any]) -> np.ndarray | None:
    """A cell array of texts [N], or of frames of one size [H, W, N]; None of another."""
    if all(isinstance(cell, str) for cell in cells):
        return np.array(cells)
    shapes = {np.shape(cell) for cell in cells}
    if len(shapes) != 1 or any(np.asarray(cell).dtype == object for cell in cells):
        return None
    return np.stack(cells, axis=-1)


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
        cells = [_cell(item.file[reference]) for reference in np.ravel(item[()])]
        return _of_cells(cells)
    if kind == b"char":
        return np.array([_text(row) for row in np.atleast_2d(item[()].T)])
    if h5py.check_string_dtype(item.dtype):
        return np.array(np.ravel(item.asstr()[()]).tolist())
    if item.dtype.kind not in "iufb":
        return None
    return Reversed(item) if kind else item


def _cell(item: Any) -> Any:
    """What a cell holds: text, or an array as MATLAB shows it."""
    if item.attrs.get("MATLAB_class") == b"char":
        return _text(np.ravel(item[()]))
    return np.asarray(item[()]).T


def _text(codes: Iterable[int]) -> str:
    return "".join(chr(code) for code in codes)
