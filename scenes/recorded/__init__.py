"""Recorded frames: a folder of images, an .npz archive or a video, behind one function.

Nothing that a file says is believed before it is checked: sizes are read from headers and refused
before anything is decoded, nothing is ever unpickled, and each error names the file, what was
found and what was expected.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from scenes.recorded.files import BadFrame, file_size, shown
from scenes.recorded.scene import Options, RecordedScene, Window

__all__ = ["BadFrame", "Options", "RecordedScene", "Window", "open_recording"]

VIDEO_SUFFIXES = (".mp4", ".m4v", ".mov", ".avi", ".mkv", ".webm")


def open_recording(
    path: str | Path,
    intervals: str | Path | None = None,
    crop: Sequence[int] | None = None,
    subsample: int = 1,
    on_bad_frame: str = "stop",
    threads: int | None = None,
    memory_bytes: int = 2**28,
    max_pixels: int = 2**24,
) -> RecordedScene:
    """Open recorded frames and check every one of them.

    Args:
        path: a folder with one sub-folder of images a class (:mod:`scenes.recorded.images`), an
            .npz with ``frames`` and ``labels`` (:mod:`scenes.recorded.archive`), or a video with
            a table of labelled intervals (:mod:`scenes.recorded.video`).
        intervals: that table; default: beside the video, its suffix replaced by .csv.
        crop: (x, y, width, height) in pixels, x to the right and y down from the top left corner.
        subsample: every subsample-th pixel of the crop on both axes is kept (not averaged, which
            would lower the contrast of a speckle).
        on_bad_frame: ``"stop"`` at the first frame that cannot be used, or ``"skip"`` it: then
            ``scene.skipped`` lists each with the reason.
        threads: that decode images; default: one a core.
        memory_bytes: frames are kept in memory up to this size, and read as a stream above it.
        max_pixels: larger images are refused from their header, before they are decoded. With
            the defaults no recording, however it was made, takes more than 1 GB to open.

    Raises:
        ValueError: :class:`BadFrame` for a frame that cannot be used; otherwise for a setting,
            a label, a table or a folder that is not as described.
    """
    options = Options(Window(crop, subsample), on_bad_frame, threads, memory_bytes, max_pixels)
    if not isinstance(path, str | Path) or not str(path):
        raise ValueError(f"scene.path: expected the path of a folder or a file, found {path!r}")
    path = _expanded("scene.path", path)
    suffix = path.suffix.lower()
    if intervals is not None:
        if not isinstance(intervals, str | Path) or not str(intervals):
            raise ValueError(
                f"scene.intervals: expected null or the path of a table, found {intervals!r}"
            )
        if suffix not in VIDEO_SUFFIXES:
            raise ValueError(
                f"scene.intervals: expected null unless scene.path is a video ({shown(path)})"
            )
    # OpenCV is imported where images or videos are read, and not for an archive.
    if path.is_dir():
        from scenes.recorded.images import open_folder

        return open_folder(path, options)
    if not path.exists():
        raise ValueError(
            f"scene.path: expected a folder, an .npz or a video, found nothing: {shown(path)}"
        )
    file_size(path)  # raises: a pipe is opened for ever
    if suffix == ".npz":
        from scenes.recorded.archive import open_archive

        return open_archive(path, options)
    if suffix in VIDEO_SUFFIXES:
        from scenes.recorded.video import open_video

        table = path.with_suffix(".csv")
        if intervals is not None:
            table = _expanded("scene.intervals", intervals)
        return open_video(path, table, options)
    raise ValueError(
        f"scene.path: expected a folder, an .npz or a video ({', '.join(VIDEO_SUFFIXES)}), "
        f"found {shown(path)}"
    )


def _expanded(key: str, path: str | Path) -> Path:
    try:
        return Path(path).expanduser()
    except RuntimeError as error:  # ~somebody
        raise ValueError(f"{key}: expected a path, found {shown(path)}: {error}") from error
