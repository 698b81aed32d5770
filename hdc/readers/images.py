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
from collections import Counter, deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import closing, contextmanager
from functools import cache
from itertools import chain
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
        BadFrame: a file is no usable image, or its size or depth is not that of the others.
        ValueError: a class is left without a frame.
    """
    files, expected = listing.files, Counter[tuple[Any, ...]]()
    digests: list[bytes] = []

    def load(i: int) -> np.ndarray:
        data, image = decode(files[i], max_pixels)
        kind = (image.shape[:2], image.dtype)
        if not expected:
            expected[kind] += 1
        if (like := expected.most_common(1)[0][0]) != kind:
            raise _odd(files[i], kind, like)
        if digests and hashlib.sha256(data).digest() != digests[i]:
            raise BadFrame(
                f"{shown(files[i])}: expected the file that was opened, found it changed"
            )
        return _frame(files[i], image, window)

    good, problems, read = list(range(len(files))), (), None
    if check:
        images, found = _inspect(files, window, skip, threads, memory_bytes, max_pixels)
        expected.update(kind for kind, _ in found.values())
        like = expected.most_common(1)[0][0] if expected else None
        for i, (kind, _) in found.items():
            if kind != like:
                images[i] = _odd(files[i], kind, like)
        problems = tuple(str(image) for image in images if isinstance(image, BadFrame))
        if problems and not (skip and like):
            raise next(image for image in images if isinstance(image, BadFrame))
        good = [i for i, image in enumerate(images) if not isinstance(image, BadFrame)]
        window.shape(*like[0])  # raises
        if good and images[good[0]] is not None:
            kept = np.stack([images[i] for i in good])
            read = lambda index: np.ascontiguousarray(kept[index])  # noqa: E731
        files = [files[i] for i in good]
        digests += [found[i][1] for i in good]
    relative = np.array([shown(_relative(file, root)) for file in listing.files])
    classes: tuple[str, ...] = ()
    labels = None
    if listing.labels is not None:
        names = [listing.labels[i] for i in good]
        if lost := sorted(set(listing.labels) - set(names), key=natural_key):
            raise ValueError(f"{shown(root)}: class {lost[0]!r}: none of its frames can be used")
        classes, labels = class_indices(names, root, fewest_classes, listing.classes)
    samples = {name: values[good] for name, values in listing.samples.items()}
    left_out = np.delete(relative, good).tolist()

    def digest() -> str:
        hashes = digests or [hashlib.sha256(file.read_bytes()).digest() for file in files]
        whole = hashlib.sha256(b"".join(hashes))
        whole.update(repr(left_out).encode() if left_out else b"")
        return whole.hexdigest()

    def each(index: np.ndarray) -> Iterator[np.ndarray]:
        if read:
            return iter(read(index))
        order = index.tolist()
        # The first says what the others must be like.
        first = [load(i) for i in order[:1]] if not expected else []
        return chain(first, ahead(load, order[len(first) :], threads))

    return Recording(
        classes=classes,
        labels=labels,
        samples={"order": np.arange(len(good)), **samples, "file": relative[good]},
        each=each,
        place=lambda i: shown(files[i]),
        digest=cache(digest),
        window=window,
        values=None if listing.values is None else listing.values[good],
        value_names=listing.value_names,
        skipped=problems,
        others=tuple(map(shown, listing.others)),
        size=window.shape(*expected.most_common(1)[0][0][0]) if check else None,
        read=read,
    )


def _inspect(
    files: list[Path],
    window: Window,
    skip: bool,
    threads: int | None,
    memory_bytes: int,
    max_pixels: int,
) -> tuple[list[Any], dict[int, tuple[Any, bytes]]]:
    """Decode every file once.

    Returns:
        Of each file its frame (None: there are too many for the memory) or the BadFrame; size,
        depth and digest of those that were decoded.
    """

    def inspect(i: int) -> Any:
        try:
            data, image = decode(files[i], max_pixels)
        except BadFrame as error:
            return i, error, None
        try:
            frame = grey(window.of(image))
        except SettingError:  # the crop: for the caller, who knows the size of the others
            frame = None
        return i, frame, ((image.shape[:2], image.dtype), hashlib.sha256(data).digest())

    images: list[Any] = []
    found: dict[int, tuple[Any, bytes]] = {}
    kept = 0
    with closing(ahead(inspect, range(len(files)), threads)) as inspected:
        for i, frame, kind in with_progress(inspected, len(files), "Reading images"):
            if kind is None and not skip:
                raise frame
            if kind is not None:
                found[i] = kind
                kept += 0 if frame is None else frame.nbytes
                if kept > memory_bytes:
                    images = [x if isinstance(x, BadFrame) else None for x in images]
                    frame = None
            images.append(frame)
    return images, found


def _odd(file: Path, kind: Any, like: Any) -> BadFrame:
    ((h, w), dtype), ((height, width), expected) = kind, like
    return BadFrame(
        f"{shown(file)}: expected {width} × {height} pixels {expected} as in the other frames, "
        f"found {w} × {h} {dtype}"
    )


def _relative(file: Path, root: Path) -> str:
    return file.relative_to(root).as_posix() if file.is_relative_to(root) else str(file)
