"""TIFF by tifffile: single images, and stacks of pages, of ImageJ, of OME; with the sign, depth and
polarity that the file states.

Frames whose file says that white is zero are inverted at their depth; an alpha channel is left out.
"""

from __future__ import annotations

import io
import logging
import shutil
import tempfile
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from logging.handlers import BufferingHandler
from pathlib import Path
from typing import Any

import numpy as np
import tifffile

from hdc.readers.files import BadFrame

_WHITE_IS_ZERO, _GREY, _RGB, _YCBCR, _MOSAIC = 0, 1, 2, 6, 32803
"""Values of the tag PhotometricInterpretation."""
_ALPHA = (1, 2)
"""Values of the tag ExtraSamples that mean alpha."""
_JPEG = (6, 7)
"""Values of the tag Compression: pixels in YCbCr are then decoded to RGB."""


class Stack:
    """Pages [N, H, W] or [N, H, W, 3] of one series of a TIFF.

    Args:
        place: the file, for errors.
        series: as tifffile has it.
        on_disk: plain pages are read as they are asked for; compressed ones are decoded once, into
            a temporary file.
    """

    def __init__(self, place: str, series: Any, on_disk: bool) -> None:
        self._page = series.keyframe
        _check_samples(place, series)
        _check_whole(place, series)
        pixels = _on_disk(place, series) if on_disk else series.asarray()
        channels = self._page.samplesperpixel
        axis = series.axes.find("S")
        if axis >= 0:
            pixels = np.moveaxis(pixels, axis, -1)
        sides = (self._page.imagelength, self._page.imagewidth)
        pixels = pixels.reshape(-1, *sides, channels)
        self._pixels = pixels[..., :3] if channels > 2 else pixels[..., 0]
        self.shape = self._pixels.shape
        self.axes = ("frame", "height", "width", "channel")[: len(self.shape)]
        self.dtype = np.dtype(np.uint8) if pixels.dtype == bool else pixels.dtype

    def notes(self) -> list[str]:
        """How the pixels were read, a phrase each."""
        page = self._page
        found = {
            "white is zero: inverted": int(page.photometric) == _WHITE_IS_ZERO,
            "a Bayer mosaic, left as it is": int(page.photometric) == _MOSAIC,
            "alpha left out": bool(page.extrasamples),
            f"{page.bitspersample} bits per pixel": page.bitspersample % 8 > 0,
        }
        return [note for note, holds in found.items() if holds]

    def __getitem__(self, key: Any) -> np.ndarray:
        """Pixels with white the largest; pixels of one bit are 0 and 255."""
        pixels = np.asarray(self._pixels[key])
        bits = self._page.bitspersample
        if pixels.dtype == bool:
            bits, pixels = 8, pixels.astype(np.uint8) * 255
        if int(self._page.photometric) == _WHITE_IS_ZERO:
            return 2**bits - 1 - pixels
        return pixels


def _on_disk(place: str, series: Any) -> Any:
    """Pixels that are read as they are asked for, out of the file or of a temporary one."""
    folder = tempfile.gettempdir()
    needed, free = series.nbytes, shutil.disk_usage(folder).free
    if series.dataoffset is None and needed > free:
        raise BadFrame(
            f"{place}: expected {needed} bytes free in {folder}, where compressed pages are "
            f"decoded, found {free} (TMPDIR names another folder)"
        )
    return series.asarray(out="memmap")


def _check_samples(place: str, series: Any) -> None:
    """Raise BadFrame for pixels that are neither grey nor RGB, with at most alpha beside them.

    A fourth sample of RGB is alpha even where its tag does not say so, as some writers leave it.
    """
    page = series.keyframe
    meaning, samples = int(page.photometric), page.samplesperpixel
    if meaning == _YCBCR and int(page.compression) in _JPEG:
        meaning = _RGB
    colours = {_WHITE_IS_ZERO: 1, _GREY: 1, _MOSAIC: 1, _RGB: 3}.get(meaning, 0)
    is_alpha = colours == 3 or all(int(kind) in _ALPHA for kind in page.extrasamples)
    if not colours or samples not in (colours, colours + is_alpha):
        name = getattr(page.photometric, "name", meaning)
        raise BadFrame(
            f"{place}: expected grey or RGB, and at most alpha beside them, found {samples} of "
            f"{name} (save a page each, or as PNG)"
        )
    if meaning == _WHITE_IS_ZERO and series.dtype.kind not in "ub":
        wanted = "unsigned pixels where white is zero"
        raise BadFrame(f"{place}: expected {wanted}, found {series.dtype}")


def _check_whole(place: str, series: Any) -> None:
    """Raise BadFrame for a file that ends before its pixels do."""
    size = series.parent.filehandle.size
    for page in series.pages:
        ends = zip(page.dataoffsets, page.databytecounts, strict=True)
        if any(start + count > size for start, count in ends):
            raise BadFrame(f"{place}: expected a whole file, found one that is cut off")


def stacks(path: Path) -> dict[str, Stack]:
    """The series of a TIFF by their numbers.

    Raises:
        BadFrame: it is damaged, or of a kind that is not read here.
    """
    with _strict(str(path)), tifffile.TiffFile(path) as file:
        shapes = {(series.shape, series.dtype, series.axes) for series in file.series}
    # Pages that Python wrote one by one are stated to be stacks of their own.
    shaped = False if len(shapes) == 1 and len(file.series) > 1 else None
    with _strict(str(path)), tifffile.TiffFile(path, is_shaped=shaped) as file:
        found = [Stack(str(path), series, on_disk=True) for series in file.series]
    return {str(number): stack for number, stack in enumerate(found)}


def image(place: str, data: bytes) -> np.ndarray:
    """The one image [H, W] or [H, W, 3] (red first) of a TIFF.

    Raises:
        BadFrame: it is damaged, or holds several.
    """
    with _strict(place), tifffile.TiffFile(io.BytesIO(data)) as file:
        found = [Stack(place, series, on_disk=False) for series in file.series]
    pages = sum(stack.shape[0] for stack in found)
    if pages != 1:
        raise BadFrame(f"{place}: expected a single image, found {pages}")
    pixels = found[0][0]
    return pixels.astype(pixels.dtype.newbyteorder("="), copy=False)


@contextmanager
def _strict(place: str) -> Iterator[None]:
    """Turn what tifffile logs or raises into a BadFrame: it goes on where pages are lost."""
    said = BufferingHandler(2**20)
    said.setLevel(logging.WARNING)
    logger = logging.getLogger("tifffile")
    logger.addHandler(said)
    try:
        yield
    except BadFrame:
        raise
    except Exception as error:  # damage makes tifffile raise a dozen different types
        if "requires the 'imagecodecs' package" in str(error):
            raise ModuleNotFoundError(name="imagecodecs") from error
        raise BadFrame(f"{place}: expected a whole TIFF, found: {error}") from error
    finally:
        logger.removeHandler(said)
    for record in said.buffer:
        if record.thread == threading.get_ident():
            raise BadFrame(
                f"{place}: expected a whole TIFF, found: {record.getMessage()}"
            )
