"""Recordings of every kind that others may have made: a sound one, and what reading it gives.

A file is read as it is in a run: an image as one of a folder. What was read comes back as a digest
of all that is used of it, so that two readings compare.
"""

from __future__ import annotations

import functools
import hashlib
import io
import struct
import tempfile
import zipfile
import zlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from hdc.readers.images import quiet_opencv
from scenes.recorded import RecordedScene, open_recording

_RATE = 10  # frames a second of the videos


@dataclass(frozen=True)
class Kind:
    """A kind of file.

    Attributes:
        kind: what it is called.
        name: its path in a folder of its own.
        make: the bytes of a sound one, the same every time.
        read: what the file means, read in that folder.
        around: sound files beside it, by name.
        mend: makes check sums of damaged bytes right again, so that what they guard is reached.
        replace: strategy for another file, sound in itself, in which one field is another.
    """

    kind: str
    name: str
    make: Callable[[], bytes]
    read: Callable[[Path], str]
    around: Callable[[], dict[str, bytes]] = dict
    mend: Callable[[bytes], bytes] | None = None
    replace: Callable[[bytes], Any] | None = None


def write(files: Mapping[str, bytes], folder: Path) -> None:
    """Write files, by name, into a folder."""
    for name, content in files.items():
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(content)


# Images -------------------------------------------------------------------------------------------


@functools.cache
def _picture(dtype: type = np.uint8) -> np.ndarray:
    """[24, 30]: a gradient, which compresses, under noise, which does not."""
    rng = np.random.default_rng(0)
    limit = np.iinfo(dtype).max
    slope = np.add.outer(np.arange(24), np.arange(30)) * (limit // 80)
    return (slope + rng.integers(0, limit // 8, (24, 30))).astype(dtype)


def _image(suffix: str, *parameters: int, dtype: type = np.uint8, colour: bool = False) -> bytes:
    picture = _picture(dtype)
    if colour:
        picture = np.stack([picture, picture[::-1], picture[:, ::-1]], axis=-1)
    with quiet_opencv():
        return cv2.imencode(suffix, picture, parameters)[1].tobytes()


def _scene(path: Path, **settings: Any) -> str:
    scene: RecordedScene = open_recording(path, **settings)
    state = hashlib.sha256(scene.frames(np.arange(len(scene))).numpy().data)
    state.update(repr((scene.classes, scene.labels.tolist(), scene.shape)).encode())
    state.update(repr({k: v.tolist() for k, v in scene.samples.items()}).encode())
    return state.hexdigest()


def read_folder(folder: Path) -> str:
    """What a folder of images shows."""
    return _scene(folder, threads=1)


def good_frame(dtype: type = np.uint8) -> dict[str, bytes]:
    """The frame of another class, beside the one that is damaged."""
    return {"a/1.png": _image(".png", dtype=dtype)}


def _mend_png(data: bytes) -> bytes:
    """Right check sums for all chunks, as far as they can be followed."""
    mended, at = bytearray(data), 8
    while at + 12 <= len(mended):
        (length,) = struct.unpack_from(">I", mended, at)
        end = at + 8 + length
        if end + 4 > len(mended):
            break
        struct.pack_into(">I", mended, end, zlib.crc32(mended[at + 4 : end]))
        at = end + 4
    return bytes(mended)


# Archives, videos and tables ----------------------------------------------------------------------


@functools.cache
def noise() -> np.ndarray:
    """Frames uint8 [20, 24, 32] that no coding makes smaller."""
    return np.random.default_rng(1).integers(0, 256, (20, 24, 32), dtype=np.uint8)


def _archive(save: Callable[..., None]) -> bytes:
    buffer = io.BytesIO()
    times, labels = np.arange(20) / 10, np.array(["a", "b"])[np.arange(20) // 10]
    save(buffer, frames=noise(), labels=labels, time=times)
    return buffer.getvalue()


def _array() -> bytes:
    buffer = io.BytesIO()
    np.save(buffer, noise(), allow_pickle=False)
    return buffer.getvalue()


def _zipped(array: bytes) -> bytes:
    """A sound archive around an array that may be damaged."""
    buffer = io.BytesIO(_archive(np.savez))
    with zipfile.ZipFile(buffer) as old:
        labels = old.read("labels.npy")
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as new:
        new.writestr("frames.npy", array)
        new.writestr("labels.npy", labels)
    return buffer.getvalue()


def read_archive(folder: Path) -> str:
    """What the archive in a folder holds."""
    return _scene(folder / "x.npz")


@functools.cache
def video(suffix: str, code: str, size: tuple[int, int] = (32, 24), n: int = 20) -> bytes:
    """A video of n frames of width × height pixels, its first 24 × 32 ones noise."""
    with tempfile.TemporaryDirectory() as folder, quiet_opencv():
        path = Path(folder, f"x{suffix}")
        code_number = cv2.VideoWriter.fourcc(*code)
        writer = cv2.VideoWriter(str(path), code_number, _RATE, size)
        frame = np.zeros((*size[::-1], 3), np.uint8)
        for pixels in noise()[:n]:
            frame[:24, :32] = pixels[..., None]
            writer.write(frame)
        writer.release()
        return path.read_bytes()


def read_video(folder: Path) -> str:
    """What the video in a folder shows, as its table of intervals says."""
    return _scene(next(path for path in folder.glob("x.*") if path.suffix != ".csv"))


_INTERVALS = b"start_s,end_s,label,note\n0,1,press,x\n1.0,1.9,free,\n"
_MANIFEST = b"file,label,order,session,class_index\na/1.png,x,0,0,1\nb/1.png,y,1.5,1,0\n"
_TIFF, _PROGRESSIVE = cv2.IMWRITE_TIFF_COMPRESSION, cv2.IMWRITE_JPEG_PROGRESSIVE
# (kind, parameters of OpenCV's encoder, what else _image is told, mends)
_IMAGES: list[tuple[str, tuple[int, ...], dict[str, Any], Any]] = [
    ("png: 8 bits", (), {}, None),
    ("png: check sums mended", (), {}, _mend_png),
    ("png: 16 bits, check sums mended", (), {"dtype": np.uint16}, _mend_png),
    ("jpg: grey", (), {}, None),
    ("jpg: colour, progressive", (_PROGRESSIVE, 1), {"colour": True}, None),
    ("bmp: grey", (), {}, None),
    ("bmp: colour", (), {"colour": True}, None),
    ("tiff: uncompressed", (_TIFF, 1), {}, None),
    ("tiff: LZW", (_TIFF, 5), {}, None),
    ("tiff: deflate, 16 bits", (_TIFF, 8), {"dtype": np.uint16}, None),
]
_VIDEOS = [("avi", "MJPG"), ("mp4", "mp4v"), ("mkv", "FFV1")]


def kinds() -> list[Kind]:
    """All of these kinds."""
    made = [
        Kind("npz: stored", "x.npz", lambda: _archive(np.savez), read_archive),
        Kind("npz: compressed", "x.npz", lambda: _archive(np.savez_compressed), read_archive),
        Kind("npz: an array in a sound zip", "x.npz", _array, read_archive, mend=_zipped),
        Kind("csv: intervals of a video", "x.csv", lambda: _INTERVALS, read_video,
             lambda: {"x.avi": video(".avi", "MJPG")}),
        Kind("csv: manifest of a folder", "manifest.csv", lambda: _MANIFEST, read_folder,
             lambda: {**good_frame(), "b/1.png": _image(".png")}),
    ]  # fmt: skip
    for name, parameters, told, mend in _IMAGES:
        suffix = name.partition(":")[0]
        make = functools.partial(_image, f".{suffix}", *parameters, **told)
        beside = functools.partial(good_frame, told.get("dtype", np.uint8))
        made.append(Kind(name, f"b/1.{suffix}", make, read_folder, beside, mend))
    for suffix, code in _VIDEOS:
        make = functools.partial(video, f".{suffix}", code)
        around = {"x.csv": _INTERVALS}.copy
        made.append(Kind(f"video: {suffix}, {code}", f"x.{suffix}", make, read_video, around))
    return made
