"""What an image file says of itself, read from its bytes without decoding a pixel.

OpenCV decodes; it is not asked before the header is checked, because a few bytes can announce an
image of gigabytes, and because some of its versions return the readable part of a truncated file.
What their decoders disagree on, or what no camera writes, is refused as well.
Sources: PNG 3rd edition (W3C 2025), JPEG ITU-T T.81, TIFF 6.0 (1992), BMP [MS-WMF] 2.2.2.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterator

SUFFIXES = {
    ".png": "PNG",
    ".jpg": "JPEG",
    ".jpeg": "JPEG",
    ".bmp": "BMP",
    ".tif": "TIFF",
    ".tiff": "TIFF",
}
_SIGNATURES = (
    (b"\x89PNG\r\n\x1a\n", "PNG"),
    (b"\xff\xd8\xff", "JPEG"),
    (b"BM", "BMP"),
    (b"II*\0", "TIFF"),
    (b"MM\0*", "TIFF"),
)


def image_size(data: bytes, suffix: str, max_pixels: int) -> tuple[int, int]:
    """(height, width) of a complete, single, grey or colour image.

    Args:
        data: the whole file.
        suffix: of its name, with the dot.
        max_pixels: refuse an image that announces more.

    Raises:
        ValueError: the bytes are of another format than the suffix says or of none, truncated,
            too large, animated or multi-page, CMYK, or of a kind that is not read here.
    """
    expected = SUFFIXES.get(suffix.lower())
    if expected is None:
        raise ValueError(f"expected a file {', '.join(SUFFIXES)}, found {suffix or 'no suffix'}")
    found = next((name for mark, name in _SIGNATURES if data.startswith(mark)), None)
    if found != expected:
        raise ValueError(f"expected {expected} data in a file {suffix}, found {found or 'other'}")
    try:
        return _READERS[expected](data, max_pixels)
    except (struct.error, IndexError) as error:
        raise ValueError("expected a complete file, found it truncated") from error


def _checked(height: int, width: int, max_pixels: int) -> tuple[int, int]:
    if height < 1 or width < 1:
        raise ValueError(f"expected at least one pixel, found {width} × {height}")
    if height * width > max_pixels:
        raise ValueError(
            f"expected at most {max_pixels} pixels (scene.max_pixels), found {width} × {height}"
        )
    return height, width


def _png(data: bytes, max_pixels: int) -> tuple[int, int]:
    """Chunks of length, type, contents and check sum, from IHDR to IEND."""
    length, kind, width, height = struct.unpack_from(">I4sII", data, 8)
    if kind != b"IHDR" or length != 13:
        raise ValueError("expected a PNG header chunk, found none")
    size = _checked(height, width, max_pixels)
    at = 8
    while kind != b"IEND":
        length, kind = struct.unpack_from(">I4s", data, at)
        if at + 12 + length > len(data):
            raise ValueError("expected a complete file, found it truncated")
        (check,) = struct.unpack_from(">I", data, at + 8 + length)
        if zlib.crc32(memoryview(data)[at + 4 : at + 8 + length]) != check:
            raise ValueError(f"expected intact data, found a wrong check sum at byte {at}")
        if kind == b"acTL":
            raise ValueError("expected a single image, found an animated PNG")
        at += 12 + length
    return size


_MOST_SCANS = 64
"""Of a JPEG: a progressive one of many costs a pass over all pixels for some bytes each."""


def _jpeg(data: bytes, max_pixels: int) -> tuple[int, int]:
    """Marker segments up to the first scan; the last marker has to be the end of the image."""
    size = None
    at = 2
    while True:
        if data[at] != 0xFF:
            raise ValueError(f"expected a JPEG marker, found none at byte {at}")
        marker = data[at + 1]
        if marker == 0xFF:  # a fill byte
            at += 1
            continue
        if marker == 0x01 or 0xD0 <= marker <= 0xD7:  # markers without a length
            at += 2
            continue
        if marker in (0xD9, 0xDA):  # end of image, start of scan
            break
        (length,) = struct.unpack_from(">H", data, at + 2)
        if 0xC0 <= marker <= 0xCF and marker not in (0xC4, 0xC8, 0xCC):  # a frame header
            precision, height, width, components = struct.unpack_from(">BHHB", data, at + 4)
            size = _checked(height, width, max_pixels)
            if precision != 8:
                raise ValueError(f"expected 8 bits a sample, found {precision}")
            if components not in (1, 3):
                kind = "CMYK" if components == 4 else f"{components} components"
                raise ValueError(f"expected a grey or colour image, found {kind}")
        at += 2 + length
    if size is None or marker == 0xD9:
        raise ValueError("expected an image, found a JPEG without one")
    if data.rfind(b"\xff\xd9") < at:
        raise ValueError("expected a complete file, found it truncated")
    # No two such bytes are in the coded pixels themselves.
    if (scans := data.count(b"\xff\xda", at)) > _MOST_SCANS:
        raise ValueError(f"expected at most {_MOST_SCANS} scans, found {scans}")
    return size


def _bmp(data: bytes, max_pixels: int) -> tuple[int, int]:
    """File header, bitmap header, and rows padded to 4 bytes."""
    offset, header = struct.unpack_from("<II", data, 10)
    if header < 40:
        raise ValueError(f"expected a bitmap header of at least 40 bytes, found {header}")
    width, height, _, bits, coding = struct.unpack_from("<iiHHI", data, 18)
    size = _checked(abs(height), width, max_pixels)  # negative: rows run from the top
    if coding not in (0, 3) or bits not in (1, 4, 8, 16, 24, 32):
        raise ValueError(f"expected an uncompressed bitmap, found coding {coding}, {bits} bits")
    if offset + (width * bits + 31) // 32 * 4 * abs(height) > len(data):
        raise ValueError("expected a complete file, found it truncated")
    return size


_TIFF_LIMIT = 2**20  # strips or tiles of one image
_TIFF_CODINGS = (1, 5, 8, 32773, 32946)  # none, LZW, deflate, PackBits, deflate before it had 8
_TIFF_PHOTOMETRIC = {1: "grey", 2: "RGB", 3: "palette", 6: "YCbCr"}


def _tiff(data: bytes, max_pixels: int) -> tuple[int, int]:
    """One directory of tags, whose strips or tiles lie inside the file."""
    order = "<" if data[:2] == b"II" else ">"
    (directory,) = struct.unpack_from(order + "I", data, 4)
    (entries,) = struct.unpack_from(order + "H", data, directory)
    tags = {}
    for k in range(entries):
        at = directory + 2 + 12 * k
        tag, kind, count = struct.unpack_from(order + "HHI", data, at)
        if tag in tags:  # readers differ in which of the two counts
            raise ValueError(f"expected each TIFF tag once, found {tag} again")
        tags[tag] = (kind, count, at + 8)
    (following,) = struct.unpack_from(order + "I", data, directory + 2 + 12 * entries)

    def values(tag: int, default: int | None = None) -> list[int]:
        if tag not in tags:
            if default is None:
                raise ValueError(f"expected the TIFF tag {tag}, found none")
            return [default]
        kind, count, at = tags[tag]
        letter = {1: "B", 3: "H", 4: "I"}.get(kind)
        if letter is None or not 1 <= count <= _TIFF_LIMIT:
            raise ValueError(f"expected integers in the TIFF tag {tag}, found type {kind}")
        if count * struct.calcsize(letter) > 4:
            (at,) = struct.unpack_from(order + "I", data, at)
        return list(struct.unpack_from(f"{order}{count}{letter}", data, at))

    (width, *_), (height, *_) = values(256), values(257)
    size = _checked(height, width, max_pixels)
    if following:
        raise ValueError("expected a single image, found a multi-page TIFF")
    photometric = values(262)[0]
    if photometric not in _TIFF_PHOTOMETRIC:
        kind_found = "CMYK" if photometric == 5 else f"photometric interpretation {photometric}"
        raise ValueError(f"expected a grey or colour image, found {kind_found}")
    if values(339, 1)[0] != 1:
        raise ValueError("expected unsigned integer pixels, found signed or floating point ones")
    bits, samples = values(258, 1)[0], values(277, 1)[0]
    if not 1 <= samples <= 4 or bits not in (1, 8, 16):
        raise ValueError(f"expected 8 or 16 bits a pixel, found {samples} samples of {bits} bits")
    if (coding := values(259, 1)[0]) not in _TIFF_CODINGS:
        raise ValueError(f"expected no compression, LZW, deflate or PackBits, found {coding}")
    if any(values(tag, 1)[0] != 1 for tag in (32997, 32998)):  # of a volume and of its tiles
        raise ValueError("expected a single image, found a TIFF of several planes")
    tiled = 324 in tags
    if tiled:  # a tile is decoded whole, however little of it is inside the image
        _checked(values(323)[0], values(322)[0], max_pixels)
    stored = 0
    for start, length in _pairs(values(324 if tiled else 273), values(325 if tiled else 279)):
        if start + length > len(data):
            raise ValueError("expected a complete file, found it truncated")
        stored += length
    if coding == 1 and stored * 8 < height * width * samples * bits:
        raise ValueError("expected a complete file, found fewer pixels than announced")
    return size


def _pairs(starts: list[int], lengths: list[int]) -> Iterator[tuple[int, int]]:
    if len(starts) != len(lengths):
        raise ValueError(f"expected {len(starts)} strip lengths, found {len(lengths)}")
    return zip(starts, lengths, strict=True)


_READERS = {"PNG": _png, "JPEG": _jpeg, "BMP": _bmp, "TIFF": _tiff}
