"""Readers of recorded frames: a folder of images as it is, arrays, a video, or a camera.

:func:`open_recording` opens what lies on disk::

    recording = open_recording("~/touches")           # or touches.npz, touches.mp4
    frames = recording.frames([0, 1, 2])              # uint8 or uint16 [3, H, W]
    names = [recording.classes[c] for c in recording.labels]

docs/formats.md describes every kind. Images, videos and cameras need OpenCV and Pillow
(``pip install 'speckle-hdc[readers]'``); this module itself imports numpy only. Each error names
the file, what was expected and what was found. Nothing is ever unpickled.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from hdc.readers.files import BadFrame, SettingError, check_file, natural_key, require, shown
from hdc.readers.live import camera
from hdc.readers.recording import Recording, Window, is_integer

__all__ = [
    "BadFrame",
    "Recording",
    "SettingError",
    "Window",
    "camera",
    "check_path",
    "natural_key",
    "open_recording",
]

VIDEO_SUFFIXES = (".mp4", ".m4v", ".mov", ".avi", ".mkv", ".webm")
ARRAY_SUFFIXES = (".npz", ".npy")


def open_recording(
    path: str | Path,
    intervals: str | Path | None = None,
    crop: Sequence[int] | None = None,
    subsample: int = 1,
    on_bad_frame: str = "stop",
    threads: int | None = None,
    memory_bytes: int = 2**28,
    max_pixels: int = 2**24,
    *,
    template: str | None = None,
    table: str | Path | None = None,
    image_column: str = "image",
    value_columns: Sequence[str] = (),
    axes: Sequence[str] | None = None,
    window: Window | None = None,
    check: bool = True,
    fewest_classes: int = 2,
) -> Recording:
    """Open recorded frames with their labels, values and order.

    Args:
        path: a folder of images, an .npz, an .npy or a video; ``~`` is the home folder.
        intervals: table of a video; default: beside the video, its suffix replaced by .csv.
        crop: (x, y, width, height) in pixels, x to the right and y down from the top left corner.
        subsample: every subsample-th pixel of the crop on both axes is kept (not averaged, which
            would lower the contrast of a speckle).
        on_bad_frame: ``"stop"`` at the first frame that cannot be used, or ``"skip"`` it: then
            ``recording.skipped`` lists each with the reason.
        threads: number of threads that decode images.
        memory_bytes: images are kept in memory up to this size, else decoded again when asked for.
        max_pixels: larger images are refused before they are decoded.
        template: path of an image inside the folder, such as ``{session}/{label}/*_{order}.png``.
        table: CSV with a row an image, in or relative to the folder; other columns are values.
        image_column: column of the table that names the image.
        value_columns: columns that are values; default: all numeric ones but order, session and
            group (none of a manifest.csv).
        axes: names of the axes of an array, such as ``("label", "order", "height", "width")``.
        window: crop and subsample in one.
        check: decode every image at once; otherwise each when it is asked for.
        fewest_classes: a recording of fewer is refused.

    Returns:
        Frames, labels or None, values or None, and ``other_files``, the files that are no frames.

    Raises:
        SettingError: a setting is out of range, or the path leads to no recording.
        BadFrame: a frame cannot be used.
        ValueError: a label, a table or a folder is not as described.

    Example::

        open_recording("press", template="material_{label}/cycle_{order}_A/frame.png")
        open_recording("pins", table="targets.csv", value_columns=["z"])
    """
    window = window or Window(crop, subsample)
    require(on_bad_frame in ("stop", "skip"), "on_bad_frame", on_bad_frame, "stop or skip")
    fits = threads is None or (is_integer(threads) and 1 <= threads <= 256)
    require(fits, "threads", threads, "null or an integer in [1, 256]")
    for name, value, low in (("memory_bytes", memory_bytes, 0), ("max_pixels", max_pixels, 1)):
        require(is_integer(value) and value >= low, name, value, f"an integer ≥ {low}")
    path, where = _resolved(path, intervals)
    skip = on_bad_frame == "skip"
    folder = path.is_dir()
    for name, setting in (("template", template), ("table", table)):
        require(setting is None or folder, name, setting, f"null unless path is a folder ({path})")
    is_array = path.suffix.lower() in ARRAY_SUFFIXES and not folder
    require(axes is None or is_array, "axes", axes, f"null unless path is an array ({path})")
    if folder:  # OpenCV is imported where images or videos are read, and not for an array
        from hdc.readers.images import open_listing
        from hdc.readers.listing import list_folder

        listing = list_folder(path, template, table, image_column, value_columns)
        return open_listing(
            path, listing, window, skip, check, fewest_classes, threads, memory_bytes, max_pixels
        )
    if is_array:
        from hdc.readers.archive import open_array

        return open_array(path, window, axes, value_columns, fewest_classes, max_pixels)
    from hdc.readers.video import open_video

    return open_video(path, where, window, skip, fewest_classes, max_pixels)


def check_path(path: str | Path, intervals: str | Path | None = None) -> None:
    """Raise a ValueError unless there is a folder, array or video; nothing is read."""
    _resolved(path, intervals)


def _resolved(path: str | Path, intervals: str | Path | None) -> tuple[Path, Path]:
    """A folder, array or video that exists, and where the table of a video would be."""
    path = _expanded("path", path)
    suffix = path.suffix.lower()
    is_video = suffix in VIDEO_SUFFIXES and not path.is_dir()
    require(intervals is None or is_video, "intervals", intervals, "null unless path is a video")
    if not path.exists():
        raise SettingError(
            f"path: expected a folder, an .npz or a video, found nothing: {shown(path)}"
        )
    if not path.is_dir():
        check_file(path)
        if suffix not in (*ARRAY_SUFFIXES, *VIDEO_SUFFIXES):
            raise SettingError(
                f"path: expected a folder, an array ({', '.join(ARRAY_SUFFIXES)}) or a video "
                f"({', '.join(VIDEO_SUFFIXES)}), found {shown(path)}"
            )
    beside = path.parent / f"{path.stem}.csv"
    return path, beside if intervals is None else _expanded("intervals", intervals)


def _expanded(key: str, path: Any) -> Path:
    require(isinstance(path, str | Path) and path != "", key, path, "a path")
    try:
        return Path(path).expanduser()
    except RuntimeError as error:  # ~somebody
        raise SettingError(f"{key}: expected a path, found {shown(path)}: {error}") from error
