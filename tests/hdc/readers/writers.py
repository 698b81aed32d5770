"""Recordings as programs write them: frames of 3 × 5 pixels that are all different.

One that is turned, or an axis that is taken for another, is seen.
"""

import cv2
import h5py
import numpy as np
import scipy.io
import tifffile

N, H, W = 4, 3, 5
RNG = np.random.default_rng(0)
FRAMES = RNG.permutation(N * H * W).astype(np.uint16).reshape(N, H, W) * 300
NAMES = ["a", "bb", "a", "bb"]
LABELS = np.array([1.0, 2, 1, 2])
CUBE = np.moveaxis(FRAMES, 0, -1)  # [H, W, N], as MATLAB shows a stack
TEXTS = np.array(NAMES)
BYTES = RNG.integers(0, 256, (N, H, W, 4), np.uint8)


def check(recording, names=NAMES, frames=FRAMES):
    assert recording.shape == frames.shape
    assert recording.dtype == frames.dtype.newbyteorder("=")
    assert np.array_equal(recording[:], frames)
    assert np.array_equal(recording[[2, 0]], frames[[2, 0]])
    assert np.array_equal(next(recording.stream([1])), frames[1])
    assert recording[[]].shape == (0, *frames.shape[1:])
    assert recording.names == names


def shown(item):
    return f"{item:g}" if isinstance(item, float) else str(item)


def said(recording, names):
    """These columns of each frame, a line each."""
    columns = dict(recording.samples)
    if recording.labels is not None:
        columns["label"] = recording.names
    if recording.values is not None:
        columns |= zip(recording.value_names, recording.values.T, strict=True)
    chosen = zip(*(columns[name] for name in names.split()), strict=True)
    return [" ".join(map(shown, row)) for row in chosen]


def write_image(path, frame):
    path.parent.mkdir(parents=True, exist_ok=True)
    assert cv2.imwrite(str(path), frame)


def beside(path, *rows):
    path.with_suffix(".csv").write_text("\n".join(rows))


def save_v73(path, **arrays):
    """As MATLAB writes version 7.3: axes reversed, text as codes, cells as references."""
    with h5py.File(path, "w", userblock_size=512) as file:
        for name, array in arrays.items():
            if isinstance(array, list):
                texts = enumerate(array)
                references = [_text(file, f"#refs#/{k}", text) for k, text in texts]
                file[name] = np.array([references], dtype=h5py.ref_dtype)
                kind = "cell"
            else:
                file[name], kind = array.T, array.dtype.name
            file[name].attrs["MATLAB_class"] = np.bytes_(kind)
    with path.open("r+b") as file:
        file.write(b"MATLAB 7.3 MAT-file".ljust(124) + b"\x00\x02IM")


def _text(file, name, value):
    file[name] = np.array([[ord(c)] for c in value], np.uint16)
    file[name].attrs["MATLAB_class"] = np.bytes_("char")
    return file[name].ref


def npz(path, **arrays):
    np.savez(path, **arrays)


def npy(path, frames, labels):
    np.save(path, frames)
    beside(path, "label", *map(str, labels))


def mat(path, **arrays):
    cells = {k: np.array(a, object) for k, a in arrays.items() if isinstance(a, list)}
    scipy.io.savemat(path, arrays | cells)


def h5(path, **arrays):
    with h5py.File(path, "w") as file:
        for name, array in arrays.items():
            file[name.replace("__", "/")] = array


def virtual(path, **arrays):
    """Frames that lie in another file, moved.h5; that has these arrays."""
    if arrays:
        h5(path.with_name("moved.h5"), **arrays)
    layout = h5py.VirtualLayout((N, H, W), np.uint16)
    layout[:] = h5py.VirtualSource("moved.h5", "frames", (N, H, W))
    with h5py.File(path, "w") as file:
        file.create_virtual_dataset("frames", layout)
        file["labels"] = NAMES


def characters(path):
    """As MATLAB writes rows of characters."""
    save_v73(path, cube=CUBE)
    codes = [[ord(c) for c in name.ljust(2)] for name in NAMES]
    with h5py.File(path, "r+") as file:
        file["labels"] = np.array(codes, np.uint16).T
        file["labels"].attrs["MATLAB_class"] = np.bytes_("char")


def pages(path, frames=FRAMES, one_by_one=False, **options):
    """A stack of TIFF, in grey unless the options say otherwise."""
    of_file = ("imagej", "ome", "bigtiff", "byteorder")
    own = {name: options.pop(name) for name in of_file if name in options}
    options = {"photometric": "minisblack", **options}
    with tifffile.TiffWriter(path, **own) as file:
        for part in frames if one_by_one else [frames]:
            file.write(part, contiguous=not one_by_one, **options)
    beside(path, "label", *NAMES)
