"""Images: PNG, JPEG, BMP or TIFF, decoded to grey frames of as many bits.

Colour becomes luminance (ITU-R BT.601, 0.299 R + 0.587 G + 0.114 B) and an alpha channel is left
out. Pixels are as they are stored: no orientation tag is applied. OpenCV decodes; a TIFF is decoded
by tifffile.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import TypeVar

import cv2
import numpy as np

from hdc.readers.files import BadFrame, SettingError
from hdc.readers.recording import Window, check_finite

S = TypeVar("S")
T = TypeVar("T")

PNG, JPEG, BMP = b"\x89PNG\r\n\x1a\n", b"\xff\xd8\xff", b"BM"
TIFF = (b"II*\0", b"MM\0*", b"II+\0", b"MM\0+")  # + : BigTIFF
"""How these files begin."""
_END_MARK = 0xD9
_IN_SCANS = (0x00, 0x01, *range(0xD0, 0xD8), 0xFF)
"""Second bytes of what may stand within a scan: a byte 255, a restart, filling."""
_BY_MASKS, _USUAL_MASKS = (3, 6), (0xFF0000, 0xFF00, 0xFF)
"""BMP: compressions by masks, and the masks of 32 bits that OpenCV reads."""
AHEAD = 16
"""Images decoded ahead of the caller."""


def decode(file: Path) -> np.ndarray:
    """The image [H, W] or [H, W, channels] of a file (blue first), integers or floats.

    Raises:
        BadFrame: it is no single, whole image of a kind that is read here; the file is named.
    """
    try:
        data = file.read_bytes()
    except OSError as error:
        raise BadFrame(f"{file}: expected a readable file, found none") from error
    place = str(file)
    if data.startswith(TIFF):
        from hdc.readers import tiff

        image = tiff.image(file)
        return image if image.ndim == 2 else image[..., ::-1]
    if data.startswith(PNG):
        if b"acTL" in data[: data.find(b"IDAT")]:  # the mark of an animation
            raise BadFrame(f"{place}: expected a single image, found an animation")
    elif data.startswith(JPEG):
        data = _whole_jpeg(place, data)
    elif data.startswith(BMP):
        _check_bmp(place, data)
    else:
        raise BadFrame(
            f"{place}: expected an image (PNG, JPEG, BMP, TIFF), found other data"
        )
    try:
        found = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED)
    except cv2.error:
        found = None
    if found is None:
        raise _damaged(place)
    return found


def _damaged(place: str) -> BadFrame:
    return BadFrame(
        f"{place}: expected a whole image, found one that is damaged or truncated"
    )


def _check_bmp(place: str, data: bytes) -> None:
    """Raise BadFrame for pixels that are parted by masks of their own: OpenCV takes others."""
    bits, compression = struct.unpack_from("<HI", data.ljust(66), 28)
    masks = struct.unpack_from("<III", data.ljust(66), 54)
    if compression in _BY_MASKS and (bits != 32 or masks != _USUAL_MASKS):
        raise BadFrame(
            f"{place}: expected a BMP without masks of its own (save it as PNG), found {bits} bits "
            f"with {', '.join(map(hex, masks))}"
        )


def _whole_jpeg(place: str, data: bytes) -> bytes:
    """The image without what follows its end, such as the film of a motion photo.

    Raises:
        BadFrame: it is cut: decoders go on over that.
    """
    at = 2
    while 0 <= at < len(data) - 1:
        mark = data[at + 1]
        if data[at] != 0xFF or mark in _IN_SCANS:
            at = data.find(b"\xff", at + 1)
        elif mark == _END_MARK:
            return data[: at + 2]
        else:
            at += 2 + int.from_bytes(data[at + 2 : at + 4])
    raise _damaged(place)


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


class Images:
    """Grey frames of images that have the size and depth of the first, decoded when asked for.

    Args:
        files: their N files.
        window: pixels that are kept.

    Attributes:
        size: (H, W) of an image.
        shape, dtype: of a frame.

    Raises:
        BadFrame: the first is no usable image.
    """

    def __init__(self, files: Sequence[Path], window: Window) -> None:
        self._files, self._window = files, window
        first = decode(files[0])
        self.size, self.dtype = first.shape[:2], first.dtype
        self.shape = frame_of(self.place(0), first, window).shape

    def place(self, i: int) -> str:
        """The file of a frame."""
        return str(self._files[i])

    def each(self, index: np.ndarray) -> Iterator[np.ndarray]:
        """Frames [H, W] of the indices, one after the other."""
        return ahead(self._frame, index.tolist())

    def _frame(self, i: int) -> np.ndarray:
        image = decode(self._files[i])
        if image.shape[:2] != self.size or image.dtype != self.dtype:
            found = f"{image.shape[1]} × {image.shape[0]} {image.dtype}"
            size = f"{self.size[1]} × {self.size[0]} pixels {self.dtype}"
            raise BadFrame(
                f"{self.place(i)}: expected {size} as in the other frames, found {found}"
            )
        return frame_of(self.place(i), image, self._window)
