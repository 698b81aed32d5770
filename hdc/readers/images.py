"""A folder of images: one sub-folder a class, or a manifest.csv (:mod:`hdc.readers.listing`).

Images are PNG, JPEG, BMP or TIFF, of 8 or 16 bits; colour becomes luminance (ITU-R BT.601,
0.299 R + 0.587 G + 0.114 B) and an alpha channel is left out (a TIFF with one is refused: OpenCV
would multiply by it). Pixels are as they were stored: no orientation that a tag states is applied,
and a TIFF of another one is refused. Unless a manifest says otherwise, the order of the files is
taken for their order in time.

:func:`open_folder` reads, checks and decodes every file once, so a broken one is found before a
model sees any; :func:`stream_folder` does so as the frames are asked for. Threads decode ahead of
whoever asks.
"""

from __future__ import annotations

import hashlib
import math
import os
import warnings
from collections import Counter, deque
from collections.abc import Callable, Generator, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import closing, contextmanager
from dataclasses import dataclass, replace
from functools import cache, partial
from pathlib import Path
from typing import TypeVar

import cv2
import numpy as np

from hdc.readers.files import BadFrame, natural_key, open_file, shown, usable_cores
from hdc.readers.header import read_header
from hdc.readers.listing import list_folder
from hdc.readers.recording import (
    Recording,
    Stream,
    check_number,
    class_indices,
    in_memory,
    stacked,
    with_progress,
)
from hdc.readers.settings import Options, SettingError

S = TypeVar("S")
T = TypeVar("T")

_DECODING_BYTES = 2**28
"""Held at a time by images that are being read, as their headers announce them."""
_TOGETHER = 4
"""Files that a thread reads one after the other, if each is read only once."""
_BYTES_A_PIXEL = 10
"""Red, green, blue, alpha and luminance of 16 bits."""


@dataclass(frozen=True)
class _Image:
    """One decoded file: size before the window, grey pixels in it (None: it does not fit)."""

    size: tuple[int, int]
    dtype: np.dtype
    pixels: np.ndarray | None
    digest: bytes


def open_folder(root: Path, options: Options) -> Recording:
    """Open a folder of images; see the module's description.

    Raises:
        BadFrame: a file is no usable image, or its size or depth is not that of most others.
        ValueError: the folder or its manifest is not as described.
    """
    listing = list_folder(root, options.fewest_classes)
    check_number(root, len(listing.files))
    images, keep = _read_all(listing.files, options)
    size, dtype = _mark_odd_ones(root, listing.files, images)
    shape = options.window.shape(*size)
    problems = tuple(image for image in images if isinstance(image, BadFrame))
    if problems and not options.skip:
        raise problems[0]

    good = [i for i, image in enumerate(images) if isinstance(image, _Image)]
    names = [listing.labels[i] for i in good]
    if lost := sorted(set(listing.labels) - set(names), key=natural_key):
        raise ValueError(f"{shown(root)}: class {lost[0]!r}: none of its frames can be used")
    classes, labels = class_indices(names, root, options, listing.classes)
    files = [listing.files[i] for i in good]
    usable = [image for image in images if isinstance(image, _Image)]
    digests = [image.digest for image in usable]
    images.clear()
    if keep:
        read, each = in_memory(_stack(usable, shape, dtype)), None
    else:
        each = _stream(files, digests, size, options)
        read = stacked(each, shape, dtype)
    relative = np.array([shown(file.relative_to(root).as_posix()) for file in listing.files])
    properties = {name: values[good] for name, values in listing.properties.items()}
    return Recording(
        classes=classes,
        labels=labels,
        shape=shape,
        samples={"order": np.arange(len(good)), **properties, "file": relative[good]},
        read=read,
        each=each,
        digest=cache(lambda: _digest(digests, np.delete(relative, good).tolist())),
        window=options.window,
        skipped=tuple(str(problem) for problem in problems),
    )


def stream_folder(root: Path, options: Options) -> Stream:
    """A folder whose images are read once each, when they are asked for.

    Raises:
        ValueError: the folder or its manifest is not as described.
    """
    listing = list_folder(root, options.fewest_classes)
    check_number(root, len(listing.files))
    class_indices(listing.labels, root, options, listing.classes)
    first: list[tuple[Path, _Image]] = []

    def each(index: np.ndarray) -> Iterator[np.ndarray]:
        files = [listing.files[i] for i in index]
        for file, image in zip(files, _once(files, options), strict=True):
            if not first:
                first.append((file, image))
            _check_like(file, image, *first[0])
            yield _pixels(file, image, options)

    return Stream(listing.labels, lambda i: shown(listing.files[i]), each)


def stream_files(files: Sequence[Path], options: Options) -> Iterator[np.ndarray]:
    """Frames [H, W] of image files, one after the other, whatever their sizes.

    Raises:
        BadFrame: a file is no usable image, or the crop does not lie inside it.
    """
    for file, image in zip(files, _once(files, options), strict=True):
        yield _pixels(file, image, options)


def _once(files: Sequence[Path], options: Options) -> Iterator[_Image]:
    """The images of files, some of which a thread reads at a time: to ask it costs time, too."""
    groups = [files[i : i + _TOGETHER] for i in range(0, len(files), _TOGETHER)]

    def inspect(group: Sequence[Path]) -> list[_Image]:
        return [_inspect(file, options, hashed=False) for file in group]

    def cost(group: Sequence[Path]) -> int:
        return sum(_cost(file, options) for file in group)

    for images in _ahead(inspect, groups, cost, options):
        yield from images


def _check_like(file: Path, image: _Image, other: Path, like: _Image) -> None:
    if (image.size, image.dtype) != (like.size, like.dtype):
        (height, width), (h, w) = like.size, image.size
        raise BadFrame(
            f"{shown(file)}: expected {width} × {height} pixels {like.dtype} as of {shown(other)}, "
            f"found {w} × {h} {image.dtype}"
        )


def _pixels(file: Path, image: _Image, options: Options) -> np.ndarray:
    if image.pixels is None:
        with _named(file):
            options.window.shape(*image.size)  # raises
    assert image.pixels is not None
    return image.pixels


def grey(image: np.ndarray) -> np.ndarray:
    """Luminance [H, W] of a decoded image [H, W] or [H, W, 1, 3 or 4] (OpenCV: blue first)."""
    channels = 1 if image.ndim == 2 else image.shape[2]
    if channels == 1:
        return np.ascontiguousarray(image.reshape(image.shape[:2]))
    code = cv2.COLOR_BGR2GRAY if channels == 3 else cv2.COLOR_BGRA2GRAY
    return cv2.cvtColor(np.ascontiguousarray(image), code)


@contextmanager
def quiet_opencv() -> Iterator[None]:
    """OpenCV logs what it cannot decode; here that is reported as an error, once."""
    level = cv2.utils.logging.getLogLevel()
    cv2.utils.logging.setLogLevel(cv2.utils.logging.LOG_LEVEL_SILENT)
    try:
        yield
    finally:
        cv2.utils.logging.setLogLevel(level)


def _read_all(files: Sequence[Path], options: Options) -> tuple[list[_Image | BadFrame], bool]:
    """Each file's image or what is wrong with it, and whether the pixels were kept: all or none."""
    images: list[_Image | BadFrame] = []
    kept_bytes, keep = 0, True

    def attempt(file: Path) -> _Image | BadFrame:
        try:
            return _inspect(file, options)
        except BadFrame as error:
            return error

    costs = partial(_cost, options=options)
    with closing(_ahead(attempt, files, costs, options)) as inspected:
        for image in with_progress(inspected, len(files), "Reading images"):
            if isinstance(image, BadFrame):
                if not options.skip:
                    raise image
            elif image.pixels is not None:
                kept_bytes += image.pixels.nbytes
            if keep and kept_bytes > options.memory_bytes:
                keep = False
                images = [_without_pixels(image) for image in images]
            images.append(image if keep else _without_pixels(image))
    return images, keep


def _mark_odd_ones(
    root: Path, files: Sequence[Path], images: list[_Image | BadFrame]
) -> tuple[tuple[int, int], np.dtype]:
    """Size and depth of most images (of equally many, the first); the others become BadFrames."""
    kinds = Counter((image.size, image.dtype) for image in images if isinstance(image, _Image))
    if not kinds:
        raise BadFrame(f"{shown(root)}: expected images, found none that can be read")
    (size, dtype), most = kinds.most_common(1)[0]
    for i, image in enumerate(images):
        if isinstance(image, _Image) and (image.size, image.dtype) != (size, dtype):
            images[i] = BadFrame(
                f"{shown(files[i])}: expected {size[1]} × {size[0]} pixels {dtype} as in {most} of "
                f"{len(files)} frames, found {image.size[1]} × {image.size[0]} {image.dtype}"
            )
    return size, dtype


def _stack(images: list[_Image], shape: tuple[int, int], dtype: np.dtype) -> np.ndarray:
    """Frames [N, H, W]; each image is released as it is copied, so they are not held twice."""
    frames = np.empty((len(images), *shape), dtype)
    for k, image in enumerate(images):
        frames[k] = image.pixels
        images[k] = replace(image, pixels=None)
    return frames


def _inspect(file: Path, options: Options, hashed: bool = True) -> _Image:
    """One file; with a digest of its bytes where it may be read again."""
    data, decoded = _read(file, options)
    try:
        pixels = grey(options.window.of(decoded))
    except SettingError:  # the crop: for the caller, who knows the size of the others
        pixels = None
    digest = hashlib.sha256(data).digest() if hashed else b""
    return _Image(decoded.shape[:2], decoded.dtype, pixels, digest)


def _read(file: Path, options: Options) -> tuple[bytes, np.ndarray]:
    """A file's bytes and its image, decoded; the header is checked before OpenCV sees the bytes."""
    with _named(file), open_file(file, _most_bytes(options)) as opened:
        header = read_header(opened, file.suffix, options.max_pixels)
        opened.seek(0)
        data = opened.read()
        header.check_whole(data)
        return data, _decode(data, header.size)


def _decode(data: bytes, size: tuple[int, int]) -> np.ndarray:
    decoded = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED)
    if decoded is None or decoded.shape[:2] != size:
        raise ValueError("expected an intact image, found one that does not decode")
    if decoded.dtype not in (np.uint8, np.uint16):
        raise ValueError(f"expected 8 or 16 bits a pixel, found {decoded.dtype}")
    return decoded


@contextmanager
def _named(file: Path) -> Iterator[None]:
    """Names the file in an error."""
    try:
        yield
    except BadFrame:
        raise
    except (OSError, ValueError, cv2.error) as error:
        raise BadFrame(f"{shown(file)}: {error}") from error


def _digest(digests: Sequence[bytes], left_out: Sequence[str]) -> str:
    """Of the contents of the files that are frames, and the names of those that were left out."""
    digest = hashlib.sha256(b"".join(digests))
    if left_out:
        digest.update(repr(left_out).encode())
    return digest.hexdigest()


def _without_pixels(image: _Image | BadFrame) -> _Image | BadFrame:
    return replace(image, pixels=None) if isinstance(image, _Image) else image


def _stream(
    files: Sequence[Path], digests: Sequence[bytes], size: tuple[int, int], options: Options
) -> Callable[[np.ndarray], Iterator[np.ndarray]]:
    """Frames [H, W] of given indices [n], decoded when asked for, if they are still the same."""
    pixels = math.prod(size)

    def again(i: int) -> np.ndarray:
        with _named(files[i]):
            with open_file(files[i], _most_bytes(options)) as opened:
                data = opened.read()
            if hashlib.sha256(data).digest() != digests[i]:
                raise ValueError("expected the file that was opened, found it changed")
            return grey(options.window.of(_decode(data, size)))

    return lambda index: _ahead(again, index.tolist(), lambda i: _BYTES_A_PIXEL * pixels, options)


def _cost(file: Path, options: Options) -> int:
    """Bytes that reading and decoding a file takes; none if it will be refused."""
    try:
        with _named(file), open_file(file, _most_bytes(options)) as opened:
            height, width = read_header(opened, file.suffix, options.max_pixels).size
            return opened.seek(0, os.SEEK_END) + _BYTES_A_PIXEL * height * width
    except BadFrame:
        return 0


def _ahead(
    function: Callable[[S], T], items: Sequence[S], cost: Callable[[S], int], options: Options
) -> Generator[T, None, None]:
    """map() over threads, which OpenCV decodes in parallel, ahead of the caller.

    No more is decoded ahead than fits in memory, by the ``cost`` of each item in bytes: as many
    threads as there are cores, each with a small file that announces a large image, would fill it.
    """
    threads = options.threads or usable_cores()
    waiting: deque[tuple[Future[T], int]] = deque()
    held = 0
    with warnings.catch_warnings(), quiet_opencv(), ThreadPoolExecutor(threads) as executor:
        warnings.filterwarnings("ignore", module="PIL")  # of tags that no pixel depends on
        try:
            for item, bytes_ in zip(items, _costs(executor, items, cost, threads), strict=True):
                while waiting and (len(waiting) > 4 * threads or held + bytes_ > _DECODING_BYTES):
                    future, freed = waiting.popleft()
                    yield future.result()
                    held -= freed
                waiting.append((executor.submit(function, item), bytes_))
                held += bytes_
            while waiting:
                yield waiting.popleft()[0].result()
        finally:
            executor.shutdown(cancel_futures=True)


def _costs(
    executor: ThreadPoolExecutor, items: Sequence[S], cost: Callable[[S], int], threads: int
) -> Iterator[int]:
    """The costs of all items, found by the threads some ahead of where they are needed."""
    waiting: deque[Future[int]] = deque()
    for item in items:
        waiting.append(executor.submit(cost, item))
        if len(waiting) > 2 * threads:
            yield waiting.popleft().result()
    while waiting:
        yield waiting.popleft().result()


def _most_bytes(options: Options) -> int:
    return 8 * options.max_pixels + 2**20
