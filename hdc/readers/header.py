"""What an image file says of itself, read by Pillow without decoding it, and whether it is whole.

OpenCV decodes; it is not asked before the header is checked, because a few bytes can announce an
image of gigabytes, and because some of its versions return the readable part of a truncated file.
What their decoders disagree on, or what no camera writes, is refused as well. Pillow's readers are
called by name and not by ``Image.open``, whose limit of pixels is a setting of the whole process.
Sources: PNG 3rd edition (W3C 2025), JPEG ITU-T T.81, TIFF 6.0 (1992).
"""

from __future__ import annotations

import io
import re
import struct
import zlib
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, BinaryIO

from PIL import BmpImagePlugin, JpegImagePlugin, PngImagePlugin, TiffImagePlugin

from hdc.readers.listing import SUFFIXES

_SIGNATURES = (
    (b"\x89PNG\r\n\x1a\n", "PNG"),
    (b"\xff\xd8\xff", "JPEG"),
    (b"BM", "BMP"),
    (b"II*\0", "TIFF"),
    (b"MM\0*", "TIFF"),
)


@dataclass(frozen=True)
class Header:
    """A header that was checked.

    Attributes:
        size: (height, width) in pixels.
        check_whole: raises a ValueError unless the bytes of the file, which are its argument, hold
            all that was announced.
    """

    size: tuple[int, int]
    check_whole: Callable[[bytes], None]


def read_header(file: BinaryIO, suffix: str, max_pixels: int) -> Header:
    """The header of a single, grey or colour image.

    Args:
        file: opened image file.
        suffix: suffix of its name, with the dot.
        max_pixels: images that announce more are refused.

    Raises:
        ValueError: the bytes are of another format than the suffix says or of none, too many
            pixels, animated or multi-page, CMYK, or of a kind that is not read here.
    """
    expected = SUFFIXES.get(suffix.lower())
    if expected is None:
        raise ValueError(f"expected a file {', '.join(SUFFIXES)}, found {suffix or 'no suffix'}")
    start = file.read(8)
    found = next((name for mark, name in _SIGNATURES if start.startswith(mark)), None)
    if found != expected:
        raise ValueError(f"expected {expected} data in a file {suffix}, found {found or 'other'}")
    file.seek(0)
    if expected == "TIFF":
        _check_directory(file)
        file.seek(0)
    reader, check, check_whole = _READERS[expected]
    image = _named(expected, reader, file)
    width, height = image.size
    _check_size(height, width, max_pixels)
    check(image, max_pixels)

    def whole(data: bytes) -> None:
        _named(expected, check_whole, image, data)

    return Header((height, width), whole)


class _Refused(ValueError):
    """A sentence of this module."""


def _named(kind: str, function: Callable[..., Any], *arguments: Any) -> Any:
    """One sentence for whatever Pillow raises on broken bytes: a dozen different types."""
    try:
        return function(*arguments)
    except _Refused:
        raise
    except Exception as error:
        found = str(error) or type(error).__name__
        raise ValueError(f"expected a complete, intact {kind} file, found: {found}") from error


def _check_size(height: int, width: int, max_pixels: int) -> None:
    if height < 1 or width < 1:
        raise _Refused(f"expected at least one pixel, found {width} × {height}")
    if height * width > max_pixels:
        raise _Refused(
            f"expected at most {max_pixels} pixels (max_pixels), found {width} × {height}"
        )


def _check_png(image: Any, max_pixels: int) -> None:
    if image.custom_mimetype == "image/apng":
        raise _Refused("expected a single image, found an animated PNG")


def _png_is_whole(image: Any, data: bytes) -> None:
    """Every chunk is there, with its check sum; those of the pixels are left to the decoder, which
    computes them anyway and gives no image if one is wrong."""
    at, kind = 8, b""
    while kind != b"IEND":
        if at + 12 > len(data):
            raise _Refused("expected a complete file, found it truncated")
        length, kind = struct.unpack_from(">I4s", data, at)
        start, at = at + 4, at + 12 + length
        if at > len(data):
            raise _Refused("expected a complete file, found it truncated")
        stated = int.from_bytes(data[at - 4 : at])
        if kind != b"IDAT" and zlib.crc32(data[start : at - 4]) != stated:
            raise _Refused(f"expected intact chunks, found another check sum of {kind!r}")


def _check_bmp(image: Any, max_pixels: int) -> None:
    if image.tile[0].codec_name != "raw":
        raise _Refused(f"expected an uncompressed bitmap, found {image.tile[0].codec_name}")


def _bmp_is_whole(image: Any, data: bytes) -> None:
    _, stride, _ = image.tile[0].args
    if image.tile[0].offset + stride * image.height > len(data):
        raise _Refused("expected a complete file, found it truncated")


_MARKER = re.compile(rb"\xff+([^\x00\xff])")  # in coded pixels, 255 is followed by zero
_MOST_SCANS = 64
"""Of a JPEG: a progressive one of many costs a pass over all pixels for some bytes each."""
_MOST_STRETCHES = 2**14
_FILLER = b"\xdb\x6d\xb6" * 8 + bytes((37 * k * k + 11) % 251 for k in range(40))
"""Bits 110 again and again, which in the usual tables mean something else than the zeros that a
decoder makes up; then any others."""


def _check_jpeg(image: Any, max_pixels: int) -> None:
    if image.mode not in ("L", "RGB"):
        raise _Refused(f"expected a grey or colour image, found {image.mode}")


def _jpeg_is_whole(image: Any, data: bytes) -> None:
    """Every coded stretch, up to the next marker, holds all pixels that it should.

    Decoders make up the pixels for which there are no bytes, and skip bytes for which there are no
    pixels. So bytes put after a stretch change the image where, and only where, some were lost.
    """
    whole, filled = (
        JpegImagePlugin.JpegImageFile(io.BytesIO(version)).tobytes()
        for version in (data, _filled(data))
    )
    if whole != filled:
        raise _Refused("expected a complete file, found that it lost some of its pixels")


def _filled(data: bytes) -> bytes:
    """A JPEG with bytes put after each coded stretch: after its scans, and where they restart."""
    parts: list[bytes] = []
    start, at, scans, restarts = 0, 2, 0, 0
    while True:
        if (found := _MARKER.match(data, at)) is None:
            raise _Refused(f"expected a complete file, found no JPEG marker at byte {at}")
        marker, at = found[1][0], found.end()
        if marker == 0xD9:  # end of image
            return b"".join([*parts, data[start:]])
        if 0xC0 <= marker <= 0xCF and marker not in (0xC0, 0xC1, 0xC2, 0xC4, 0xC8, 0xCC):
            raise _Refused(f"expected Huffman coding, found a JPEG of process {marker - 0xC0}")
        if marker == 0xD8:
            raise _Refused(f"expected a complete file, found another beginning at byte {at}")
        restart = 0xD0 <= marker <= 0xD7
        if not restart and marker != 0x01:  # all others have a length
            at += struct.unpack_from(">H", data, at)[0]
        if not restart and marker != 0xDA:
            continue
        scans, restarts = (scans, restarts + 1) if restart else (scans + 1, 0)
        if scans > _MOST_SCANS or len(parts) > _MOST_STRETCHES:
            scans += data.count(b"\xff\xda", at)
            raise _Refused(f"expected at most {_MOST_SCANS} scans, found {scans}")
        if (following := _MARKER.search(data, at)) is None:
            raise _Refused("expected a complete file, found it truncated")
        at = following.start()
        parts += [data[start:at], _FILLER]
        if not 0xD0 <= following[1][0] <= 0xD7:  # the scan ends; maybe it should restart once more
            parts += [bytes([0xFF, 0xD0 + restarts % 8]), _FILLER]
        start = at


_TIFF_LIMIT = 2**16
"""Values of one tag, as many as an image may have strips or tiles: each becomes an object."""
_TIFF_NUMBERS = {254, 256, 257, 258, 259, 262, 273, 274, 277, 279, 284, 322, 323, 324, 325, 339}
_TIFF_CODINGS = (1, 5, 8, 32773, 32946)  # none, LZW, deflate, PackBits, deflate before it had 8
_TIFF_PHOTOMETRIC = {1: "grey", 2: "RGB", 3: "palette", 6: "YCbCr"}


def _check_directory(file: BinaryIO) -> None:
    """One directory, no tag twice (readers differ in which of the two counts) or of many values."""
    try:
        head = file.read(8)
        order = "<" if head[:2] == b"II" else ">"
        file.seek(struct.unpack(order + "I", head[4:])[0])
        (number,) = struct.unpack(order + "H", file.read(2))
        entries = list(struct.iter_unpack(order + "HHI4x", file.read(12 * number)))
        (following,) = struct.unpack(order + "I", file.read(4))
    except struct.error as error:
        raise ValueError("expected a complete file, found it truncated") from error
    seen: set[int] = set()
    for tag, kind, count in entries:
        if tag in seen:
            raise ValueError(f"expected each TIFF tag once, found {tag} again")
        seen.add(tag)
        if count > _TIFF_LIMIT and tag in _TIFF_NUMBERS:
            raise ValueError(f"expected at most {_TIFF_LIMIT} values, found {count} of tag {tag}")
        if kind not in (1, 3, 4) and tag in _TIFF_NUMBERS:
            raise ValueError(f"expected integers in the TIFF tag {tag}, found type {kind}")
        if count != 1 and tag in (256, 257, 322, 323):
            raise ValueError(f"expected one value of the TIFF tag {tag}, found {count}")
    if following:
        raise ValueError("expected a single image, found a multi-page TIFF")


def _check_tiff(image: Any, max_pixels: int) -> None:
    tags = image.tag_v2

    def first(tag: int) -> Any:
        value = tags.get(tag, 1)  # that is the default of all that are asked for
        return value[0] if isinstance(value, tuple) else value

    if (photometric := first(262)) not in _TIFF_PHOTOMETRIC:
        kind = "CMYK" if photometric == 5 else f"photometric interpretation {photometric}"
        raise _Refused(f"expected a grey or colour image, found {kind}")
    if first(339) != 1:
        raise _Refused("expected unsigned integer pixels, found signed or floating point ones")
    if first(258) not in (1, 8, 16):
        raise _Refused(f"expected 8 or 16 bits a pixel, found {first(258)}")
    if first(277) not in (1, 3):  # OpenCV multiplies by alpha, and makes 8 bits of 16
        raise _Refused(f"expected a TIFF without alpha, found {first(277)} values a pixel")
    if first(274) != 1:  # OpenCV turns these, and no image of another format
        raise _Refused(
            f"expected pixels as they are seen, found a TIFF of orientation {first(274)}"
        )
    if first(259) not in _TIFF_CODINGS:
        raise _Refused(f"expected no compression, LZW, deflate or PackBits, found {first(259)}")
    if any(first(tag) != 1 for tag in (32997, 32998)):  # of a volume and of its tiles
        raise _Refused("expected a single image, found a TIFF of several planes")
    if 324 in tags:  # a tile is decoded whole, however little of it is inside the image
        _check_size(first(323), first(322), max_pixels)


def _tiff_is_whole(image: Any, data: bytes) -> None:
    tags = image.tag_v2
    starts, lengths = (tags[324], tags[325]) if 324 in tags else (tags[273], tags[279])
    if len(starts) != len(lengths):
        raise _Refused(f"expected {len(starts)} strip lengths, found {len(lengths)}")
    if any(start + length > len(data) for start, length in zip(starts, lengths, strict=True)):
        raise _Refused("expected a complete file, found it truncated")
    bits = sum(tags.get(258, (1,)))
    if tags.get(259, 1) == 1 and sum(lengths) * 8 < image.width * image.height * bits:
        raise _Refused("expected a complete file, found fewer pixels than announced")


_READERS: dict[str, tuple[Callable[..., Any], Callable[..., None], Callable[..., None]]] = {
    "PNG": (PngImagePlugin.PngImageFile, _check_png, _png_is_whole),
    "JPEG": (JpegImagePlugin.JpegImageFile, _check_jpeg, _jpeg_is_whole),
    "BMP": (BmpImagePlugin.BmpImageFile, _check_bmp, _bmp_is_whole),
    "TIFF": (TiffImagePlugin.TiffImageFile, _check_tiff, _tiff_is_whole),
}
