"""Images: PNG, JPEG, BMP or TIFF of 8 or 16 bits, decoded to grey frames of as many bits.

Colour becomes luminance (ITU-R BT.601, 0.299 R + 0.587 G + 0.114 B) and an alpha channel is left
out. Pixels are as they are stored: no orientation tag is applied. OpenCV decodes, but a TIFF is
decoded by Pillow, as OpenCV leaves damaged strips as they come.
"""

from __future__ import annotations

import hashlib
import io
import math
import os
import warnings
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import Any, TypeVar

import cv2
import numpy as np
from PIL import Image, UnidentifiedImageError

from hdc.readers.files import BadFrame, SettingError, check_file
from hdc.readers.listing import Listing
from hdc.readers.recording import Recording, Window, class_indices, with_progress

S = TypeVar("S")
T = TypeVar("T")

FORMATS = ("PNG", "JPEG", "BMP", "TIFF")
_TIFF_MODES = {
    "1": "L",
    "L": "L",
    "P": "RGB",
    "RGB": "RGB",
    "I;16": "I;16",
    "I;16B": "I;16B",
}
"""Pillow's modes of a TIFF → what they are converted to."""
_ORIENTATION = 274
_STORED = {
    2: Image.Transpose.FLIP_LEFT_RIGHT,
    3: Image.Transpose.ROTATE_180,
    4: Image.Transpose.FLIP_TOP_BOTTOM,
    5: Image.Transpose.TRANSPOSE,
    6: Image.Transpose.ROTATE_90,
    7: Image.Transpose.TRANSVERSE,
    8: Image.Transpose.ROTATE_270,
}
"""A TIFF's orientation, which Pillow applies → what gives the pixels as they are stored."""
AHEAD = 16
"""Images decoded ahead of the caller."""


def decode(file: Path) -> np.ndarray:
    """The image [H, W] or [H, W, channels] of a file, uint8 or uint16 (blue first).

    Raises:
        BadFrame: it is no single, whole image of a kind that is read here; the file is named.
    """
    check_file(file)
    try:
        image = _decode(file, file.read_bytes())
    except UnidentifiedImageError as error:
        kinds = ", ".join(FORMATS)
        raise BadFrame(
            f"{file}: expected an image ({kinds}), found other data"
        ) from error
    except BadFrame:
        raise
    except Exception as error:  # broken bytes make Pillow raise a dozen different types
        raise BadFrame(
            f"{file}: expected a whole image, found: {str(error) or error!r}"
        ) from error
    if image is None:
        raise BadFrame(
            f"{file}: expected a whole image, found one that is damaged or truncated"
        )
    return image


def _decode(file: Path, data: bytes) -> np.ndarray | None:
    if not _is_plain_png(data):
        with Image.open(io.BytesIO(data), formats=FORMATS) as header:
            pages = getattr(header, "n_frames", 1)
            if pages > 1 and header.format != "MPO":
                raise BadFrame(f"{file}: expected a single image, found {pages}")
            if header.format == "TIFF":
                return _tiff(file, header)
    return cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED)


def _is_plain_png(data: bytes) -> bool:
    """Whether it is a PNG of one image, no bomb; Pillow takes 6 % of the decoding to say so."""
    pixels = int.from_bytes(data[16:20]) * int.from_bytes(data[20:24])
    single = b"acTL" not in data[: data.find(b"IDAT")]  # the mark of an animation
    return data.startswith(b"\x89PNG\r\n\x1a\n") and single and pixels <= 2**26


def _tiff(file: Path, image: Any) -> np.ndarray:
    bits = image.tag_v2.get(258, (8,))
    if image.mode not in _TIFF_MODES or bits[1:2] == (16,):
        raise BadFrame(
            f"{file}: expected a grey TIFF, or colour of 8 bits without alpha, found {image.mode}"
        )
    orientation = image.tag_v2.get(_ORIENTATION, 1)
    image = image.convert(_TIFF_MODES[image.mode])
    if orientation in _STORED:
        image = image.transpose(_STORED[orientation])
    pixels = np.asarray(image)
    if pixels.ndim == 3:
        return pixels[..., ::-1]
    return pixels.astype(pixels.dtype.newbyteorder("="))


def grey(image: np.ndarray) -> np.ndarray:
    """Luminance [H, W] of a decoded image [H, W] or [H, W, 1, 3 or 4] (blue first)."""
    channels = 1 if image.ndim == 2 else image.shape[2]
    if channels == 1:
        return np.ascontiguousarray(image.reshape(image.shape[:2]))
    code = cv2.COLOR_BGR2GRAY if channels == 3 else cv2.COLOR_BGRA2GRAY
    return cv2.cvtColor(np.ascontiguousarray(image), code)


def ahead(function: Callable[[S], T], items: Sequence[S]) -> Iterator[T]:
    """map() over threads, some items ahead of the caller."""
    with quiet(), ThreadPoolExecutor() as executor:
        waiting = executor.map(function, items[:AHEAD])
        for start in range(AHEAD, len(items) + AHEAD, AHEAD):
            ready = waiting
            waiting = executor.map(function, items[start : start + AHEAD])
            yield from ready


@contextmanager
def quiet() -> Iterator[None]:
    """Errors are raised, not logged as well; Pillow warns of tags that no pixel depends on."""
    level = cv2.utils.logging.getLogLevel()
    cv2.utils.logging.setLogLevel(cv2.utils.logging.LOG_LEVEL_SILENT)
    try:
        with warnings.catch_warnings():
            warnings.filterwarnings("ignore", module="PIL")
            yield
    finally:
        cv2.utils.logging.setLogLevel(level)


def stream_files(files: Sequence[Path], window: Window) -> Iterator[np.ndarray]:
    """Grey frames [H, W] of image files, one after the other, whatever their sizes.

    Raises:
        BadFrame: a file is no usable image, or the crop does not lie inside it.
    """
    return ahead(lambda file: _frame(file, decode(file), window), files)


def _frame(file: Path, image: np.ndarray, window: Window) -> np.ndarray:
    try:
        return grey(window.of(image))
    except SettingError as error:
        raise BadFrame(f"{file}: {error}") from error


def open_listing(
    root: Path,
    listing: Listing,
    window: Window,
    check: bool,
    fewest_classes: int,
    memory_bytes: int,
) -> Recording:
    """Open the images of a folder; with ``check`` every one is decoded at once.

    Raises:
        BadFrame: a file is no usable image, or its size or depth is not that of the first.
        ValueError: there are fewer classes than are needed.
    """
    images = _Images(listing.files, window)
    if check:
        images.check(memory_bytes)
    classes: tuple[str, ...] = ()
    labels = None
    if listing.labels is not None:
        classes, labels = class_indices(
            listing.labels, root, fewest_classes, listing.classes
        )
    names = [os.path.relpath(file, root) for file in listing.files]
    return Recording(
        classes=classes,
        labels=labels,
        shape=images.shape,
        dtype=images.dtype,
        samples={
            "order": np.arange(len(names)),
            **listing.samples,
            "file": np.array(names),
        },
        each=images.each,
        place=lambda i: str(listing.files[i]),
        digest=cache(images.digest),
        window=window,
        values=listing.values,
        value_names=listing.value_names,
        other_files=tuple(listing.other_files),
    )


class _Images:
    """Image files of one size and depth, those of the first; decoded when asked for, or kept.

    Raises:
        BadFrame: the first is no usable image.
    """

    def __init__(self, files: Sequence[Path], window: Window) -> None:
        self._files, self._window = files, window
        self._kept: list[np.ndarray] = []
        with quiet():
            first = decode(files[0])
        self._size = first.shape[:2]
        self.dtype = first.dtype
        self.shape = _frame(files[0], first, window).shape

    def check(self, memory_bytes: int) -> None:
        """Decode all of them, and keep them if they fit.

        Raises:
            BadFrame: one is no usable image, or its size or depth is not that of the first.
        """
        n = len(self._files)
        in_memory = n * math.prod(self.shape) * self.dtype.itemsize <= memory_bytes
        for frame in with_progress(ahead(self._load, self._files), n, "Reading images"):
            if in_memory:
                self._kept.append(frame)

    def each(self, index: np.ndarray) -> Iterator[np.ndarray]:
        """Frames [H, W] of the indices, one after the other."""
        if self._kept:
            return (self._kept[i] for i in index)
        return ahead(self._load, [self._files[i] for i in index])

    def _load(self, file: Path) -> np.ndarray:
        image = decode(file)
        if image.shape[:2] != self._size or image.dtype != self.dtype:
            height, width = self._size
            found = f"{image.shape[1]} × {image.shape[0]} {image.dtype}"
            wanted = f"{width} × {height} pixels {self.dtype} as in the other frames"
            raise BadFrame(f"{file}: expected {wanted}, found {found}")
        return _frame(file, image, self._window)

    def digest(self) -> str:
        """SHA-256 over those of the files."""
        contents = (hashlib.sha256(file.read_bytes()).digest() for file in self._files)
        return hashlib.sha256(b"".join(contents)).hexdigest()
