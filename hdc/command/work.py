"""Shared by the commands: a saved model, and the recordings that fit it."""

from __future__ import annotations

import math
from collections.abc import Collection
from itertools import zip_longest
from pathlib import Path
from typing import Any

import hdc
from hdc import io
from hdc.command.messages import size
from hdc.command.source import Source
from hdc.readers import BadFrame, Recording, Window, natural_key


def load(path: Path, trusted: Collection[str] = ()) -> tuple[Any, Window]:
    """A saved classifier or regressor, and which pixels of an image it uses.

    It may have parts of the `trusted` classes, which are imported.

    Raises:
        ValueError: the file is no such model.
    """
    try:
        header, _ = io.read_model(path, tensors=False)
    except ValueError as error:
        raise ValueError(f"{path}: expected a saved model, found {error}") from error
    learns_values = header.get("kind") == hdc.HDCRegressor.__name__
    kind: Any = hdc.HDCRegressor if learns_values else hdc.HDCClassifier
    model = kind.load(path, trusted)
    kept = ("crop", "subsample", "image")
    crop, subsample, image = (model.metadata_.get(key) for key in kept)
    return model, Window(crop, subsample or 1, image and tuple(image))


def frames_for(
    model: Any, window: Window, source: Source, fewest_classes: int = 1
) -> Recording:
    """A recording of classes that the model knows (one of them, or more), or of its values.

    With no `fewest_classes` it may have neither labels nor values.
    """
    frames = source.with_values(value_names(model)).open(window, fewest_classes)
    check_fits(model, frames)
    if not hasattr(model, "classes_"):
        _check_values(model, frames)
        return frames
    if frames.labels is None and fewest_classes > 0:
        found = ", ".join(frames.value_names)
        raise ValueError(
            f"{source.path}: expected a label of each frame, found only {found}"
        )
    known = [str(c) for c in model.classes_]
    names = set() if frames.labels is None else set(frames.names)
    unknown = sorted(names - set(known), key=natural_key)
    if unknown:
        raise ValueError(
            f"{source.path}: expected classes among {', '.join(known)}, found "
            f"{unknown[0]!r} (to add a class: hdc train on all of them, or partial_fit in Python)"
        )
    return frames


def _check_values(model: Any, frames: Recording) -> None:
    """Raise a ValueError unless a recording has as many numbers per frame as the model predicts."""
    if frames.values is None:
        wanted = "a table of the numbers to compare with"
        raise ValueError(f"--values: expected {wanted}, found none")
    n = len(model.mean_)
    if frames.values.shape[1] != n:
        found = ", ".join(frames.value_names)
        raise ValueError(
            f"--column: expected {n} numbers per frame as in training, found {found}"
        )


def value_names(model: Any) -> tuple[str, ...]:
    """Names of the numbers of a regressor, none where Python saved none; none of a classifier."""
    if hasattr(model, "classes_"):
        return ()
    return tuple(model.metadata_.get("values", ()))


def check_fits(model: Any, recording: Recording) -> None:
    """Raise a BadFrame for other columns, or another size, than those in training."""
    trained = getattr(model, "columns_", None) or ()
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
