"""Shared by the commands: opening recordings and models, and whether they fit together."""

from __future__ import annotations

import math
import warnings
from itertools import zip_longest
from pathlib import Path
from typing import Any

import click
import numpy as np

import hdc
from hdc import io, readers
from hdc.command.messages import size
from hdc.command.options import TRUSTED
from hdc.readers import BadFrame, Recording, Window, natural_key
from hdc.readers.images import stream_files
from hdc.readers.listing import MANIFEST, image_files
from hdc.readers.recording import with_progress

KINDS = ("HDCClassifier", "HDCRegressor")
"""Models that the commands know."""


def open_frames(
    recording: Path, window: Window, fewest_classes: int = 2, **source: Any
) -> Recording:
    """Open a recording as the options of the command line say; images are decoded when needed."""
    frames = readers.open_recording(
        recording, window=window, check=False, fewest_classes=fewest_classes, **source
    )
    if line := frames.left_out():
        warnings.warn(line, stacklevel=2)
    return frames


def load(path: Path) -> tuple[Any, Window]:
    """A saved classifier or regressor, and which pixels of an image it uses.

    Raises:
        ValueError: the file is no such model.
    """
    if path.is_dir():
        raise ValueError(
            f"{path}: expected a saved model, found a folder (the MODEL comes first)"
        )
    try:
        header, _ = io.read_model(path, tensors=False)
    except ValueError as error:
        raise ValueError(f"{path}: expected a saved model, found {error}") from error
    kind = header.get("kind")
    if kind not in KINDS:
        raise ValueError(
            f"{path}: expected a saved {' or '.join(KINDS)}, found {kind!r}"
        )
    context = click.get_current_context(silent=True)
    trusted = context.meta.get(TRUSTED, ()) if context else ()
    model = getattr(hdc, kind).load(path, trusted)
    crop, subsample = (model.metadata_.get(key) for key in ("crop", "subsample"))
    return model, Window(crop, subsample or 1)


def frames_for(
    model: Any, window: Window, recording: Path, source: dict[str, Any]
) -> Recording:
    """A recording of classes that the model knows (one of them, or more), or of its values."""
    names = value_names(model)
    has_columns = source["table"] or recording.suffix.lower() in (".npz", ".csv")
    if names and has_columns and not source["value_columns"]:
        source = source | {"value_columns": names}
    frames = open_frames(recording, window, 1, **source)
    check_fits(model, frames)
    if not hasattr(model, "classes_"):
        return frames
    known = [str(c) for c in model.classes_]
    unknown = sorted(set(frames.names) - set(known), key=natural_key)
    if unknown:
        raise ValueError(
            f"{recording}: expected classes among {', '.join(known)}, found "
            f"{unknown[0]!r} (to add a class: hdc train on all of them, or partial_fit in Python)"
        )
    return frames


def unlabelled_frames(
    model: Any, window: Window, recording: Path, source: dict[str, Any]
) -> np.ndarray | None:
    """Frames [N, H, W] or [N, D] of a recording without labels; None where it has labels.

    Such are the images of a folder without sub-folders of images, a table or a template, and an
    array or a table of frames alone.
    """
    if any(source.get(name) for name in ("table", "template", "labels")):
        return None
    if recording.is_dir():
        if (recording / MANIFEST).exists():
            return None
        files = image_files(recording)
        if any(file.parent != recording for file in files):
            return None
        placed = zip(files, stream_files(files, window), strict=True)
        stream: Any = (_checked(model, place, frame) for place, frame in placed)
        total = len(files)
    elif readers.split_name(recording)[0].suffix.lower() in readers.FRAMES:
        found = readers.open_recording(
            recording, window=window, axes=source.get("axes"), fewest_classes=0
        )
        if found.labels is not None:
            return None
        check_fits(model, found)
        stream, total = found.stream(), len(found)
    else:
        return None
    return np.stack(list(with_progress(stream, total, "Reading")))


def _checked(model: Any, place: Path, frame: np.ndarray) -> np.ndarray:
    check_size(model, frame.shape, place)
    return frame


def value_names(model: Any) -> tuple[str, ...]:
    """Names of the numbers that a regressor was trained on; none of a classifier."""
    if hasattr(model, "classes_"):
        return ()
    return tuple(model.metadata_.get("values", ()))


def check_fits(model: Any, recording: Recording) -> None:
    """Raise a BadFrame for other columns, or another size, than those in training."""
    trained = getattr(model, "feature_names_in_", ())
    found = recording.features
    place = recording.place(0)
    if len(trained) and found and tuple(trained) != found:
        pairs = zip_longest(trained, found, fillvalue="none")
        wanted, other = next((a, b) for a, b in pairs if a != b)
        raise BadFrame(
            f"{place}: expected the columns of training in its order, found {other} for {wanted}"
        )
    check_size(model, recording.frame_shape, place)


def check_size(model: Any, shape: tuple[int, ...], place: object) -> None:
    """Raise a BadFrame for a frame of another size than those in training; flat ones have none."""
    expected = model.frame_shape_
    if shape == expected or (len(expected) == 1 and math.prod(shape) == expected[0]):
        return
    raise BadFrame(
        f"{place}: expected {size(expected)} as in training, found {size(shape)}"
    )


def check_circular(recording: Recording, period: float | None) -> None:
    """Raise a ValueError for a period of no values."""
    if period is not None and recording.values is None:
        raise ValueError("--circular: expected a table of numbers, found classes")
