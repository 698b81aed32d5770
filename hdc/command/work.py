"""The commands' work: frames from readers, batch by batch, into a model."""

from __future__ import annotations

import json
import math
import time
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from datetime import UTC, datetime
from itertools import islice
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

import hdc
from hdc import readers
from hdc.accuracy import accuracy, confusion, wilson
from hdc.readers import VIDEO_SUFFIXES, BadFrame, Recording, Window
from hdc.readers.files import natural_key, shown
from hdc.readers.images import stream_files
from hdc.readers.recording import with_progress

T = TypeVar("T")

BATCH = 32
"""Frames asked about at a time: meanwhile threads decode the next ones."""
MOST_NAMED = 20
"""Classes up to which all confusions are shown as a table."""


def open_frames(
    recording: Path, window: Window, fewest_classes: int = 2, **source: Any
) -> Recording:
    """Open a recording as the options of the command line say; images are decoded when needed."""
    source["value_columns"] = source.pop("columns", ())
    return readers.open_recording(
        recording, window=window, check=False, fewest_classes=fewest_classes, **source
    )


def train(
    recording: Recording,
    window: Window,
    output: Path,
    test_fraction: float | None,
    seed: int,
    readout: str | None = None,
    balance: bool | None = None,
) -> str:
    """Train on a recording and save the model.

    Returns:
        Lines for people: frames, time, accuracy on the frames held out.
    """
    begin = time.perf_counter()
    training, test, how = hold_out(recording, test_fraction, seed)
    options: dict[str, Any] = {} if balance is None else {"balance": balance}
    frames = Passing(recording, training)
    model: Any
    if recording.values is not None:
        model = hdc.HDCRegressor(readout=readout or "ridge")
        model.fit(frames, recording.values[training])
        learnt = f"values of {', '.join(recording.value_names)}"
    else:
        if readout is not None:
            options["readout"] = readout
        names = recording.names
        model = hdc.HDCClassifier(**options).fit(frames, [names[i] for i in training])
        learnt = f"{len(recording.classes)} classes"
    seconds = time.perf_counter() - begin
    metadata: dict[str, Any] = {"crop": window.crop, "subsample": window.subsample}
    metadata |= {"values": list(recording.value_names)} if recording.value_names else {}
    metadata |= {"trained": datetime.now(UTC).isoformat(timespec="seconds")}
    model.save(output, metadata=metadata | {"version": hdc.__version__})
    lines = [
        f"{shown(output)}: {len(training)} frames, {learnt}, {_size(recording.shape)}, "
        f"in {seconds:.1f} s ({len(training) / seconds:.0f} a second)"
    ]
    if len(test):
        lines.append(f"held out {how}: {_score(model, recording, test)['text'][0]}")
    return "\n".join([*lines, *filter(None, [recording.left_out()])])


def hold_out(
    recording: Recording, fraction: float | None, seed: int
) -> tuple[np.ndarray, np.ndarray, str]:
    """Indices to train on and to hold out, increasing, and how these were chosen.

    The last sessions where there are several, else the same share of each class at random.
    """
    every = np.arange(len(recording))
    if fraction is None:
        return every, every[:0], ""
    if (last := last_sessions(recording, fraction)) is not None:
        return every[~last], every[last], "in the last sessions"
    return *split(recording.labels, fraction, seed, len(recording)), "at random"


def last_sessions(recording: Recording, fraction: float) -> np.ndarray | None:
    """Mask [N] of the last sessions; None unless there are several, the first of every class."""
    labels = recording.labels
    if recording.session is None or len(known := np.unique(recording.session)) < 2:
        return None
    count = min(max(1, round(fraction * len(known))), len(known) - 1)
    last = np.isin(recording.session, known[-count:])
    return None if labels is not None and set(labels) - set(labels[~last]) else last


def split(
    labels: np.ndarray | None, fraction: float, seed: int, n: int
) -> tuple[np.ndarray, np.ndarray]:
    """Indices to train on and to hold out, increasing; of each class the same share, at random.

    Raises:
        ValueError: for a class of one frame.
    """
    labels = np.zeros(n, int) if labels is None else labels
    rng, test = np.random.default_rng(seed), []
    for c in np.unique(labels):
        members = np.flatnonzero(labels == c)
        if len(members) < 2:
            raise ValueError(
                "--test-fraction: expected two frames or more of each class, found one"
            )
        held = min(max(1, round(len(members) * fraction)), len(members) - 1)
        test.append(rng.permutation(members)[:held])
    chosen = np.sort(np.concatenate(test))
    return np.setdiff1d(np.arange(n), chosen), chosen


def predict(
    path: Path, files: Sequence[Path], reject: float | None, as_json: bool
) -> Iterator[str]:
    """A line for each frame: tab-separated below a line of names, or JSON."""
    model, window = load(path)
    videos = [file for file in files if file.suffix.lower() in VIDEO_SUFFIXES]
    images = [file for file in files if file not in videos]
    frames: Iterable[Any] = zip(images, stream_files(images, window), strict=True)
    answers: Iterable[dict[str, Any]] = _answers(model, frames, reject)
    for file in videos:
        from hdc.readers.video import stream_video

        frames = ((f"{file} at {t:.3f} s", frame) for t, frame in stream_video(file, window))
        answers = [*answers, *_answers(model, frames, reject)]  # whole before a line is written
    for number, answer in enumerate(answers):
        if as_json:
            yield json.dumps(answer, ensure_ascii=False)
            continue
        if answer.get("label", "") is None:
            answer["label"] = "(none of these)"
        answer |= answer.pop("distances", {})
        if number == 0:
            yield "\t".join(map(shown, answer))
        yield "\t".join(map(_cell, answer.values()))


def _cell(value: Any) -> str:
    if isinstance(value, float):
        return f"{value:.4f}"
    return "" if value is None else shown(value)


def _answers(
    model: Any, frames: Iterable[tuple[object, np.ndarray]], reject: float | None
) -> Iterator[dict[str, Any]]:
    """File and values of each frame, or its label with margin and distances of prototypes."""
    for some in _batched(frames):
        for place, frame in some:
            _check_size(model, frame.shape, shown(place))
        batch = np.stack([frame for _, frame in some])
        files = [{"file": str(place)} for place, _ in some]
        if not hasattr(model, "classes_"):
            for file, values in zip(
                files, model.predict(batch).reshape(len(batch), -1), strict=True
            ):
                yield file | dict(zip(_value_names(model), values.tolist(), strict=True))
            continue
        labels = model.predict(batch, reject=reject or False).tolist()
        if getattr(model, "readout", "prototype") != "prototype":
            yield from (file | {"label": label} for file, label in zip(files, labels, strict=True))
            continue
        for file, label, distances in zip(files, labels, model.distances(batch), strict=True):
            # D + 1 is the distance of a class without frames.
            known = [None if d > model.dimension_ else d / model.dimension_ for d in distances]
            first, second, *_ = [*sorted(d for d in known if d is not None), None, None]
            margin = None if second is None else second - first
            names = map(str, model.classes_)
            shares = dict(zip(names, known, strict=True))
            yield file | {"label": label, "margin": margin, "distances": shares}


def evaluate(
    path: Path, recording: Path, source: dict[str, Any], reject: float | None, as_json: bool
) -> str:
    """Accuracy and confusions of a model on a recording, or errors of a model of values."""
    model, window = load(path)
    frames = _frames_for(model, window, recording, source)
    result = _score(model, frames, np.arange(len(frames)), reject)
    if as_json:
        result.pop("text")
        return json.dumps(result, ensure_ascii=False)
    return "\n".join([*result["text"], *filter(None, [frames.left_out()])])


def _score(
    model: Any, recording: Recording, index: np.ndarray, reject: float | None = None
) -> dict[str, Any]:
    """Accuracy, confusions and wrong frames (or mean absolute errors), with lines for people."""
    places = [recording.place(i) for i in index]
    frames = with_progress(recording.stream(index), len(index), "Evaluating")
    answers, known = [], []
    for some in _batched(frames):
        batch = np.stack(some)
        answers += model.predict(batch).tolist()
        if reject:
            known += model.is_known(batch, reject).tolist()
    if recording.values is not None and not hasattr(model, "classes_"):
        errors = np.abs(np.array(answers).reshape(len(index), -1) - recording.values[index])
        rows = {
            name: {"mean_absolute_error": float(e.mean()), "median": float(np.median(e)),
                   "largest": float(e.max())}
            for name, e in zip(recording.value_names, errors.T, strict=True)
        }  # fmt: skip
        text = [
            f"{shown(name)}: mean absolute error {row['mean_absolute_error']:.4g}, "
            f"median {row['median']:.4g}, largest {row['largest']:.4g}, {len(index)} frames"
            for name, row in rows.items()
        ]
        return {"frames": len(index), "errors": rows, "text": text}
    names = [str(c) for c in model.classes_]
    row = {name: k for k, name in enumerate(names)}
    truth = [recording.names[i] for i in index]
    predicted, true = (np.array([row[str(x)] for x in some]) for some in (answers, truth))
    counts, share = confusion(predicted, true, len(names)), accuracy(predicted, true)
    right = int(np.trace(counts))
    low, high = wilson(right, len(index))
    text = [
        f"accuracy {share:.1%} (95 % interval {low:.1%} to {high:.1%}), "
        f"{right} of {len(index)} frames",
        *confusions([shown(name) for name in names], counts),
    ]
    wrong = [
        {"file": place, "label": a, "predicted": str(b)}
        for place, a, b in zip(places, truth, answers, strict=True)
        if a != str(b)
    ]
    result = {
        "frames": len(index), "accuracy": share, "interval": [low, high], "classes": names,
        "confusion": counts.tolist(), "wrong": wrong, "text": text,
    }  # fmt: skip
    if reject:
        refused = known.count(False)
        text.insert(1, f"--reject {reject:g} refuses {refused} of them as none of the classes")
        result["refused"] = refused
    return result


def confusions(names: Sequence[str], counts: np.ndarray) -> list[str]:
    """Lines of a table of counts [L, L], a row a true class; of many classes, the confusions."""
    if len(names) > MOST_NAMED:
        off = counts - np.diag(np.diag(counts))
        pairs = sorted(zip(*np.nonzero(off), strict=True), key=lambda pair: -counts[pair])
        return [f"{names[i]} → {names[j]}: {counts[i, j]}" for i, j in pairs]
    heads = [name[:12] for name in names]
    width, cell = max(map(len, names)), max(map(len, [*heads, *map(str, counts.ravel())]))
    lines = ["rows are the true classes, columns the predicted ones"]
    lines.append(" ".join([" " * width, *(f"{head:>{cell}}" for head in heads)]))
    for name, row in zip(names, counts, strict=True):
        lines.append(" ".join([f"{name:{width}}", *(f"{n:>{cell}}" for n in row)]))
    return lines


def recalibrate(
    path: Path,
    recording: Path,
    source: dict[str, Any],
    output: Path,
    p: float,
    method: str,
    seed: int,
) -> str:
    """Recalibrate a model by a recording and save it elsewhere."""
    model, window = load(path)
    if not hasattr(model, "classes_"):
        raise ValueError(f"{shown(path)}: expected a classifier, found {type(model).__name__}")
    frames = _frames_for(model, window, recording, source)
    by_name = {str(c): c for c in model.classes_.tolist()}
    passing = Passing(frames, np.arange(len(frames)))
    model.recalibrate(passing, [by_name[name] for name in frames.names], p, seed, method)
    model.save(output)
    counts = Counter(frames.names)
    lines = [
        f"{shown(output)}: {len(frames)} new frames of {len(counts)} classes, {method}, p = {p:g}"
    ]
    if old := [name for name in by_name if name not in counts]:
        lines.append(f"not recalibrated: {', '.join(map(shown, old))}")
    if few := [name for name, n in counts.items() if n == 1]:
        lines.append(f"recalibrated by a single frame: {', '.join(map(shown, few))}")
    return "\n".join([*lines, *filter(None, [frames.left_out()])])


def info(path: Path, as_json: bool) -> str:
    """Rows on how a model was trained."""
    model, window = load(path)
    rows: dict[str, Any] = {
        "file": f"{shown(path)}, {path.stat().st_size} bytes",
        "kind": type(model).__name__,
        "trained": model.metadata_.get("trained", "at an unknown time"),
        "version": model.metadata_.get("version", "unknown"),
        "frames": _size(model.frame_shape_),
        "crop": "none" if window.crop is None else " ".join(map(str, window.crop)),
        "subsample": window.subsample,
        "read-out": getattr(model, "readout", "prototype"),
    }
    if not hasattr(model, "classes_"):
        return _rows(rows | {"values": ", ".join(_value_names(model))}, as_json)
    counts = zip(model.classes_, model.counts_, strict=True)
    rows["classes"] = {shown(c): int(n) for c, n in counts}
    return _rows(rows, as_json)


def _rows(rows: dict[str, Any], as_json: bool) -> str:
    if as_json:
        return json.dumps(rows, ensure_ascii=False)
    classes = rows.pop("classes", {})
    lines = [f"{name:10}  {value}" for name, value in rows.items()]
    width = max(map(len, classes), default=0)
    lines += [f"{'classes':10}  {len(classes)}"] * bool(classes)
    return "\n".join([*lines, *(f"  {name:{width}}  {n} frames" for name, n in classes.items())])


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
    try:
        crop, subsample = (model.metadata_.get(key) for key in ("crop", "subsample"))
        return model, Window(crop, 1 if subsample is None else subsample)
    except readers.SettingError as error:
        raise ValueError(f"{shown(path)}: in its metadata, {error}") from error


class Passing:
    """Frames [N, H, W] of a recording, decoded as a model takes one batch after the other."""

    def __init__(self, recording: Recording, index: np.ndarray) -> None:
        self._frames = with_progress(recording.stream(index), len(index), "Training")
        self._next = 0
        self.shape = (len(index), *recording.shape)

    def __len__(self) -> int:
        return self.shape[0]

    def __getitem__(self, batch: slice) -> np.ndarray:
        start, stop, _ = batch.indices(len(self))
        if start != self._next:
            raise IndexError(f"expected a batch from frame {self._next}, found {start}")
        self._next = stop
        return np.stack(list(islice(self._frames, stop - start)))


def _frames_for(model: Any, window: Window, recording: Path, source: dict[str, Any]) -> Recording:
    """A recording of classes that the model knows (one of them, or more), or of its values."""
    if source["table"] and not source["columns"] and (names := _value_names(model)):
        source = source | {"columns": names}
    frames = open_frames(recording, window, 1, **source)
    _check_size(model, frames.shape, frames.place(0))
    if not hasattr(model, "classes_"):
        return frames
    known = [str(c) for c in model.classes_]
    if unknown := sorted(set(frames.names) - set(known), key=natural_key):
        raise ValueError(
            f"{shown(recording)}: expected classes among {', '.join(map(shown, known))}, found "
            f"{unknown[0]!r} (to add a class: hdc train on all of them, or partial_fit in Python)"
        )
    return frames


def _value_names(model: Any) -> tuple[str, ...]:
    return () if hasattr(model, "classes_") else tuple(model.metadata_.get("values", ()))


def _check_size(model: Any, shape: tuple[int, ...], place: str) -> None:
    """Raise a BadFrame for a frame of another size than those in training; flat ones have none."""
    expected = model.frame_shape_
    if shape != expected and (len(expected) == 2 or math.prod(shape) != expected[0]):
        raise BadFrame(f"{place}: expected {_size(expected)} as in training, found {_size(shape)}")


def _size(shape: Sequence[int]) -> str:
    return f"{' × '.join(str(side) for side in reversed(shape))} pixels"


def _batched(items: Iterable[T]) -> Iterator[list[T]]:
    waiting = iter(items)
    while some := list(islice(waiting, BATCH)):
        yield some
