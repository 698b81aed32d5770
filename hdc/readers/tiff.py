"""TIFF by tifffile: single images, and stacks of pages, of ImageJ, of OME; with the sign and depth
that the file states.

An alpha channel is left out, and an image whose white is zero is refused.
"""

from __future__ import annotations

import logging
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from logging.handlers import BufferingHandler
from pathlib import Path
from typing import Any

import numpy as np
import tifffile

from hdc.readers.files import BadFrame

_SAMPLES = {1: (1,), 2: (3, 4)}
"""How many samples a pixel may have, by the tag PhotometricInterpretation: grey, or RGB, of which
the fourth is alpha even where its tag does not say so."""


def _stack(path: Path, series: Any) -> Any:
    """The pages of a series as tifffile has it, without alpha; plain ones are read as they are
    asked for."""
    page = series.keyframe
    _check_samples(path, page)
    pixels = series.asarray(out=None if series.dataoffset is None else "memmap")
    axis = series.axes.find("S")
    if axis >= 0:
        pixels = np.moveaxis(pixels, axis, -1)
    channels = page.samplesperpixel
    pixels = pixels.reshape(-1, page.imagelength, page.imagewidth, channels)
    return pixels[..., :3] if channels > 2 else pixels[..., 0]


def _check_samples(path: Path, page: Any) -> None:
    """Raise BadFrame for pixels that are neither grey nor RGB."""
    samples, bits = page.samplesperpixel, page.bitspersample
    if samples not in _SAMPLES.get(int(page.photometric), ()) or bits == 1:
        name = getattr(page.photometric, "name", page.photometric)
        raise BadFrame(
            f"{path}: expected grey or RGB of 8 bits or more, found {samples} of {name}, {bits} "
            "bits (save a page each, or as PNG)"
        )


def stacks(path: Path) -> list[Any]:
    """Pages [N, H, W] or [N, H, W, 3] of each series of a TIFF.

    Raises:
        BadFrame: it is damaged, or of a kind that is not read here.
    """
    # Pages that Python wrote one by one are stated to be stacks of their own.
    with _strict(path), tifffile.TiffFile(path, is_shaped=False) as file:
        return [_stack(path, series) for series in file.series]


def image(path: Path) -> np.ndarray:
    """The one image [H, W] or [H, W, 3] (red first) of a TIFF.

    Raises:
        BadFrame: it is damaged, or holds several.
    """
    found = stacks(path)
    pages = sum(map(len, found))
    if pages != 1:
        raise BadFrame(f"{path}: expected a single image, found {pages}")
    return np.array(found[0][0], found[0].dtype.newbyteorder("="))


@contextmanager
def _strict(path: Path) -> Iterator[None]:
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
        raise BadFrame(f"{path}: expected a whole TIFF, found: {error}") from error
    finally:
        logger.removeHandler(said)
    for record in said.buffer:
        if record.thread == threading.get_ident():
            raise BadFrame(
                f"{path}: expected a whole TIFF, found: {record.getMessage()}"
            )
