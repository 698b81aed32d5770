"""What the commands share: frames from readers, batch by batch, into a model and its scores."""

from __future__ import annotations

import math
import warnings
from collections.abc import Iterable, Iterator, Sequence
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np

import hdc
from hdc import readers
from hdc.accuracy import accuracy, confusion, wilson
from hdc.readers import VIDEO_SUFFIXES, BadFrame, Recording, Window, natural_key
from hdc.readers.images import stream_files
from hdc.readers.recording import with_progress
from hdc.readers.video import stream_video

BATCH = 32
"""Frames asked about at a time: meanwhile threads decode the next ones."""


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
    """A saved classifier or regressor, and which pixels of an image it looks at.

    Raises:
        ValueError: the file is no such model.
    """
    try:
        model: Any = hdc.HDCClassifier.load(path)
    except ValueError as error:
        if "HDCRegressor" not in str(error):
            raise
        model = hdc.HDCRegressor.load(path)
    crop, subsample = (model.metadata_.get(key) for key in ("crop", "subsample"))
    return model, Window(crop, subsample or 1)


def frames_for(
    model: Any, window: Window, recording: Path, source: dict[str, Any]
) -> Recording:
    """A recording of classes that the model knows (one of them, or more), or of its values."""
    if (
        source["table"]
        and not source["value_columns"]
        and (names := value_names(model))
    ):
        source = source | {"value_columns": names}
    frames = open_frames(recording, window, 1, **source)
    _check_size(model, frames.shape, frames.place(0))
    if not hasattr(model, "classes_"):
        return frames
    known = [str(c) for c in model.classes_]
    if unknown := sorted(set(frames.names) - set(known), key=natural_key):
        raise ValueError(
            f"{recording}: expected classes among {', '.join(known)}, found "
            f"{unknown[0]!r} (to add a class: hdc train on all of them, or partial_fit in Python)"
        )
    return frames


def value_names(model: Any) -> tuple[str, ...]:
    return (
        () if hasattr(model, "classes_") else tuple(model.metadata_.get("values", ()))
    )


def _check_size(model: Any, shape: tuple[int, ...], place: object) -> None:
    """Raise a BadFrame for a frame of another size than those in training; flat ones have none."""
    expected = model.frame_shape_
    if shape != expected and (len(expected) == 2 or math.prod(shape) != expected[0]):
        raise BadFrame(
            f"{place}: expected {size(expected)} as in training, found {size(shape)}"
        )


def size(shape: Sequence[int]) -> str:
    return f"{' × '.join(str(side) for side in reversed(shape))} pixels"


# Splits ------------------------------------------------------------------------------------------


def hold_out(
    recording: Recording, fraction: float | None
) -> tuple[np.ndarray, np.ndarray, str]:
    """Indices to train on and to hold out, increasing, and how these were chosen.

    The last sessions where there are several, else the same share of each class at random.
    """
    every = np.arange(len(recording))
    if fraction is None:
        return every, every[:0], ""
    if (last := last_sessions(recording, fraction)) is not None:
        return every[~last], every[last], "in the last sessions"
    labels = (
        np.zeros(len(recording), int) if recording.labels is None else recording.labels
    )
    return *split(labels, fraction, 0), "at random"


def last_sessions(recording: Recording, fraction: float) -> np.ndarray | None:
    """Mask [N] of the last sessions; None unless there are several, the first of every class."""
    labels = recording.labels
    if recording.session is None or len(known := np.unique(recording.session)) < 2:
        return None
    count = min(max(1, round(fraction * len(known))), len(known) - 1)
    last = np.isin(recording.session, known[-count:])
    return None if labels is not None and set(labels) - set(labels[~last]) else last


def split(
    labels: np.ndarray, fraction: float, seed: int, order: np.ndarray | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """Indices to train on and to hold out, increasing; of each class the same share, at random.

    With the `order` [N] of the frames, the last of each class are held out.

    Raises:
        ValueError: for a class of one frame.
    """
    rng, test = np.random.default_rng(seed), []
    for c in np.unique(labels):
        members = np.flatnonzero(labels == c)
        if len(members) < 2:
            raise ValueError(
                "--test-fraction: expected two frames or more of each class, found one"
            )
        held = min(max(1, round(len(members) * fraction)), len(members) - 1)
        if order is None:
            test.append(rng.permutation(members)[:held])
        else:
            test.append(members[np.argsort(order[members], kind="stable")][-held:])
    chosen = np.sort(np.concatenate(test))
    return np.setdiff1d(np.arange(len(labels)), chosen), chosen


# Predictions and scores --------------------------------------------------------------------------


def ask(
    model: Any, window: Window, files: Sequence[Path], reject: float | None
) -> Iterator[dict[str, Any]]:
    """The model's answers for image files, then for each frame of videos."""
    videos = [file for file in files if file.suffix.lower() in VIDEO_SUFFIXES]
    images = [file for file in files if file not in videos]
    yield from _answers(
        model, zip(images, stream_files(images, window), strict=True), reject
    )
    for video in videos:
        stills = (
            (f"{video} at {t:.3f} s", frame) for t, frame in stream_video(video, window)
        )
        # All before the first is given: at its end a video may turn out to be interlaced.
        yield from list(_answers(model, stills, reject))


def _answers(
    model: Any, frames: Iterable[tuple[object, np.ndarray]], reject: float | None
) -> Iterator[dict[str, Any]]:
    """File and values of each frame, or its label with margin and distances of prototypes."""
    for some in _batched(frames):
        for place, frame in some:
            _check_size(model, frame.shape, place)
        batch = np.stack([frame for _, frame in some])
        files = [{"file": str(place)} for place, _ in some]
        if not hasattr(model, "classes_"):
            rows = model.predict(batch).reshape(len(batch), -1).tolist()
            for file, row in zip(files, rows, strict=True):
                yield file | dict(zip(value_names(model), row, strict=True))
            continue
        labels = model.predict(batch, reject=reject or False).tolist()
        if model.readout != "prototype":
            yield from (
                file | {"label": label}
                for file, label in zip(files, labels, strict=True)
            )
            continue
        for file, label, distances in zip(
            files, labels, model.distances(batch), strict=True
        ):
            shares = (distances / model.dimension_).tolist()
            nearest = sorted(shares)
            yield file | {
                "label": label,
                "margin": nearest[1] - nearest[0] if len(nearest) > 1 else None,
                "distances": dict(zip(map(str, model.classes_), shares, strict=True)),
            }


def score(
    model: Any, recording: Recording, index: np.ndarray, reject: float | None = None
) -> dict[str, Any]:
    """Accuracy, confusions and wrong frames (or mean absolute errors), with lines for people."""
    frames = with_progress(recording.stream(index), len(index), "Evaluating")
    predicted, known = [], []
    for some in _batched(frames):
        batch = np.stack(some)
        predicted.append(model.predict(batch))
        if reject:
            known.append(model.is_known(batch, reject))
    if not hasattr(model, "classes_"):
        return _errors(recording, np.concatenate(predicted), index)
    names = [str(c) for c in model.classes_]
    row = {name: k for k, name in enumerate(names)}
    truth = np.array(recording.names)[index].tolist()
    found = [str(c) for c in np.concatenate(predicted)]
    true, read = (np.array([row[name] for name in some]) for some in (truth, found))
    counts, right = confusion(read, true, len(names)), int((read == true).sum())
    share, (low, high) = accuracy(read, true), wilson(right, len(index))
    text = [
        f"accuracy {share:.1%} (95 % interval {low:.1%} to {high:.1%}), "
        f"{right} of {len(index)} frames",
        *confusions(names, counts),
    ]
    wrong = [
        {"file": recording.place(i), "label": a, "predicted": b}
        for i, a, b in zip(index, truth, found, strict=True)
        if a != b
    ]
    result = {
        "frames": len(index), "accuracy": share, "interval": [low, high], "classes": names,
        "confusion": counts.tolist(), "wrong": wrong, "text": text,
    }  # fmt: skip
    if reject:
        result["refused"] = refused = int((~np.concatenate(known)).sum())
        text.insert(
            1, f"--reject {reject:g} refuses {refused} of them as none of the classes"
        )
    return result


def _errors(
    recording: Recording, predicted: np.ndarray, index: np.ndarray
) -> dict[str, Any]:
    """Absolute errors of each value."""
    if recording.values is None:
        raise ValueError(
            "--values: expected a table of the numbers to compare with, found none"
        )
    errors = np.abs(predicted.reshape(len(index), -1) - recording.values[index])
    rows, text = {}, []
    for name, e in zip(recording.value_names, errors.T, strict=True):
        rows[name] = {"mean_absolute_error": float(e.mean())}
        text.append(f"{name}: mean absolute error {e.mean():.4g}, {len(index)} frames")
    return {"frames": len(index), "errors": rows, "text": text}


def confusions(names: Sequence[str], counts: np.ndarray) -> list[str]:
    """Lines of a table of counts [L, L], a row a true class."""
    heads = [name[:12] for name in names]
    width, cell = (
        max(map(len, names)),
        max(map(len, [*heads, *map(str, counts.ravel())])),
    )
    lines = ["rows are the true classes, columns the predicted ones"]
    lines.append(" ".join([" " * width, *(f"{head:>{cell}}" for head in heads)]))
    for name, row in zip(names, counts, strict=True):
        lines.append(" ".join([f"{name:{width}}", *(f"{n:>{cell}}" for n in row)]))
    return lines


def _batched(items: Iterable[Any]) -> Iterator[list[Any]]:
    waiting = iter(items)
    while some := list(islice(waiting, BATCH)):
        yield some
