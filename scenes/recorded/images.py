"""A folder of images: one sub-folder a class, or a manifest.csv (:mod:`scenes.recorded.listing`).

Images are PNG, JPEG, BMP or TIFF, of 8 or 16 bits; colour becomes luminance (ITU-R BT.601,
0.299 R + 0.587 G + 0.114 B) and an alpha channel is left out. Unless a manifest says otherwise, the
order of the files is taken for their order in time.

Every file is read, checked and decoded once when the folder is opened, so a broken one is found
before a model sees any.
"""

from __future__ import annotations

import hashlib
import os
from collections import Counter
from collections.abc import Callable, Generator, Iterable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing, contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TypeVar

import cv2
import numpy as np

from scenes.recorded.files import BadFrame, natural_key, read_bytes, shown
from scenes.recorded.header import image_size
from scenes.recorded.listing import list_folder
from scenes.recorded.scene import (
    Options,
    RecordedScene,
    check_number,
    class_indices,
    in_memory,
    with_progress,
)

T = TypeVar("T")

_DECODING_BYTES = 2**28
"""Held at a time by images that are being read, as their headers announce them."""
_BYTES_A_PIXEL = 10
"""Red, green, blue, alpha and luminance of 16 bits."""


@dataclass(frozen=True)
class _Image:
    """One decoded file: size before the window, grey pixels in it (None: it does not fit)."""

    size: tuple[int, int]
    dtype: np.dtype
    pixels: np.ndarray | None
    digest: bytes


def open_folder(root: Path, options: Options) -> RecordedScene:
    """Open a folder of images; see the module's description.

    Raises:
        BadFrame: a file is no usable image, or its size or depth is not that of most others.
        ValueError: the folder or its manifest is not as described.
    """
    listing = list_folder(root)
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
    classes, labels = class_indices(names, root, listing.classes)
    files = [listing.files[i] for i in good]
    usable = [image for image in images if isinstance(image, _Image)]
    digests = [image.digest for image in usable]
    images.clear()
    if keep:
        read = in_memory(_stack(usable, shape, dtype))
    else:
        read = _stream(files, digests, shape, dtype, options)
    relative = np.array([shown(file.relative_to(root).as_posix()) for file in listing.files])
    properties = {name: values[good] for name, values in listing.properties.items()}
    return RecordedScene(
        classes=classes,
        labels=labels,
        shape=shape,
        samples={"order": np.arange(len(good)), **properties, "file": relative[good]},
        read=read,
        digest=_digest(digests, np.delete(relative, good).tolist()),
        window=options.window,
        skipped=tuple(str(problem) for problem in problems),
    )


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

    def attempt(i: int) -> _Image | BadFrame:
        try:
            return _inspect(files[i], options)
        except BadFrame as error:
            return error

    with closing(_map(attempt, range(len(files)), files, options)) as inspected:
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


def _inspect(file: Path, options: Options) -> _Image:
    """Read, check, decode. The header is checked before OpenCV sees the bytes."""
    data = read_bytes(file, _most_bytes(options))
    try:
        size = image_size(data, file.suffix, options.max_pixels)
        decoded = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED)
    except (ValueError, cv2.error) as error:
        raise BadFrame(f"{shown(file)}: {error}") from error
    if decoded is None or decoded.shape[:2] != size:
        raise BadFrame(f"{shown(file)}: expected an intact image, found one that does not decode")
    if decoded.dtype not in (np.uint8, np.uint16):
        raise BadFrame(f"{shown(file)}: expected 8 or 16 bits a pixel, found {decoded.dtype}")
    try:
        pixels = grey(options.window.of(decoded))
    except ValueError:  # the crop: for the caller, who knows the size of the others
        pixels = None
    return _Image(size, decoded.dtype, pixels, hashlib.sha256(data).digest())


def _digest(digests: Sequence[bytes], left_out: Sequence[str]) -> str:
    """Of the contents of the files that are frames, and the names of those that were left out."""
    digest = hashlib.sha256(b"".join(digests))
    if left_out:
        digest.update(repr(left_out).encode())
    return digest.hexdigest()


def _without_pixels(image: _Image | BadFrame) -> _Image | BadFrame:
    return replace(image, pixels=None) if isinstance(image, _Image) else image


def _stream(
    files: Sequence[Path],
    digests: Sequence[bytes],
    shape: tuple[int, int],
    dtype: np.dtype,
    options: Options,
) -> Callable[[np.ndarray], np.ndarray]:
    """``read`` of frames that are decoded when asked for, if they are still the same."""

    def again(i: int) -> np.ndarray:
        image = _inspect(files[i], options)
        if image.digest != digests[i] or image.pixels is None:
            raise BadFrame(
                f"{shown(files[i])}: expected the file that was opened, found it changed"
            )
        return image.pixels

    def read(index: np.ndarray) -> np.ndarray:
        out = np.empty((len(index), *shape), dtype)
        with closing(_map(again, index.tolist(), files, options)) as decoded:
            for k, pixels in enumerate(decoded):
                out[k] = pixels
        return out

    return read


def _map(
    function: Callable[[int], T], indices: Sequence[int], files: Sequence[Path], options: Options
) -> Generator[T, None, None]:
    """map() over threads, which OpenCV decodes in parallel, of the indices of files.

    No more are decoded ahead of the caller than fit in memory: as many threads as there are cores,
    each with a small file that announces a large image, would fill it.
    """
    threads = options.threads or os.cpu_count() or 1
    ahead = 16 * threads
    with quiet_opencv(), ThreadPoolExecutor(threads) as executor:
        for start in range(0, len(indices), ahead):
            part = indices[start : start + ahead]
            for group in _groups(part, executor.map(lambda i: _cost(files[i], options), part)):
                yield from executor.map(function, group)


def _groups(items: Sequence[int], costs: Iterable[int]) -> Iterator[list[int]]:
    """The items in their order, together as long as they cost at most _DECODING_BYTES."""
    group: list[int] = []
    total = 0
    for item, cost in zip(items, costs, strict=True):
        if group and total + cost > _DECODING_BYTES:
            yield group
            group, total = [], 0
        group.append(item)
        total += cost
    yield group


def _cost(file: Path, options: Options) -> int:
    """Bytes that reading and decoding a file takes; none if it will be refused."""
    try:
        data = read_bytes(file, _most_bytes(options))
        height, width = image_size(data, file.suffix, options.max_pixels)
    except ValueError:
        return 0
    return len(data) + _BYTES_A_PIXEL * height * width


def _most_bytes(options: Options) -> int:
    return 8 * options.max_pixels + 2**20
