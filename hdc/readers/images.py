"""Images: PNG, JPEG, BMP or TIFF, decoded to grey frames of as many bits.

Colour becomes luminance (ITU-R BT.601, 0.299 R + 0.587 G + 0.114 B) and an alpha channel is left
out. Pixels are as they are stored: no orientation tag is applied. OpenCV decodes; a TIFF is decoded
by tifffile.
"""

from __future__ import annotations

import hashlib
import math
import os
import struct
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import TypeVar

import cv2
import numpy as np

from hdc.readers.files import BadFrame, SettingError, check_file
from hdc.readers.listing import Listing
from hdc.readers.recording import Recording, Window, check_finite, with_progress

S = TypeVar("S")
T = TypeVar("T")

PNG, JPEG, BMP = b"\x89PNG\r\n\x1a\n", b"\xff\xd8\xff", b"BM"
TIFF = (b"II*\0", b"MM\0*", b"II+\0", b"MM\0+")  # + : BigTIFF
"""How these files begin."""
_SCAN_MARK, _END_MARK = 0xDA, 0xD9
_IN_SCANS = (0x00, 0x01, *range(0xD0, 0xD8), 0xFF)
"""Second bytes of what may stand within a scan: a byte 255, a restart, filling."""
_BY_MASKS, _OLD_HEADER, _USUAL_MASKS = (3, 6), 40, (0xFF0000, 0xFF00, 0xFF)
"""Of BMP: compressions by masks, bytes of the header that 16 bits once had, masks of 32 bits."""
_USUAL_CODES = bytes([0, 2, 1, 3, 3, 2, 4, 3, 5, 5, 4, 4, 0, 0, 1, 125])
"""JPEG's usual table for luminance: with it no scan has a long run of zeros."""
_SECTOR = bytes(512)
_MOST_PIXELS = 2**28
AHEAD = 16
"""Images decoded ahead of the caller."""


def decode(file: Path) -> np.ndarray:
    """The image [H, W] or [H, W, channels] of a file (blue first), integers or floats.

    Raises:
        BadFrame: it is no single, whole image of a kind that is read here; the file is named.
    """
    check_file(file)
    return decoded(str(file), file.read_bytes())


def decoded(place: str, data: bytes) -> np.ndarray:
    """The same, of bytes that are of a place."""
    if data.startswith(TIFF):
        from hdc.readers import tiff

        image = tiff.image(place, data)
        return image if image.ndim == 2 else image[..., ::-1]
    if data.startswith(PNG):
        _check_png(place, data)
    elif data.startswith(JPEG):
        data = _whole_jpeg(place, data)
    elif data.startswith(BMP):
        masked = _of_masks(place, data)
        if masked is not None:
            return masked
    else:
        raise BadFrame(
            f"{place}: expected an image (PNG, JPEG, BMP, TIFF), found other data"
        )
    try:
        found = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED)
    except cv2.error as error:
        raise _damaged(place) from error
    if found is None:
        raise _damaged(place)
    return found


def _damaged(place: str) -> BadFrame:
    return BadFrame(
        f"{place}: expected a whole image, found one that is damaged or truncated"
    )


def _check_png(place: str, data: bytes) -> None:
    """Raise BadFrame for several images, or for one that would fill the memory."""
    pixels = int.from_bytes(data[16:20]) * int.from_bytes(data[20:24])
    if pixels > _MOST_PIXELS:
        raise BadFrame(
            f"{place}: expected at most {_MOST_PIXELS} pixels, found {pixels}"
        )
    if b"acTL" in data[: data.find(b"IDAT")]:  # the mark of an animation
        raise BadFrame(f"{place}: expected a single image, found an animation")


def _whole_jpeg(place: str, data: bytes) -> bytes:
    """The image without what follows its end, such as the film of a motion photo.

    Raises:
        BadFrame: it is cut, or has lost a block of zeros: decoders go on over both.
    """
    first, end = _scans(data)
    if end < 0 or (_USUAL_CODES in data[:end] and _SECTOR in data[first:end]):
        raise _damaged(place)
    return data[:end]


def _scans(data: bytes) -> tuple[int, int]:
    """Where the first scan of a JPEG begins, and where its image ends; -1 where it does not."""
    first, at = -1, 2
    while 0 <= at < len(data) - 1:
        mark = data[at + 1]
        if data[at] != 0xFF or mark in _IN_SCANS:
            at = data.find(b"\xff", at + 1)
        elif mark == _END_MARK:
            return first, at + 2
        else:
            if mark == _SCAN_MARK and first < 0:
                first = at
            at += 2 + int.from_bytes(data[at + 2 : at + 4])
    return first, -1


def _of_masks(place: str, data: bytes) -> np.ndarray | None:
    """A BMP [H, W, 3] (blue first) whose pixels are parted by masks that OpenCV takes for others;
    None of others."""
    masks = _unusual_masks(data)
    if masks is None:
        return None
    width, height, _, bits = struct.unpack_from("<iiHH", data, 18)
    stride = (width * bits + 31) // 32 * 4
    start = int.from_bytes(data[10:14], "little")
    if width <= 0 or len(data) < start + stride * abs(height):
        raise _damaged(place)
    rows = np.frombuffer(data, np.uint8, stride * abs(height), start)
    pixels = rows.reshape(abs(height), stride).view(f"<u{bits // 8}")[:, :width]
    planes = []
    for mask in masks[::-1]:
        shift = (mask & -mask).bit_length() - 1
        level = (pixels & mask) >> shift
        planes.append((level * 255.0 / (mask >> shift)).round().astype(np.uint8))
    image = np.stack(planes, axis=2)
    return image[::-1] if height > 0 else image


def _unusual_masks(data: bytes) -> tuple[int, ...] | None:
    """Masks of red, green and blue that OpenCV does not read; else None."""
    if len(data) < 66:
        return None
    bits, compression = struct.unpack_from("<HI", data, 28)
    masks = struct.unpack_from("<III", data, 54)
    if compression not in _BY_MASKS or 0 in masks:
        return None
    is_plain = {16: data[14] == _OLD_HEADER, 32: masks == _USUAL_MASKS}
    return None if is_plain.get(bits, True) else masks


def grey(image: np.ndarray) -> np.ndarray:
    """Luminance [H, W] of a decoded image [H, W] or [H, W, 1, 3 or 4] (blue first)."""
    channels = 1 if image.ndim == 2 else image.shape[2]
    if channels == 1:
        return np.ascontiguousarray(image.reshape(image.shape[:2]))
    code = cv2.COLOR_BGR2GRAY if channels == 3 else cv2.COLOR_BGRA2GRAY
    if image.dtype not in (np.uint8, np.uint16, np.float32):
        raise BadFrame(
            f"expected colour of uint8, uint16 or float32, found {image.dtype}"
        )
    return cv2.cvtColor(np.ascontiguousarray(image), code)


def ahead(function: Callable[[S], T], items: Sequence[S]) -> Iterator[T]:
    """map() over threads, some items ahead of the caller."""
    with ThreadPoolExecutor() as executor:
        waiting = executor.map(function, items[:AHEAD])
        for start in range(AHEAD, len(items) + AHEAD, AHEAD):
            ready = waiting
            waiting = executor.map(function, items[start : start + AHEAD])
            yield from ready


def stream_files(files: Sequence[Path], window: Window) -> Iterator[np.ndarray]:
    """Grey frames [H, W] of image files, one after the other, whatever their sizes.

    Raises:
        BadFrame: a file is no usable image, or the crop does not lie inside it.
    """
    return ahead(lambda file: frame_of(str(file), decode(file), window), files)


def frame_of(place: str, image: np.ndarray, window: Window) -> np.ndarray:
    """The pixels that are kept of a decoded image, in grey."""
    try:
        frame = grey(window.of(image))
    except (SettingError, BadFrame) as error:
        raise BadFrame(f"{place}: {error}") from error
    return check_finite(place, frame)


class Alike:
    """Grey frames of images that have the size and depth of the first.

    Attributes:
        size: (H, W) of an image.
        shape: of a frame, the pixels that are kept of it.
        dtype: of its pixels.
    """

    def __init__(self, place: str, first: np.ndarray, window: Window) -> None:
        self.size, self._window = first.shape[:2], window
        self.dtype = first.dtype
        self.shape = self.frame(place, first).shape

    def frame(self, place: str, image: np.ndarray) -> np.ndarray:
        """The frame of an image; a BadFrame for another size or depth."""
        if image.shape[:2] != self.size or image.dtype != self.dtype:
            found = f"{image.shape[1]} × {image.shape[0]} {image.dtype}"
            size = f"{self.size[1]} × {self.size[0]} pixels {self.dtype}"
            raise BadFrame(
                f"{place}: expected {size} as in the other frames, found {found}"
            )
        return frame_of(place, image, self._window)


def open_listing(
    root: Path,
    listing: Listing,
    window: Window,
    check: bool,
    memory_bytes: int,
) -> Recording:
    """Open the images of a folder; with ``check`` every one is decoded at once.

    Raises:
        BadFrame: a file is no usable image, or its size or depth is not that of the first.
    """
    files = listing.files
    images = Images(files, window)
    if check:
        images.check(memory_bytes)
    names = np.array([os.path.relpath(file, root) for file in files])
    samples = {**listing.about.samples, "file": names}
    return Recording(
        **vars(replace(listing.about, samples=samples)),
        frame_shape=images.shape,
        dtype=images.dtype,
        each=images.each,
        place=lambda i: str(files[i]),
        digest=cache(images.digest),
        window=window,
        other_files=tuple(listing.other_files),
        notes=tuple(listing.notes),
        image_shape=images.size,
    )


def whole_images(files: Sequence[Path]) -> np.ndarray:
    """Which files [N] are decoded as whole images."""

    def is_whole(file: Path) -> bool:
        try:
            decode(file)
        except BadFrame:
            return False
        return True

    found = with_progress(ahead(is_whole, files), len(files), "Looking for damage")
    return np.fromiter(found, bool, len(files))


class Images:
    """Image files of one size and depth, those of the first; decoded when asked for, or kept.

    Attributes:
        size: (H, W) of an image.
        shape: of a frame, the pixels that are kept of it.
        dtype: of its pixels.

    Raises:
        BadFrame: the first is no usable image.
    """

    def __init__(self, files: Sequence[Path], window: Window) -> None:
        self._files = files
        self._kept: list[np.ndarray] = []
        try:
            first = decode(files[0])
        except BadFrame as error:
            raise self._counted(error) from error
        self._alike = Alike(str(files[0]), first, window)
        self.dtype, self.shape = self._alike.dtype, self._alike.shape
        self.size = self._alike.size

    def check(self, memory_bytes: int) -> None:
        """Decode all of them, and keep them if they fit.

        Raises:
            BadFrame: one is no usable image, or its size or depth is not that of the first.
        """
        n = len(self._files)
        in_memory = n * math.prod(self.shape) * self.dtype.itemsize <= memory_bytes
        frames = with_progress(self.each(np.arange(n)), n, "Reading images")
        if in_memory:
            self._kept = list(frames)
        else:
            deque(frames, maxlen=0)

    def each(self, index: np.ndarray) -> Iterator[np.ndarray]:
        """Frames [H, W] of the indices, one after the other."""
        if self._kept:
            yield from (self._kept[i] for i in index)
            return
        try:
            yield from ahead(self._load, [self._files[i] for i in index])
        except BadFrame as error:
            raise self._counted(error) from error

    def _load(self, file: Path) -> np.ndarray:
        return self._alike.frame(str(file), decode(file))

    def _counted(self, error: BadFrame) -> BadFrame:
        """The error, and how many images are damaged where there are such."""
        damaged = int((~whole_images(self._files)).sum())
        if not damaged:
            return error
        n = len(self._files)
        return BadFrame(
            f"{error} ({damaged} of {n} images are damaged; --skip-damaged leaves them out)"
        )

    def digest(self) -> str:
        """SHA-256 over those of the files."""
        contents = (hashlib.sha256(file.read_bytes()).digest() for file in self._files)
        return hashlib.sha256(b"".join(contents)).hexdigest()
