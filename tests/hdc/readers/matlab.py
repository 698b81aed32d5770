"""Files as MATLAB writes version 7.3, which no library here writes."""

import h5py
import numpy as np


def save_v73(path, **arrays):
    """As MATLAB writes version 7.3: axes reversed, text as codes, cells as references."""
    with h5py.File(path, "w", userblock_size=512) as file:
        for name, array in arrays.items():
            if isinstance(array, list):
                references = [
                    _text(file, f"#refs#/{k}", t) for k, t in enumerate(array)
                ]
                cells = np.array([references], dtype=h5py.ref_dtype)
                file[name] = cells
                file[name].attrs["MATLAB_class"] = np.bytes_("cell")
            else:
                file[name] = array.T
                file[name].attrs["MATLAB_class"] = np.bytes_(array.dtype.name)
    with path.open("r+b") as file:
        file.write(b"MATLAB 7.3 MAT-file".ljust(124) + b"\x00\x02IM")


def _text(file, name, value):
    codes = np.array([[ord(c)] for c in value], np.uint16)
    file[name] = codes
    file[name].attrs["MATLAB_class"] = np.bytes_("char")
    return file[name].ref
