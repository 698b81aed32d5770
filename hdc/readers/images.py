"""Images: decoded by OpenCV to grey frames, after Pillow has looked at their header.

PNG, JPEG, BMP or TIFF of 8 or 16 bits, which are kept. Colour becomes luminance (ITU-R BT.601,
0.299 R + 0.587 G + 0.114 B, as OpenCV and Pillow have it) and an alpha channel is left out. Pixels
are as they are stored: no orientation tag is applied. A TIFF with another orientation or with
alpha is refused, because OpenCV would turn it or multiply by alpha.
"""

from __future__ import annotations

import hashlib
import io
import warnings
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import Any, TypeVar

import cv2
import numpy as np
from PIL import Image

from hdc.readers.files import BadFrame, SettingError, file_size, natural_key, shown, usable_cores
from hdc.readers.listing import Listing
from hdc.readers.recording import Recording, Window, class_indices, with_progress

S = TypeVar("S")
T = TypeVar("T")

FORMATS = ("PNG", "JPEG", "BMP", "TIFF")
MODES = {
    "PNG": ("1", "L", "LA", "P", "RGB", "RGBA", "I;16", "I"),
    "JPEG": ("L", "RGB"),
    "MPO": ("L", "RGB"),  # a JPEG with a preview beside it
    "BMP": ("1", "L", "P", "RGB"),
    "TIFF": ("1", "L", "P", "RGB", "I;16", "I;16B"),
}
_TOGETHER = 4
"""Files that a thread reads one after the other: to hand over each costs time, too."""
MOST_THREADS = 16


def decode(file: Path, max_pixels: int = 2**24) -> tuple[bytes, np.ndarray]:
    """Bytes of a file and its image [H, W] or [H, W, channels], uint8 or uint16 (blue first).

    Raises:
        BadFrame: it is no single, whole image of a kind that is read here; the file is named.
    """
    file_size(file)  # raises: to open a pipe would wait for ever
    try:
        data = file.read_bytes()
        with Image.open(io.BytesIO(data), formats=FORMATS) as header:
            _check_header(header, data, max_pixels)
            image = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED)
            if image is None or image.shape[1::-1] != header.size:
                raise ValueError("expected a whole image, found one that is damaged or truncated")
            if image.dtype not in (np.uint8, np.uint16):
                raise ValueError(f"expected 8 or 16 bits a pixel, found {image.dtype}")
            if header.format == "TIFF":
                _check_alike(image, header)
    except Exception as error:  # broken bytes make Pillow raise a dozen different types
        text = str(error)
        if isinstance(error, OSError) or not text.startswith("expected"):
            found = getattr(error, "strerror", None) or text or type(error).__name__
            text = f"expected a whole image ({', '.join(FORMATS)}), found: {found}"
            if "cannot identify" in found:
                text = f"expected an image ({', '.join(FORMATS)}), found other data"
        raise BadFrame(f"{shown(file)}: {shown(text)}") from error
    return data, image


def _check_header(header: Any, data: bytes, max_pixels: int) -> None:
    width, height = header.size
    if height * width > max_pixels:
        raise ValueError(
            f"expected at most {max_pixels} pixels (max_pixels), found {width} × {height}"
        )
    if header.format != "MPO" and (n := getattr(header, "n_frames", 1)) > 1:
        raise ValueError(f"expected a single image, found {n}")
    if header.mode not in MODES[header.format]:
        raise ValueError(f"expected a grey or colour {header.format}, found {header.mode}")
    if header.format == "TIFF" and (turned := header.tag_v2.get(274, 1)) != 1:
        raise ValueError(f"expected pixels as they are seen, found a TIFF of orientation {turned}")
    # A file that was never finished ends in zeros; decoders make up what is missing.
    if header.format == "JPEG" and data.endswith(b"\0") and data.rstrip(b"\0")[-2:] != b"\xff\xd9":
        raise ValueError("expected a whole image, found one that ends in zeros")


def _check_alike(image: np.ndarray, header: Any) -> None:
    """Compare a TIFF with what Pillow decodes: OpenCV leaves damaged strips as they come."""
    plain = header.convert({"1": "L", "P": "RGB"}.get(header.mode, header.mode))
    other = np.asarray(plain).astype(np.uint16 if plain.mode.startswith("I") else np.uint8)
    if other.ndim == 3:
        other = other[..., ::-1]
    shift = 8 * (image.dtype.itemsize - other.dtype.itemsize)  # Pillow has 8 bits of colour
    if not np.array_equal(grey(image >> max(shift, 0)), grey(other)):
        raise ValueError("expected a plain TIFF, found one that OpenCV and Pillow read differently")


def grey(image: np.ndarray) -> np.ndarray:
    """Luminance [H, W] of a decoded image [H, W] or [H, W, 1, 3 or 4] (blue first)."""
    channels = 1 if image.ndim == 2 else image.shape[2]
    if channels == 1:
        return np.ascontiguousarray(image.reshape(image.shape[:2]))
    code = cv2.COLOR_BGR2GRAY if channels == 3 else cv2.COLOR_BGRA2GRAY
    return cv2.cvtColor(np.ascontiguousarray(image), code)


def ahead(
    function: Callable[[S], T], items: Sequence[S], threads: int | None = None
) -> Iterator[T]:
    """map() over threads, some items ahead of the caller."""
    threads = threads or min(usable_cores(), MOST_THREADS)
    groups = [items[i : i + _TOGETHER] for i in range(0, len(items), _TOGETHER)]
    waiting: deque[Future[list[T]]] = deque()
    with warnings.catch_warnings(), quiet_opencv(), ThreadPoolExecutor(threads) as executor:
        warnings.filterwarnings("ignore", module="PIL")  # of tags that no pixel depends on
        try:
            for group in groups:
                waiting.append(executor.submit(lambda some: list(map(function, some)), group))
                if len(waiting) > 2 * threads:
                    yield from waiting.popleft().result()
            while waiting:
                yield from waiting.popleft().result()
        finally:
            executor.shutdown(cancel_futures=True)


@contextmanager
def quiet_opencv() -> Iterator[None]:
    """OpenCV logs what it cannot decode; here that is reported as an error, once."""
    level = cv2.utils.logging.getLogLevel()
    cv2.utils.logging.setLogLevel(cv2.utils.logging.LOG_LEVEL_SILENT)
    try:
        yield
    finally:
        cv2.utils.logging.setLogLevel(level)


def stream_files(
    files: Sequence[Path], window: Window, max_pixels: int = 2**24
) -> Iterator[np.ndarray]:
    """Grey frames [H, W] of image files, one after the other, whatever their sizes.

    Raises:
        BadFrame: a file is no usable image, or the crop does not lie inside it.
    """
    return ahead(lambda file: _frame(file, decode(file, max_pixels)[1], window), files)


def _frame(file: Path, image: np.ndarray, window: Window) -> np.ndarray:
    try:
        return grey(window.of(image))
    except SettingError as error:
        raise BadFrame(f"{shown(file)}: {error}") from error


def open_listing(
    root: Path,
    listing: Listing,
    window: Window,
    skip: bool,
    check: bool,
    fewest_classes: int,
    threads: int | None,
    memory_bytes: int,
    max_pixels: int,
) -> Recording:
    """Open the images of a folder; with ``check`` every one is decoded at once.

    Raises:
        BadFrame: a file is no usable image, or its size or depth is not that of the first.
        ValueError: a class is left without a frame.
    """
    files, first, digests = listing.files, list[tuple[Any, ...]](), dict[Path, bytes]()

    def load(file: Path) -> np.ndarray:
        data, image = decode(file, max_pixels)
        kind = (image.shape[:2], image.dtype)
        first[:] = first or [kind]
        if kind != first[0]:
            ((height, width), dtype), ((h, w), other) = first[0], kind
            raise BadFrame(
                f"{shown(file)}: expected {width} × {height} pixels {dtype} as in the other "
                f"frames, found {w} × {h} {other}"
            )
        if check and digests.setdefault(file, digest := hashlib.sha256(data).digest()) != digest:
            raise BadFrame(f"{shown(file)}: expected the file that was opened, found it changed")
        return _frame(file, image, window)

    def attempt(file: Path) -> np.ndarray | BadFrame:
        try:
            return load(file)
        except BadFrame as error:
            if not skip:
                raise
            return error

    good, problems, kept = list(range(len(files))), [], list[np.ndarray]()
    if check:
        good, in_memory = [], True
        frames = _decoded(attempt, files, first, threads)
        for i, frame in enumerate(with_progress(frames, len(files), "Reading images")):
            if isinstance(frame, BadFrame):
                problems.append(str(frame))
                continue
            good.append(i)
            in_memory = in_memory and (len(kept) + 1) * frame.nbytes <= memory_bytes
            if in_memory:
                kept.append(frame)
            else:
                kept.clear()
        if not good:
            raise BadFrame(problems[0])
    relative = np.array([shown(_relative(file, root)) for file in files])
    left_out = np.delete(relative, good).tolist()
    usable = [files[i] for i in good]
    classes: tuple[str, ...] = ()
    labels = None
    if listing.labels is not None:
        names = [listing.labels[i] for i in good]
        if lost := sorted(set(listing.labels) - set(names), key=natural_key):
            raise ValueError(f"{shown(root)}: class {lost[0]!r}: none of its frames can be used")
        classes, labels = class_indices(names, root, fewest_classes, listing.classes)
    stack = np.stack(kept) if kept else None

    def digest() -> str:
        hashes = (digests.get(f) or hashlib.sha256(f.read_bytes()).digest() for f in usable)
        whole = hashlib.sha256(b"".join(hashes))
        whole.update(repr(left_out).encode() if left_out else b"")
        return whole.hexdigest()

    def each(index: np.ndarray) -> Iterator[np.ndarray]:
        if stack is not None:
            return iter(stack[index])
        return _decoded(load, [usable[i] for i in index], first, threads)

    return Recording(
        classes=classes,
        labels=labels,
        samples={
            "order": np.arange(len(good)),
            **{name: values[good] for name, values in listing.samples.items()},
            "file": relative[good],
        },
        each=each,
        place=lambda i: shown(usable[i]),
        digest=cache(digest),
        window=window,
        values=None if listing.values is None else listing.values[good],
        value_names=listing.value_names,
        skipped=tuple(problems),
        other_files=tuple(map(shown, listing.other_files)),
        size=window.shape(*first[0][0]) if first else None,
    )


def _decoded(
    load: Callable[[Path], T], files: Sequence[Path], first: list[Any], threads: int | None
) -> Iterator[T]:
    """Frames of files, ahead of the caller; the first one says what the others must be like."""
    start = 0
    while not first and start < len(files):
        yield load(files[start])
        start += 1
    yield from ahead(load, files[start:], threads)


def _relative(file: Path, root: Path) -> str:
    return file.relative_to(root).as_posix() if file.is_relative_to(root) else str(file)
