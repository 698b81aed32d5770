"""Readers of recorded frames: a folder of images as it is, an array, a video, or a camera.

docs/formats.md describes every kind. Images, videos and cameras need OpenCV and Pillow
(``pip install 'speckle-hdc[readers]'``); this module itself imports numpy only. Each error names
the file, what was expected and what was found. Nothing is ever unpickled.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from hdc.readers.files import BadFrame, SettingError, check_file, natural_key, require
from hdc.readers.recording import Recording, Window

__all__ = [
    "BadFrame",
    "Recording",
    "SettingError",
    "Window",
    "camera",
    "natural_key",
    "open_recording",
]

ARRAYS = (".npz", ".npy")
TABLE = ".csv"
VIDEO_SUFFIXES = (".mp4", ".m4v", ".mov", ".avi", ".mkv", ".webm")


def open_recording(
    path: str | Path,
    intervals: str | Path | None = None,
    crop: Sequence[int] | None = None,
    subsample: int = 1,
    memory_bytes: int = 2**28,
    *,
    axes: Sequence[str] | None = None,
    template: str | None = None,
    table: str | Path | None = None,
    image_column: str = "image",
    value_columns: Sequence[str] = (),
    window: Window | None = None,
    check: bool = True,
    fewest_classes: int = 2,
) -> Recording:
    """Open recorded frames with their labels, values and order.

    Args:
        path: a folder of images, an .npz or .npy, a .csv of vectors, or a video; ``~`` is the home
            folder.
        intervals: table of a video; default: beside the video, its suffix replaced by .csv.
        crop: (x, y, width, height) in pixels, x to the right and y down from the top left corner.
        subsample: every subsample-th pixel of the crop on both axes is kept (not averaged, which
            would lower the contrast of a speckle).
        memory_bytes: images are kept in memory up to this size, else decoded again when asked for.
        axes: of an .npy, such as ``("label", "order", "height", "width")``.
        template: path of an image inside the folder, such as ``{session}/{label}/*_{order}.png``.
        table: CSV with a row per image, in or relative to the folder, or of a video with a row per
            frame; its columns of numbers are values.
        image_column: column of the table that names the image.
        value_columns: columns, or arrays of an .npz, that are values; default: all numeric ones
            but order, session and group (none of a manifest.csv or of a .csv of vectors).
        window: crop and subsample in one.
        check: decode every image at once; otherwise each when it is asked for.
        fewest_classes: a recording of fewer is refused; with 0 it needs neither labels nor values.

    Raises:
        SettingError: a setting is out of range, or the path leads to no recording.
        BadFrame: a frame cannot be used.
        ValueError: a label, a table or a folder is not as described.
    """
    window = window or Window(crop, subsample)
    path = Path(path).expanduser()
    kind = _kind(path)
    _check_settings(path, kind, template, table, intervals, axes)
    if not path.exists():
        raise SettingError(
            f"path: expected a folder, an .npz or a video, found nothing: {path}"
        )
    # OpenCV is imported where images or videos are read, and not for an array.
    if kind == "a folder":
        from hdc.readers.images import open_listing
        from hdc.readers.listing import list_folder

        listing = list_folder(path, template, table, image_column, value_columns)
        return open_listing(path, listing, window, check, fewest_classes, memory_bytes)
    check_file(path)
    if kind in ("an .npy", "an .npz"):
        from hdc.readers.archive import open_array

        return open_array(path, window, axes, value_columns, fewest_classes)
    if kind == "a table":
        from hdc.readers.table import open_table

        return open_table(path, window, value_columns, fewest_classes)
    from hdc.readers.video import open_video, open_video_of_values

    if table is not None:
        rows = Path(table).expanduser()
        return open_video_of_values(path, rows, window, value_columns, fewest_classes)
    where = Path(intervals).expanduser() if intervals else path.with_suffix(".csv")
    return open_video(path, where, window, fewest_classes)


def _kind(path: Path) -> str:
    """What a path leads to, in words."""
    suffix = path.suffix.lower()
    if path.is_dir():
        return "a folder"
    if suffix in ARRAYS:
        return f"an {suffix}"
    if suffix == TABLE:
        return "a table"
    return "a video" if suffix in VIDEO_SUFFIXES else "another file"


def _check_settings(
    path: Path,
    kind: str,
    template: str | None,
    table: str | Path | None,
    intervals: str | Path | None,
    axes: Sequence[str] | None,
) -> None:
    """Raise a SettingError for a setting that the kind of recording does not have."""
    for name, setting, kinds in (
        ("template", template, ("a folder",)),
        ("table", table, ("a folder", "a video")),
        ("intervals", intervals, ("a video",)),
        ("axes", axes, ("an .npy",)),
    ):
        expected = f"null unless path is {' or '.join(kinds)} ({path})"
        require(setting is None or kind in kinds, name, setting, expected)
    if kind == "another file" and path.exists():
        suffixes = ", ".join((*ARRAYS, TABLE, *VIDEO_SUFFIXES))
        raise SettingError(
            f"path: expected a folder or a file ({suffixes}), found {path}"
        )


def camera(
    index: int = 0, crop: Sequence[int] | None = None, subsample: int = 1
) -> Iterator[np.ndarray]:
    """Grey frames [H, W], uint8 or uint16, of a camera until the iterator is closed.

    Args:
        index: number of the camera among those that the system has, as OpenCV counts.
        crop, subsample: see :func:`open_recording`; a model that learnt from a recording needs the
            same here.

    Raises:
        ValueError: there is no such camera, or a setting is out of range.
        BadFrame: the camera stops giving frames.
    """
    import cv2

    from hdc.readers.images import grey, quiet

    window = Window(crop, subsample)
    with quiet():
        capture = cv2.VideoCapture(index)
    try:
        if not capture.isOpened():
            wanted = f"a camera that can be opened at index {index}"
            raise ValueError(f"camera: expected {wanted}, found none")
        while True:
            ok, image = capture.read()
            if not ok:
                raise BadFrame(
                    f"camera {index}: expected a frame, found none (disconnected?)"
                )
            yield grey(window.of(image))
    finally:
        capture.release()
