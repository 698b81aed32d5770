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
TIFF_MODES = {
    "1": "L",
    "L": "L",
    "P": "RGB",
    "RGB": "RGB",
    "I;16": "I;16",
    "I;16B": "I;16B",
}
"""Pillow's modes of a TIFF → what they are converted to."""
AHEAD = 16
"""Images decoded ahead of the caller."""


def decode(file: Path) -> np.ndarray:
    """The image [H, W] or [H, W, channels] of a file, uint8 or uint16 (blue first).

    Raises:
        BadFrame: it is no single, whole image of a kind that is read here; the file is named.
    """
    check_file(file)
    try:
        data = file.read_bytes()
        if not _is_plain_png(data):
            with Image.open(io.BytesIO(data), formats=FORMATS) as header:
                if header.format != "MPO" and (n := getattr(header, "n_frames", 1)) > 1:
                    raise BadFrame(f"{file}: expected a single image, found {n}")
                if header.format == "TIFF":
                    return _tiff(file, header)
        image = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED)
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


def _is_plain_png(data: bytes) -> bool:
    """Whether it is a PNG of one image, no bomb; Pillow takes 6 % of the decoding to say so."""
    pixels = int.from_bytes(data[16:20]) * int.from_bytes(data[20:24])
    single = b"acTL" not in data[: data.find(b"IDAT")]  # the mark of an animation
    return data.startswith(b"\x89PNG\r\n\x1a\n") and single and pixels <= 2**26


def _tiff(file: Path, image: Any) -> np.ndarray:
    bits = image.tag_v2.get(258, (8,))
    if image.mode not in TIFF_MODES or bits[1:2] == (16,):
        raise BadFrame(
            f"{file}: expected a grey TIFF, or colour of 8 bits without alpha, found {image.mode}"
        )
    pixels = np.asarray(image.convert(TIFF_MODES[image.mode]))
    return (
        pixels[..., ::-1]
        if pixels.ndim == 3
        else pixels.astype(pixels.dtype.newbyteorder("="))
    )


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
            ready, waiting = (
                waiting,
                executor.map(function, items[start : start + AHEAD]),
            )
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
    files = listing.files
    with quiet():
        first = decode(files[0])
    (height, width), dtype = first.shape[:2], first.dtype
    shape = _frame(files[0], first, window).shape

    def load(file: Path) -> np.ndarray:
        image = decode(file)
        if image.shape[:2] != (height, width) or image.dtype != dtype:
            found = f"{image.shape[1]} × {image.shape[0]} {image.dtype}"
            wanted = f"{width} × {height} pixels {dtype} as in the other frames"
            raise BadFrame(f"{file}: expected {wanted}, found {found}")
        return _frame(file, image, window)

    kept: list[np.ndarray] = []
    if check:
        in_memory = len(files) * math.prod(shape) * dtype.itemsize <= memory_bytes
        frames = with_progress(ahead(load, files), len(files), "Reading images")
        kept = [frame for frame in frames if in_memory]
    classes: tuple[str, ...] = ()
    labels = None
    if listing.labels is not None:
        classes, labels = class_indices(
            listing.labels, root, fewest_classes, listing.classes
        )

    def digest() -> str:
        contents = (hashlib.sha256(file.read_bytes()).digest() for file in files)
        return hashlib.sha256(b"".join(contents)).hexdigest()

    def each(index: np.ndarray) -> Iterator[np.ndarray]:
        return (
            (kept[i] for i in index) if kept else ahead(load, [files[i] for i in index])
        )

    return Recording(
        classes=classes,
        labels=labels,
        shape=(shape[0], shape[1]),
        samples={
            "order": np.arange(len(files)),
            **listing.samples,
            "file": np.array([os.path.relpath(file, root) for file in files]),
        },
        each=each,
        place=lambda i: str(files[i]),
        digest=cache(digest),
        window=window,
        values=listing.values,
        value_names=listing.value_names,
        other_files=tuple(listing.other_files),
    )
