"""What the commands do: frames from readers, chunk by chunk, into a classifier."""

from __future__ import annotations

import json
import time
from collections.abc import Iterable, Iterator, Sequence
from itertools import chain, islice
from pathlib import Path
from typing import TypeVar

import numpy as np

from hdc import HDCClassifier, bits, readers
from hdc.command.accuracy import accuracy, confusions
from hdc.readers import BadFrame, Stream, Window
from hdc.readers.files import shown
from hdc.readers.images import stream_files
from hdc.readers.recording import with_progress

T = TypeVar("T")

CHUNK = 32
"""Frames learnt or asked about at a time: while they are, threads decode the next ones."""


def train(
    stream: Stream, window: Window, output: Path, test_fraction: float | None, seed: int
) -> str:
    """Train on a recording and save the model; what came of it, in words."""
    begin = time.perf_counter()
    classes = sorted(set(stream.labels), key=readers.natural_key)
    training, test = split(stream.labels, test_fraction, seed)
    chunks = _labelled(stream, training, "Training")
    first = next(chunks)  # tells how many pixels there will be, which decides what is worth it
    backend = bits.choose_backend("auto", "cpu", len(training) * first[0][0].size)
    model = HDCClassifier(backend=backend)
    model.partial_fit(chain([first], chunks), classes=classes)
    seconds = time.perf_counter() - begin
    model.save(output, metadata={"crop": window.crop, "subsample": window.subsample})
    said = [
        f"{shown(output)}: {len(training)} frames of {len(classes)} classes, "
        f"{_size(model.frame_shape_)}, in {seconds:.1f} s ({len(training) / seconds:.0f} a second)"
    ]
    if len(test):
        _, confusion = _confusion(model, stream, test)
        said.append("held out: " + accuracy(confusion))
    return "\n".join(said)


def split(
    labels: Sequence[str], fraction: float | None, seed: int
) -> tuple[np.ndarray, np.ndarray]:
    """Indices to train on and to hold out, increasing; of each class the same share, at random.

    Raises:
        ValueError: for a class of one frame.
    """
    every = np.arange(len(labels))
    if fraction is None:
        return every, every[:0]
    rng = np.random.default_rng(seed)
    test = []
    for name in sorted(set(labels)):
        members = np.flatnonzero(np.array(labels) == name)
        if len(members) < 2:
            raise ValueError(f"class {name!r}: expected two frames or more to hold out, found one")
        held = min(max(1, round(len(members) * fraction)), len(members) - 1)
        test.append(rng.permutation(members)[:held])
    chosen = np.sort(np.concatenate(test))
    return np.setdiff1d(every, chosen), chosen


def predict(
    path: Path, files: Sequence[Path], reject: float | None, as_json: bool
) -> Iterator[str]:
    """A line for each image file: tab-separated below a line of names, or JSON."""
    model, window = load(path)
    if not as_json:
        yield "\t".join(["file", "label", "margin", *(shown(c) for c in model.classes_)])
    frames = stream_files(files, readers.Options(window))
    for some in _batched(zip(files, frames, strict=True)):
        chunk = np.stack([_fitting(model, frame, shown(file)) for file, frame in some])
        labels = model.predict(chunk, reject=reject or False).tolist()
        shares = model.distances(chunk) / model.dimension_
        for (file, _), label, distances in zip(some, labels, shares, strict=True):
            known = [None if d > 1 else float(d) for d in distances]  # of a class without samples
            first, second, *_ = [*sorted(d for d in known if d is not None), np.nan]
            margin = None if np.isnan(second) else second - first
            if as_json:
                by_class = dict(zip(map(str, model.classes_), known, strict=True))
                answer = {"file": str(file), "label": label, "margin": margin}
                yield json.dumps(answer | {"distances": by_class}, ensure_ascii=False)
            else:
                text = "(none of these)" if label is None else shown(label)
                numbers = ("" if x is None else f"{x:.4f}" for x in (margin, *known))
                yield "\t".join([shown(file), text, *numbers])


def evaluate(path: Path, recording: Path, intervals: Path | None) -> str:
    """Accuracy and confusions of a model on a recording, in words."""
    model, window = load(path)
    stream = _stream_for(model, window, recording, intervals)
    names, confusion = _confusion(model, stream, np.arange(len(stream.labels)))
    return accuracy(confusion) + "\n" + "\n".join(confusions(names, confusion))


def recalibrate(
    path: Path,
    recording: Path,
    intervals: Path | None,
    output: Path,
    p: float,
    method: str,
    seed: int,
) -> str:
    """Recalibrate a model by a recording and save it elsewhere; what was done, in words."""
    model, window = load(path)
    stream = _stream_for(model, window, recording, intervals)
    by_name = {str(c): c for c in model.classes_.tolist()}
    every = np.arange(len(stream.labels))
    frames = Passing(_frames(model, stream, every, "Recalibrating"), len(every), model.frame_shape_)
    model.recalibrate(frames, [by_name[name] for name in stream.labels], p, seed, method)
    model.save(output)
    n = len(set(stream.labels))
    return f"{shown(output)}: {len(every)} new frames of {n} classes, {method}, p = {p:g}"


def info(path: Path) -> str:
    """What a model was trained on, in words."""
    model, window = load(path)
    lines = [
        f"{shown(path)}: {path.stat().st_size} bytes",
        f"frames      {_size(model.frame_shape_)}",
        f"crop        {'none' if window.crop is None else ' '.join(map(str, window.crop))}",
        f"subsample   {window.subsample}",
        f"prototypes  {model.prototype}, ties {model.ties}",
        f"classes     {len(model.classes_)}",
    ]
    width = max(len(shown(c)) for c in model.classes_)
    counts = zip(model.classes_, model.counts_, strict=True)
    return "\n".join([*lines, *(f"  {shown(c):{width}}  {n} frames" for c, n in counts)])


def load(path: Path) -> tuple[HDCClassifier, Window]:
    """A saved model, and which pixels of an image it looks at.

    Raises:
        ValueError: the file is no such model.
    """
    model = HDCClassifier.load(path)
    try:
        crop, subsample = (model.metadata_.get(key) for key in ("crop", "subsample"))
        return model, Window(crop, 1 if subsample is None else subsample)
    except readers.SettingError as error:
        raise ValueError(f"{shown(path)}: in its metadata, {error}") from error


class Passing:
    """Frames that come by once, as what a classifier takes batches of, one after the other."""

    def __init__(self, frames: Iterator[np.ndarray], n: int, frame_shape: tuple[int, ...]) -> None:
        self._frames, self._next = frames, 0
        self.shape = (n, *frame_shape)

    def __len__(self) -> int:
        return self.shape[0]

    def __getitem__(self, batch: slice) -> np.ndarray:
        start, stop, _ = batch.indices(len(self))
        if start != self._next:
            raise IndexError(f"expected a batch from frame {self._next}, found {start}")
        self._next = stop
        return np.stack([next(self._frames) for _ in range(start, stop)])


# Frames -------------------------------------------------------------------------------------------


def _stream_for(
    model: HDCClassifier, window: Window, recording: Path, intervals: Path | None
) -> Stream:
    """A recording of classes that the model knows; of one of them, or more."""
    stream = readers.open_stream(recording, intervals, readers.Options(window, fewest_classes=1))
    known = [str(c) for c in model.classes_]
    if unknown := sorted(set(stream.labels) - set(known), key=readers.natural_key):
        raise ValueError(
            f"{shown(recording)}: expected classes among {', '.join(map(shown, known))}, "
            f"found {unknown[0]!r}"
        )
    return stream


def _labelled(
    stream: Stream, index: np.ndarray, what: str
) -> Iterator[tuple[np.ndarray, list[str]]]:
    """Chunks of frames and their labels."""
    frames = with_progress(stream.each(index), len(index), what)
    for some in _batched(zip(index, frames, strict=True)):
        yield np.stack([frame for _, frame in some]), [stream.labels[i] for i, _ in some]


def _frames(
    model: HDCClassifier, stream: Stream, index: np.ndarray, what: str
) -> Iterator[np.ndarray]:
    for i, frame in zip(index, with_progress(stream.each(index), len(index), what), strict=True):
        yield _fitting(model, frame, stream.place(i))


def _fitting(model: HDCClassifier, frame: np.ndarray, place: str) -> np.ndarray:
    """A frame in the shape that the model knows; raises a BadFrame if it is of another size."""
    expected = model.frame_shape_
    if frame.shape != expected and (len(expected) == 2 or frame.size != expected[0]):
        raise BadFrame(
            f"{place}: expected {_size(expected)} as in training, found {_size(frame.shape)}"
        )
    return frame.reshape(expected)


def _confusion(
    model: HDCClassifier, stream: Stream, index: np.ndarray
) -> tuple[list[str], np.ndarray]:
    """Names of the classes, and how often each [L] was predicted as each [L]."""
    names = [shown(c) for c in model.classes_]
    row = {str(c): k for k, c in enumerate(model.classes_)}
    counts = np.zeros((len(names), len(names)), np.int64)
    frames = _frames(model, stream, index, "Evaluating")
    for some in _batched(zip(index, frames, strict=True)):
        predicted = model.predict(np.stack([frame for _, frame in some]))
        for (i, _), label in zip(some, predicted, strict=True):
            counts[row[stream.labels[i]], row[str(label)]] += 1
    return names, counts


def _size(shape: Sequence[int]) -> str:
    return f"{' × '.join(str(side) for side in reversed(shape))} pixels"


def _batched(items: Iterable[T]) -> Iterator[list[T]]:
    waiting = iter(items)
    while some := list(islice(waiting, CHUNK)):
        yield some
