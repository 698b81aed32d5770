"""Small files that ask for much: time, memory or threads, without being damaged.

Each is sound as far as its check sums go. Reading one ends in a ValueError that names it, or in a
result, within the limits of :mod:`experiments.fuzz`.
"""

from __future__ import annotations

import io
import struct
import zipfile
import zlib
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from experiments import fuzz_files, fuzz_records, record
from scenes.recorded.files import MOST_TABLE_BYTES
from scenes.recorded.images import quiet_opencv

_RECORD = f"runs/{fuzz_records.RUN}/record.json"
_SIDE = 4096  # the largest square image that the default of scene.max_pixels lets in


@dataclass(frozen=True)
class Bomb:
    """One of them.

    Attributes:
        group, name: what it is called in a table.
        files: bytes by name.
        read: what they mean, read in their folder.
    """

    group: str
    name: str
    files: Callable[[], dict[str, bytes]]
    read: Callable[[Path], str]


def png(width: int, height: int) -> bytes:
    """A black image of 16 bits, red, green, blue and alpha: 8 bytes a pixel when decoded."""
    packer = zlib.compressobj(1)
    row = bytes(1 + 8 * width)
    pixels = b"".join([*(packer.compress(row) for _ in range(height)), packer.flush()])
    header = struct.pack(">IIBBBBB", width, height, 16, 6, 0, 0, 0)
    chunks = ((b"IHDR", header), (b"IDAT", pixels), (b"IEND", b""))
    return b"\x89PNG\r\n\x1a\n" + b"".join(
        struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
        for kind, data in chunks
    )


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
    return {_RECORD: fuzz_records.run_record(), curve: b"training_s\n" + rows}


def bombs() -> list[Bomb]:
    """All of them."""
    folder, archive = fuzz_files.read_folder, fuzz_files.read_archive
    video, run = fuzz_files.read_video, fuzz_records.read_run
    return [
        Bomb("png", "six images of 134 MB each", _many_large_images, folder),
        Bomb("png", "60,000 × 60,000", _frame(".png", lambda: _announced(60_000, 60_000)), folder),
        Bomb("png", "one row of 4096", _frame(".png", lambda: _announced(_SIDE, _SIDE)), folder),
        Bomb("jpg", "a thousand scans", _frame(".jpg", _many_scans), folder),
        Bomb("tiff", "an image of 134 MB", _frame(".tiff", _tiff), folder),
        Bomb("npz", "300 MB in 300 kB", lambda: _archive(300, 1000, 1000), archive),
        Bomb("npz", "250 MB in 250 kB", lambda: _archive(250, 1000, 1000), archive),
        Bomb("npz", "two million frames", lambda: _archive(2**21, 1, 1), archive),
        Bomb("npz", "40 columns of 8 MB", _many_columns, archive),
        Bomb("npz", "50,000 arrays", _many_entries, archive),
        Bomb("video", "frames of 4096 × 4096", _large_video, video),
        Bomb("csv", "two million rows", _manifest, folder),
        Bomb("record", "a list of 100,000 levels", _deep, run),
        Bomb("record", "a million lists", _lists, run),
        Bomb("record", "a curve of a million rows", _curve, run),
    ]
