"""Readers of recorded frames: folders of images, arrays, videos, tables, or a camera.

docs/api.md describes every kind. Images and cameras need OpenCV
(``pip install 'speckle-hdc[readers]'``); compressed TIFF, videos, HDF5 and MATLAB's files need the
libraries of the extra ``files``. Each is imported when such a file comes; this module imports numpy
only. Each error names the file, what was expected and what was found. Nothing is ever unpickled.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from importlib import import_module
from pathlib import Path

import numpy as np

from hdc.readers.about import natural_key
from hdc.readers.files import (
    Ambiguous,
    BadFrame,
    SettingError,
    check_file,
    missing,
    wrong,
)
from hdc.readers.recording import Asked, Recording, Window

__all__ = [
    "Ambiguous",
    "BadFrame",
    "Recording",
    "SettingError",
    "Window",
    "camera",
    "natural_key",
    "open_recording",
]

FOLDER, ARRAY = "a folder", "a file of arrays"
ARRAYS, VECTORS, VIDEO = "a file of several arrays", "a table", "a video"
SUFFIXES = {
    **dict.fromkeys((".npz", ".npy", ".mat", ".h5", ".hdf5", ".tif", ".tiff"), ARRAY),
    ".csv": VECTORS,
    **dict.fromkeys((".mp4", ".m4v", ".mov", ".avi", ".mkv", ".webm"), VIDEO),
}
"""The kind of recording that a file is, by its suffix."""
_READERS = {
    FOLDER: "listing",
    ARRAY: "arrays",
    ARRAYS: "gathered",
    VECTORS: "vectors",
    VIDEO: "video",
}
"""The module that opens each kind."""
_SETTINGS = {
    "template": (FOLDER, ARRAYS),
    "table": (FOLDER, ARRAY, VIDEO),
    "axes": (ARRAY, ARRAYS, FOLDER),
}
"""Settings that only some kinds of recordings have."""


def open_recording(
    path: str | Path,
    crop: Sequence[int] | None = None,
    subsample: int = 1,
    memory_bytes: int = 2**28,
    *,
    axes: Sequence[str] | None = None,
    labels: str | None = None,
    template: str | None = None,
    table: str | Path | None = None,
    image_column: str = "image",
    value_columns: Sequence[str] = (),
    sessions: str | None = None,
    groups: str | None = None,
    window: Window | None = None,
    check: bool = True,
    fewest_classes: int = 2,
) -> Recording:
    """Open recorded frames with their labels, values and order.

    Args:
        path: a folder of images, or of files of arrays or videos; an .npz, .npy, .mat, .h5 or TIFF,
            of which ``FILE:/NAME`` is one array; a .csv of vectors; or a video. ``~`` is the home
            folder.
        crop: (x, y, width, height) in pixels, x to the right and y down from the top left corner.
        subsample: every subsample-th pixel of the crop on both axes is kept (not averaged, which
            would lower the contrast of a speckle).
        memory_bytes: with ``check``, images and frames of a video are kept in memory if all fit in
            this size, else decoded again when asked for.
        axes: of an array, such as ``("height", "width", "frame")``.
        labels: name of the array, or the column, of labels.
        template: path of an image inside the folder, such as ``{session}/{label}/*_{order}.png``;
            or of a file of arrays or a video, such as ``{session}/{label}_{group}.avi``; or of an
            array in a file that has one per trial, such as ``{label}_{group}/frames``.
        table: CSV with a row per image, in or relative to the folder, or with a row per frame of an
            array or a video; its columns of numbers are values. A video may have a row per interval
            instead. Default for both: beside the file, its suffix replaced by .csv; numbers beside
            an array are not learnt.
        image_column: column of the table that has the images.
        value_columns: columns, or arrays of a file, that are values; default: all numeric ones
            but order, session, group, frame and time (none of a manifest.csv or of a .csv of
            vectors).
        sessions, groups: the column, or the array [N], that has the session or the group of each
            frame; default: ``session`` and ``group``.
        window: crop and subsample in one.
        check: decode every image, and every frame of a video, at once; otherwise when asked for.
        fewest_classes: a recording of fewer is refused; with 0 it needs neither labels nor values.

    Raises:
        Ambiguous: it has two readings; both are named.
        SettingError: a setting is out of range, or the path leads to no recording.
        BadFrame: a frame cannot be used.
        ValueError: a label, a table or a folder is not as described.
        ModuleNotFoundError: a library of the extra ``files`` is missing.
    """
    path, dataset = split_name(Path(path).expanduser())
    asked = Asked(
        window or Window(crop, subsample),
        labels=labels,
        table=None if table is None else Path(table).expanduser(),
        values=value_columns,
        sessions=sessions,
        groups=groups,
        fewest_classes=fewest_classes,
        axes=axes,
        dataset=dataset,
        template=template,
        image_column=image_column,
    )
    reader = f"hdc.readers.{_READERS[_checked_kind(path, asked)]}"
    try:  # libraries are imported where their files are read
        opened: Recording = import_module(reader).open_frames(path, asked)
    except ModuleNotFoundError as error:
        raise missing(error) from error
    return opened.kept(memory_bytes) if check and opened.is_decoded else opened


def _checked_kind(path: Path, asked: Asked) -> str:
    """The kind of recording at a path; a SettingError for a setting that this does not have."""
    if not path.exists():
        raise SettingError(
            f"path: expected a folder or a file of frames, found nothing: {path}"
        )
    kind = kind_of(path)
    if not kind:
        raise SettingError(
            f"path: expected a folder or a file ({', '.join(SUFFIXES)}), found {path}"
        )
    if kind != FOLDER:
        check_file(path)
    if kind == ARRAY and asked.template is not None:
        kind = ARRAYS
    for name, kinds in _SETTINGS.items():
        setting = getattr(asked, name)
        if setting and kind not in kinds:
            raise wrong(
                name, setting, f"null unless path is {' or '.join(kinds)} ({path})"
            )
    return kind


def split_name(path: Path) -> tuple[Path, str]:
    """The file of ``FILE:/NAME``, and the name; "" of a file alone."""
    file, colon, name = str(path).rpartition(":/")
    if colon and not path.exists() and kind_of(Path(file)) == ARRAY:
        return Path(file), name
    return path, ""


def kind_of(path: Path) -> str:
    """Kind of file or folder at a path, in words; empty where there is none of that name."""
    return FOLDER if path.is_dir() else SUFFIXES.get(path.suffix.lower(), "")


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

    from hdc.readers.images import grey

    window = Window(crop, subsample)
    level = cv2.utils.logging.getLogLevel()
    cv2.utils.logging.setLogLevel(cv2.utils.logging.LOG_LEVEL_SILENT)
    try:
        capture = cv2.VideoCapture(index)  # an error of ours says that there is none
    finally:
        cv2.utils.logging.setLogLevel(level)
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
