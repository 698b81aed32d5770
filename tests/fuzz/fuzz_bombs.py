"""Small files that ask for much: time, memory or threads, without being damaged.

Each is sound as far as its check sums go. Reading one ends in a ValueError that names it, or in a
result, within the limits of :mod:`campaign`.
"""

from __future__ import annotations

import io
import json
import struct
import zipfile
import zlib
from collections.abc import Callable
from pathlib import Path

import cv2
import fuzz_files
import fuzz_records
import numpy as np

from experiments.records import record
from hdc.readers.files import MOST_TABLE_BYTES
from hdc.readers.images import quiet_opencv

_RECORD = f"{fuzz_records.RUN}/record.json"
_SIDE = 4096  # the largest square image that the default of scene.max_pixels lets in


def png(width: int, height: int) -> bytes:
    """A black image of 16 bits, red, green, blue and alpha: 8 bytes a pixel when decoded."""
    with quiet_opencv():
        return cv2.imencode(".png", np.zeros((height, width, 4), np.uint16))[1].tobytes()


def _announced(width: int, height: int) -> bytes:
    """A PNG of one row that announces others, with right check sums."""
    small = bytearray(png(width, 1))
    struct.pack_into(">I", small, 20, height)
    struct.pack_into(">I", small, 29, zlib.crc32(small[12:29]))
    return bytes(small)


def _many_large_images() -> dict[str, bytes]:
    data = png(_SIDE, _SIDE)
    return {f"{label}/{i}.png": data for label in "ab" for i in range(3)}


def _many_scans() -> bytes:
    """A progressive JPEG that goes over all pixels a thousand times."""
    with quiet_opencv():
        grey = np.zeros((_SIDE, _SIDE), np.uint8)
        data = cv2.imencode(".jpg", grey, [cv2.IMWRITE_JPEG_PROGRESSIVE, 1])[1].tobytes()
    scan = data[data.rindex(b"\xff\xda") : -2]
    return data[:-2] + 1000 * scan + data[-2:]


def _tiff() -> bytes:
    with quiet_opencv():
        zeros = np.zeros((_SIDE, _SIDE, 4), np.uint16)
        code = [cv2.IMWRITE_TIFF_COMPRESSION, 8]
        return cv2.imencode(".tiff", zeros, code)[1].tobytes()


def _archive(n: int, height: int, width: int) -> dict[str, bytes]:
    buffer = io.BytesIO()
    labels = (np.arange(n) % 2).astype(np.uint8)
    np.savez_compressed(buffer, frames=np.zeros((n, height, width), np.uint8), labels=labels)
    return {"x.npz": buffer.getvalue()}


def _many_columns() -> dict[str, bytes]:
    """Each fits in memory; all together do not."""
    buffer = io.BytesIO()
    column = io.BytesIO()
    np.save(column, np.zeros(2**20), allow_pickle=False)
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as archive:
        for key, array in (
            ("frames", np.zeros((2**20, 1, 1), np.uint8)), ("labels", np.arange(2**20) % 2),
        ):  # fmt: skip
            with archive.open(f"{key}.npy", "w") as file:
                np.lib.format.write_array(file, array, allow_pickle=False)
        for k in range(40):
            archive.writestr(f"column{k}.npy", column.getvalue())
    return {"x.npz": buffer.getvalue()}


def _many_entries() -> dict[str, bytes]:
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as archive:
        for k in range(50_000):
            archive.writestr(f"{k}.npy", b"")
    return {"x.npz": buffer.getvalue()}


def _large_video() -> dict[str, bytes]:
    """A stream of frames of the largest size, each of some kilobytes."""
    return {
        "x.avi": fuzz_files.video(".avi", "MJPG", (_SIDE, _SIDE), n=12),
        "x.csv": b"start_s,end_s,label\n0,0.6,a\n0.6,1.2,b\n",
    }


def _frame(suffix: str, make: Callable[[], bytes]) -> Callable[[], dict[str, bytes]]:
    """A folder of a small image and that one."""
    return lambda: fuzz_files.good_frame() | {f"b/1{suffix}": make()}


def _manifest() -> dict[str, bytes]:
    rows = b"a,b\n" * (MOST_TABLE_BYTES // 4 - 10)
    return fuzz_files.good_frame() | {"manifest.csv": b"file,label\n" + rows}


def _deep() -> dict[str, bytes]:
    return {_RECORD: b"[" * 100_000}


def _lists() -> dict[str, bytes]:
    return {_RECORD: b"[" + b"[]," * (record.MOST_BYTES // 3 - 2) + b"[]]"}


def _curve() -> dict[str, bytes]:
    rows = b"1\n" * (record.MOST_ROW_BYTES // 2 - 10)
    curve = _RECORD.replace("record.json", "curve.csv")
    return {_RECORD: json.dumps(fuzz_records.ENTRY).encode(), curve: b"training_s\n" + rows}


_folder, _npz = fuzz_files.read_folder, fuzz_files.read_archive
_video, _run = fuzz_files.read_video, fuzz_records.read_run

# name → (files by name, what they mean, read in their folder)
BOMBS: dict[str, tuple[Callable[[], dict[str, bytes]], Callable[[Path], str]]] = {
    "png: six images of 134 MB each": (_many_large_images, _folder),
    "png: 60,000 × 60,000": (_frame(".png", lambda: _announced(60_000, 60_000)), _folder),
    "png: one row of 4096": (_frame(".png", lambda: _announced(_SIDE, _SIDE)), _folder),
    "jpg: a thousand scans": (_frame(".jpg", _many_scans), _folder),
    "tiff: an image of 134 MB": (_frame(".tiff", _tiff), _folder),
    "npz: 300 MB in 300 kB": (lambda: _archive(300, 1000, 1000), _npz),
    "npz: 250 MB in 250 kB": (lambda: _archive(250, 1000, 1000), _npz),
    "npz: two million frames": (lambda: _archive(2**21, 1, 1), _npz),
    "npz: 40 columns of 8 MB": (_many_columns, _npz),
    "npz: 50,000 arrays": (_many_entries, _npz),
    "video: frames of 4096 × 4096": (_large_video, _video),
    "csv: two million rows": (_manifest, _folder),
    "record: a list of 100,000 levels": (_deep, _run),
    "record: a million lists": (_lists, _run),
    "record: a curve of a million rows": (_curve, _run),
}
