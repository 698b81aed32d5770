"""Readers of recorded frames: a folder of images, an .npz archive, a video, or a camera.

:func:`open_recording` opens and checks what lies on disk::

    recording = open_recording("~/touches")           # or touches.npz, touches.mp4
    frames = recording.frames([0, 1, 2])              # uint8 or uint16 [3, H, W]
    names = [recording.classes[c] for c in recording.labels]

The command ``hdc`` reads the same formats, and ``scene=recorded`` of the harness does.

**A folder with one sub-folder a class** (PNG, JPEG, BMP, TIFF; :mod:`hdc.readers.images`)::

    touches/left/1.png   touches/left/2.png   touches/right/1.png   …

**A folder with a manifest.csv**, which says what belongs to the recording. ``file`` and ``label``
are needed; ``class_index`` (order of the classes), ``order`` (place in time) and ``session`` (for a
split by sessions) are known by name; any other column is kept in ``recording.samples``
(:mod:`hdc.readers.listing`)::

    file,label,order,session
    day1/0001.png,left,0,0
    day1/0002.png,right,1,0
    day2/0001.png,left,2,1

**An .npz** with ``frames`` [N, H, W] (uint8 or uint16) and ``labels`` [N] (integers or strings);
``classes`` [L] names integer labels, and other arrays [N] (``order``, ``session`` …) are kept in
``recording.samples`` (:mod:`hdc.readers.archive`)::

    np.savez("touches.npz", frames=frames, labels=np.array(["left", "right", …]))

**A video** (mp4, mov, avi, mkv, webm) **with a table of labelled intervals** in seconds from its
first frame, touches.csv beside touches.mp4 (:mod:`hdc.readers.video`)::

    start_s,end_s,label
    0.5,4,left
    5,8.5,right

**A camera**, frame by frame (:func:`camera`)::

    for frame in camera(0, crop=[70, 0, 500, 500]):
        print(model.predict(frame[None]))

Images, videos and cameras need OpenCV and Pillow (``pip install 'hdc[readers]'``); this module
itself imports numpy only. Nothing that a file says is believed before it is checked: sizes are read
from headers and refused before anything is decoded, nothing is ever unpickled, and each error names
the file, what was expected and what was found.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from hdc.readers.files import BadFrame, file_size, natural_key, shown
from hdc.readers.live import camera
from hdc.readers.recording import Recording, Stream
from hdc.readers.settings import Options, SettingError, Window, require

__all__ = [
    "BadFrame",
    "Options",
    "Recording",
    "SettingError",
    "Stream",
    "Window",
    "camera",
    "check_path",
    "natural_key",
    "open_recording",
    "open_stream",
]

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
) -> Recording:
    """Open recorded frames and check every one of them.

    Args:
        path: a folder of images, an .npz or a video, as described above; ``~`` is the home folder.
        intervals: the table of a video; default: beside the video, its suffix replaced by .csv.
        crop: (x, y, width, height) in pixels, x to the right and y down from the top left corner.
        subsample: every subsample-th pixel of the crop on both axes is kept (not averaged, which
            would lower the contrast of a speckle).
        on_bad_frame: ``"stop"`` at the first frame that cannot be used, or ``"skip"`` it: then
            ``recording.skipped`` lists each with the reason.
        threads: number of threads that decode images; default: one a usable core.
        memory_bytes: frames are kept in memory up to this size; above it, images are decoded again
            when asked for, an archive is read in place, and a video is kept in a temporary file.
        max_pixels: larger images are refused from their header, before they are decoded. With
            the defaults no recording, however it was made, takes more than 1 GB to open.

    Raises:
        SettingError: a setting is out of range, or the path leads to no recording.
        BadFrame: a frame cannot be used.
        ValueError: a label, a table or a folder is not as described.
    """
    options = Options(Window(crop, subsample), on_bad_frame, threads, memory_bytes, max_pixels)
    path, table = _found(path, intervals)
    if path.is_dir():
        from hdc.readers.images import open_folder

        return open_folder(path, options)
    return _open_file(path, table, options)


def open_stream(
    path: str | Path, intervals: str | Path | None = None, options: Options | None = None
) -> Stream:
    """Open recorded frames to read each once, without checking all of them first.

    Images of a folder are decoded ahead of whoever takes them, in the order asked for; a video is
    decoded when it is opened, as by :func:`open_recording`.

    Args:
        path, intervals: see :func:`open_recording`.
        options: its other settings; ``on_bad_frame="skip"`` is of no effect on images.

    Raises:
        SettingError, BadFrame, ValueError: see :func:`open_recording`; for the pixels of images,
            when they are asked for.
    """
    options = options or Options()
    path, table = _found(path, intervals)
    if path.is_dir():
        from hdc.readers.images import stream_folder

        return stream_folder(path, options)
    recording = _open_file(path, table, options)
    labels = [recording.classes[c] for c in recording.labels]
    return Stream(labels, lambda i: f"{shown(path)}, frame {i}", recording.stream)


def check_path(path: str | Path, intervals: str | Path | None = None) -> None:
    """Whether there may be a recording: what can be said before anything is read.

    Raises:
        SettingError: the path leads to no folder, .npz or video.
        BadFrame: it leads to what is no regular file.
    """
    _found(path, intervals)


def _open_file(path: Path, table: Path, options: Options) -> Recording:
    # OpenCV is imported where images or videos are read, and not for an archive.
    if path.suffix.lower() == ".npz":
        from hdc.readers.archive import open_archive

        return open_archive(path, options)
    from hdc.readers.video import open_video

    return open_video(path, table, options)


def _found(path: str | Path, intervals: str | Path | None) -> tuple[Path, Path]:
    """A folder, an .npz or a video that is there, and where the table of a video would be."""
    named = isinstance(path, str | Path) and bool(str(path))
    require(named, "path", path, "the path of a folder or a file")
    path = _expanded("path", path)
    suffix = path.suffix.lower()
    table = path.with_suffix(".csv") if suffix in VIDEO_SUFFIXES else path
    if intervals is not None:
        named = isinstance(intervals, str | Path) and bool(str(intervals))
        require(named, "intervals", intervals, "null or the path of a table")
        if suffix not in VIDEO_SUFFIXES:
            raise SettingError(f"intervals: expected null unless path is a video ({shown(path)})")
        table = _expanded("intervals", intervals)
    if path.is_dir():
        return path, table
    if not path.exists():
        raise SettingError(
            f"path: expected a folder, an .npz or a video, found nothing: {shown(path)}"
        )
    file_size(path)  # raises: a pipe is opened for ever
    if suffix != ".npz" and suffix not in VIDEO_SUFFIXES:
        raise SettingError(
            f"path: expected a folder, an .npz or a video ({', '.join(VIDEO_SUFFIXES)}), "
            f"found {shown(path)}"
        )
    return path, table


def _expanded(key: str, path: str | Path) -> Path:
    try:
        return Path(path).expanduser()
    except RuntimeError as error:  # ~somebody
        raise SettingError(f"{key}: expected a path, found {shown(path)}: {error}") from error
