"""TIFF by tifffile: single images, and stacks of pages, of ImageJ, of OME; with the sign, depth and
polarity that the file states.

Frames whose file says that white is zero are inverted at their depth; an alpha channel is left out.
"""

from __future__ import annotations

import io
import logging
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import tifffile

from hdc.readers.files import BadFrame

_WHITE_IS_ZERO, _GREY, _RGB, _YCBCR, _MOSAIC = 0, 1, 2, 6, 32803
"""Values of the tag PhotometricInterpretation."""
_JPEG = (6, 7)
"""Values of the tag Compression: pixels in YCbCr are then decoded to RGB."""


class Stack:
    """Pages [N, H, W] or [N, H, W, 3] of one series of a TIFF, read when they are asked for."""

    def __init__(self, place: str, series: Any) -> None:
        self._place, self._series, self._page = place, series, series.keyframe
        self._check()
        samples = self._page.samplesperpixel
        sides = (self._page.imagelength, self._page.imagewidth)
        colour = (3,) if samples > 2 else ()
        self._planes = samples if int(self._page.planarconfig) == 2 else 1
        n = series.size // (sides[0] * sides[1] * samples)
        self.shape = (n, *sides, *colour)
        self._whole = None
        file = series.parent.filehandle
        if series.dataoffset is not None and file.is_file:
            kind = np.dtype(series.parent.byteorder + series.dtype.char)
            own = (n, samples, *sides) if self._planes > 1 else (n, *sides, samples)
            self._whole = file.memmap_array(kind, own, series.dataoffset)
        self.dtype = self[0].dtype

    def _check(self) -> None:
        """Raise BadFrame for pixels of a meaning that is not read here, or that are cut off."""
        page = self._page
        meaning = int(page.photometric)
        as_rgb = meaning == _YCBCR and int(page.compression) in _JPEG
        signed = np.dtype(self._series.dtype).kind not in "ub"
        if meaning not in (_WHITE_IS_ZERO, _GREY, _RGB, _MOSAIC) and not as_rgb:
            found = getattr(page.photometric, "name", meaning)
            raise BadFrame(
                f"{self._place}: expected grey or RGB, found {found} (PIL.Image.open(file)"
                ".convert('RGB').save('x.png') converts it)"
            )
        if meaning == _WHITE_IS_ZERO and signed:
            raise BadFrame(
                f"{self._place}: expected unsigned pixels where white is zero, found "
                f"{self._series.dtype}"
            )
        size = self._series.parent.filehandle.size
        for part in self._series.pages:
            ends = zip(part.dataoffsets, part.databytecounts, strict=True)
            if any(start + count > size for start, count in ends):
                raise BadFrame(f"{self._place}: expected a whole file, found a cut one")

    def notes(self) -> list[str]:
        """How the pixels were read, a phrase each."""
        page = self._page
        found = []
        if int(page.photometric) == _WHITE_IS_ZERO:
            found.append("white is zero: inverted")
        if int(page.photometric) == _MOSAIC:
            found.append("a Bayer mosaic, left as it is")
        if page.extrasamples:
            found.append("alpha left out")
        if page.bitspersample not in (8, 16, 32, 64):
            found.append(f"{page.bitspersample} bits a pixel")
        return found

    def __getitem__(self, key: Any) -> np.ndarray:
        """The page of a number, or of a tuple that begins with it."""
        number, *rest = key if isinstance(key, tuple) else (key,)
        sides = self.shape[1:3]
        if self._whole is not None:
            pixels = np.asarray(self._whole[number])
        else:
            with strict(self._place):
                pixels = self._decoded(int(number))
        if self._planes > 1:
            pixels = np.moveaxis(pixels, 0, -1)
        pixels = pixels.reshape(*sides, -1)
        pixels = pixels[..., :3] if len(self.shape) == 4 else pixels[..., 0]
        return self._meant(pixels)[tuple(rest)]

    def _decoded(self, number: int) -> np.ndarray:
        page = self._series.pages[number]
        return np.asarray(page.asarray())

    def _meant(self, pixels: np.ndarray) -> np.ndarray:
        """Pixels of this machine's byte order, white the largest; two values are 0 and 255."""
        pixels = pixels.astype(pixels.dtype.newbyteorder("="), copy=False)
        if pixels.dtype == bool:
            pixels = pixels.astype(np.uint8) * 255
        if int(self._page.photometric) != _WHITE_IS_ZERO:
            return pixels
        bits = self._page.bitspersample
        white = 255 if bits == 1 else 2**bits - 1
        return (white - pixels).astype(pixels.dtype)


def stacks(path: Path) -> dict[str, Stack]:
    """The series of a TIFF by their numbers; the file stays open while they are used.

    Raises:
        BadFrame: it is damaged, or of a kind that is not read here.
    """
    with strict(str(path)):
        found = tifffile.TiffFile(path)
        return {
            str(number): Stack(str(path), series)
            for number, series in enumerate(found.series)
        }


def image(place: str, data: bytes) -> np.ndarray:
    """The one image [H, W] or [H, W, 3] (red first) of a TIFF.

    Raises:
        BadFrame: it is damaged, or holds several.
    """
    with strict(place), tifffile.TiffFile(io.BytesIO(data)) as file:
        found = [Stack(place, series) for series in file.series]
        pages = sum(stack.shape[0] for stack in found)
        if pages != 1:
            raise BadFrame(f"{place}: expected a single image, found {pages}")
        return found[0][0]


@contextmanager
def strict(place: str) -> Iterator[None]:
    """What tifffile logs or raises becomes a BadFrame: it goes on where pages are lost."""
    said = _Said()
    logger = logging.getLogger("tifffile")
    logger.addHandler(said)
    try:
        yield
    except BadFrame:
        raise
    except Exception as error:  # damage makes tifffile raise a dozen different types
        raise BadFrame(f"{place}: expected a whole TIFF, found: {error}") from error
    finally:
        logger.removeHandler(said)
    if said.lines:
        raise BadFrame(f"{place}: expected a whole TIFF, found: {said.lines[0]}")


class _Said(logging.Handler):
    """Keeps what was logged in the thread that made it."""

    def __init__(self) -> None:
        super().__init__(logging.WARNING)
        self._thread = threading.get_ident()
        self.lines: list[str] = []

    def emit(self, record: logging.LogRecord) -> None:
        if record.thread == self._thread:
            self.lines.append(record.getMessage())
