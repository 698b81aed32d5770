"""A model's answers for frames, its score on a recording, and both as lines for people."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from hdc import circular, readers
from hdc.accuracy import accuracy, confusion, wilson
from hdc.command.work import check_fits, check_size, printable, value_names, with_units
from hdc.readers import FRAMES, TABLE, VIDEO_SUFFIXES, Recording, Window
from hdc.readers.images import stream_files
from hdc.readers.recording import with_progress

BATCH = 32
"""Frames asked about at a time: meanwhile threads decode the next ones."""
NONE = "(none of these)"
_BY_CLASS = ("distances", "probabilities")
Placed = tuple[object, np.ndarray]
"""A frame, after where it is from."""


class Wanted(NamedTuple):
    """What an answer has besides the label or the values; see :func:`ask`."""

    reject: float | None
    interval: float | None
    proba: bool


def ask(
    model: Any,
    window: Window,
    files: Sequence[Path],
    reject: float | None = None,
    interval: float | None = None,
    proba: bool = False,
    axes: Sequence[str] | None = None,
) -> Iterator[dict[str, Any]]:
    """The model's answers for image files, then for each frame of arrays, tables and videos.

    Each has ``file``, and of a regressor ``values`` by name, or else ``label`` (None: none of
    these). Where classes have prototypes, ``margin`` and ``distances`` by class follow. With an
    `interval`, the share of frames that shall hold the truth, values have ``intervals`` by name
    (an end of None is infinite), and labels the ``set`` of all classes that may be. With `proba`
    the best class has a ``probability``, and ``probabilities`` are those by class. `axes` are those
    of arrays; see :func:`hdc.readers.open_recording`.

    Raises:
        ValueError: `proba` of a regressor, or of a model that has no probabilities.
    """
    wanted = Wanted(reject, interval, proba)
    images = []
    arrays = []
    videos = []
    for file in files:
        suffix = readers.split_name(file)[0].suffix.lower()
        if suffix in VIDEO_SUFFIXES:
            videos.append(file)
        elif suffix in FRAMES:
            arrays.append(file)
        else:
            images.append(file)
    stills = zip(images, stream_files(images, window), strict=True)
    yield from _answers(model, stills, wanted)
    for array in arrays:
        frames = _of_array(model, array, window, axes)
        yield from _answers(model, frames, wanted)
    for video in videos:
        # All before the first is given: at its end a video may turn out to be cut off.
        frames = _of_video(video, window)
        yield from list(_answers(model, frames, wanted))


def _of_array(
    model: Any, path: Path, window: Window, axes: Sequence[str] | None
) -> Iterator[Placed]:
    """Frames of an .npz, an .npy or a .csv, which may have labels and values or not."""
    columns = value_names(model) if path.suffix.lower() == TABLE else ()
    recording = readers.open_recording(
        path, axes=axes, window=window, value_columns=columns, fewest_classes=0
    )
    check_fits(model, recording)
    for i, frame in enumerate(recording.stream()):
        yield recording.place(i), frame


def _of_video(path: Path, window: Window) -> Iterator[Placed]:
    from hdc.readers.video import stream_video  # late: PyAV is of the extra files

    for time, frame in stream_video(path, window):
        yield f"{path} at {time:.3f} s", frame


def _answers(
    model: Any, frames: Iterable[Placed], wanted: Wanted
) -> Iterator[dict[str, Any]]:
    for some in _batched(frames):
        for place, frame in some:
            check_size(model, frame.shape, place)
        batch = np.stack([frame for _, frame in some])
        answers = _of_batch(model, batch, wanted)
        for (place, _), answer in zip(some, answers, strict=True):
            yield {"file": str(place)} | answer


def _of_batch(model: Any, batch: np.ndarray, wanted: Wanted) -> list[dict[str, Any]]:
    """Values of each frame, or its label with what belongs to it."""
    if hasattr(model, "classes_"):
        return _labels_of_batch(model, batch, wanted)
    if wanted.proba:
        raise ValueError(
            f"--proba: expected a model of classes, found {type(model).__name__}"
        )
    return _values_of_batch(model, batch, wanted.interval)


def _labels_of_batch(
    model: Any, batch: np.ndarray, wanted: Wanted
) -> list[dict[str, Any]]:
    """The label of each frame, with margin and distances where classes have prototypes."""
    classes = [str(c) for c in model.classes_]
    labels = model.predict(batch).tolist()
    if wanted.reject:
        known = model.is_known(batch, wanted.reject)
        labels = [
            label if like else None for label, like in zip(labels, known, strict=True)
        ]
    answers: list[dict[str, Any]] = [{"label": label} for label in labels]
    if wanted.interval is not None:
        sets = model.predict_set(batch, outside(wanted.interval))
        for answer, possible in zip(answers, sets, strict=True):
            answer["set"] = possible.tolist()
    if wanted.proba:
        shares = model.predict_proba(batch).tolist()
        for answer, row in zip(answers, shares, strict=True):
            answer["probability"] = max(row)
            answer["probabilities"] = dict(zip(classes, row, strict=True))
    # Imported late: torch takes seconds, and is there by now.
    from hdc.readouts import Majority

    if not isinstance(model.readout_, Majority):
        return answers
    shares = (model.distances(batch) / model.dimension_).tolist()
    for answer, row in zip(answers, shares, strict=True):
        answer["margin"] = _margin(row)
        answer["distances"] = dict(zip(classes, row, strict=True))
    return answers


def _values_of_batch(
    model: Any, batch: np.ndarray, interval: float | None
) -> list[dict[str, Any]]:
    names = value_names(model)
    if interval is None:
        rows = model.predict(batch).reshape(len(batch), -1).tolist()
        return [{"values": dict(zip(names, row, strict=True))} for row in rows]
    found = with_ends(model, batch, interval)
    answers = []
    for row, low, high in zip(*found, strict=True):
        ends = np.stack([low, high], axis=1).tolist()
        pairs = [[_finite(low), _finite(high)] for low, high in ends]
        answers.append(
            {
                "values": dict(zip(names, row.tolist(), strict=True)),
                "intervals": dict(zip(names, pairs, strict=True)),
            }
        )
    return answers


def with_ends(
    model: Any, batch: np.ndarray, interval: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Values of a batch and the ends of their intervals, [Q, T] each."""
    found = model.predict(batch, return_interval=True, alpha=outside(interval))
    values, low, high = (part.reshape(len(batch), -1) for part in found)
    return values, low, high


def outside(interval: float) -> float:
    """The share that may lie outside: 1 − 0.9 is 0.1, not a bit less."""
    return round(1 - interval, 12)


def _finite(end: float) -> float | None:
    return end if np.isfinite(end) else None


def _margin(distances: list[float]) -> float | None:
    """How much farther the second nearest class is; None of one class."""
    if len(distances) < 2:
        return None
    first, second = sorted(distances)[:2]
    return second - first


def heads(model: Any, answer: dict[str, Any]) -> list[str]:
    """Names of the columns of a table of such answers."""
    if "values" in answer:
        names = value_names(model)
        units = model.metadata_.get("units", ())
        columns = ["file", *with_units(names, units)]
        for name in answer.get("intervals", ()):
            columns += [f"{name} from", f"{name} to"]
    else:
        columns = [name for name in answer if name not in _BY_CLASS]
        columns += [f"distance {name}" for name in answer.get("distances", ())]
    return [printable(name) for name in columns]


def cells(answer: dict[str, Any]) -> list[str]:
    """One line of the table."""
    return [_cell(item) for name in answer for item in _items(name, answer[name])]


def _items(name: str, part: Any) -> Iterable[Any]:
    """What the cells of a part of an answer show."""
    if name == "probabilities":  # the table has that of the best class
        return []
    if name in ("values", "distances"):
        return part.values()
    if name == "intervals":
        return itertools.chain.from_iterable(map(_ends, part.values()))
    if name == "set":
        return [", ".join(map(str, part)) or NONE]
    if name == "label" and part is None:
        return [NONE]
    return [part]


def _ends(interval: Sequence[float | None]) -> list[float | str]:
    low, high = interval
    return ["-inf" if low is None else low, "inf" if high is None else high]


def _cell(item: Any) -> str:
    return f"{item:.4f}" if isinstance(item, float) else printable(str(item))


# Scores ------------------------------------------------------------------------------------------


def score(
    model: Any,
    recording: Recording,
    index: np.ndarray,
    reject: float | None = None,
    interval: float | None = None,
) -> dict[str, Any]:
    """Accuracy, confusions and wrong frames (or mean absolute errors), with lines for people.

    With an `interval`, also how often the truth was in the intervals or sets.
    """
    if not hasattr(model, "classes_"):
        return _score_of_values(model, recording, index, interval)
    predicted, known = [], []
    sets: list[np.ndarray] = []
    for batch in _evaluated(recording, index):
        predicted.append(model.predict(batch))
        if reject:
            known.append(model.is_known(batch, reject))
        if interval is not None:
            sets += model.predict_set(batch, outside(interval))
    result = _accuracy(model, recording, np.concatenate(predicted), index)
    if interval is not None:
        truth = np.array(recording.names)[index]
        covered, line = _coverage_of_sets(sets, truth, interval)
        result["coverage"] = covered
        result["text"].insert(1, line)
    if reject:
        refused = int((~np.concatenate(known)).sum())
        line = f"--reject {reject:g} refuses {refused} of them as none of the classes"
        result["refused"] = refused
        result["text"].insert(1, line)
    return result


def _evaluated(recording: Recording, index: np.ndarray) -> Iterator[np.ndarray]:
    """Batches of frames."""
    frames = with_progress(recording.stream(index), len(index), "Evaluating")
    for some in _batched(frames):
        yield np.stack(some)


def _coverage_of_sets(
    sets: Sequence[np.ndarray], truth: np.ndarray, interval: float
) -> tuple[dict[str, Any], str]:
    """How often the right class was in its set, as JSON and as a line."""
    texts = [[str(label) for label in possible] for possible in sets]
    inside = sum(
        name in found for name, found in zip(truth.tolist(), texts, strict=True)
    )
    found = _coverage(inside, len(truth), interval)
    found["mean_size"] = float(np.mean([len(possible) for possible in sets]))
    line = f"{_coverage_line(found, 'sets')}; {found['mean_size']:.2f} classes a set"
    return found, line


def _coverage(inside: int, n: int, asked: float) -> dict[str, Any]:
    low, high = wilson(inside, n)
    return {"asked": asked, "share": inside / n, "interval": [low, high]}


def _coverage_line(found: dict[str, Any], what: str) -> str:
    low, high = found["interval"]
    return (
        f"{what} for {found['asked']:g} hold the truth for {found['share']:.1%} of these frames "
        f"(95 % interval {low:.1%} to {high:.1%})"
    )


def _accuracy(
    model: Any, recording: Recording, predicted: np.ndarray, index: np.ndarray
) -> dict[str, Any]:
    """Accuracy with its interval, confusions, and the frames that are wrong."""
    names = [str(c) for c in model.classes_]
    row = {name: k for k, name in enumerate(names)}
    truth = np.array(recording.names)[index].tolist()
    found = [str(c) for c in predicted]
    true = np.array([row[name] for name in truth])
    read = np.array([row[name] for name in found])
    counts = confusion(read, true, len(names))
    right = int((read == true).sum())
    share = accuracy(read, true)
    low, high = wilson(right, len(index))
    wrong = [
        {"file": recording.place(i), "label": a, "predicted": b}
        for i, a, b in zip(index, truth, found, strict=True)
        if a != b
    ]
    interval = f"95 % interval {low:.1%} to {high:.1%}"
    line = f"accuracy {share:.1%} ({interval}), {right} of {len(index)} frames"
    return {
        "frames": len(index),
        "accuracy": share,
        "interval": [low, high],
        "classes": names,
        "confusion": counts.tolist(),
        "wrong": wrong,
        "text": [line, *confusions(names, counts)],
    }


def _score_of_values(
    model: Any, recording: Recording, index: np.ndarray, interval: float | None
) -> dict[str, Any]:
    """Mean absolute error of each value; coverage and width of its intervals, if asked for."""
    if recording.values is None:
        raise ValueError(
            "--values: expected a table of the numbers to compare with, found none"
        )
    parts: list[tuple[np.ndarray, ...]] = []
    for batch in _evaluated(recording, index):
        if interval is None:
            parts.append((model.predict(batch).reshape(len(batch), -1),))
        else:
            parts.append(with_ends(model, batch, interval))
    predicted, *ends = (np.concatenate(part) for part in zip(*parts, strict=True))
    truth = recording.values[index]
    means = circular.errors(predicted, truth, model.period).mean(axis=0).tolist()
    units = recording.value_units or ("",) * len(means)
    rows: dict[str, Any] = {}
    text = []
    for name, unit, mean in zip(recording.value_names, units, means, strict=True):
        rows[name] = {"mean_absolute_error": mean}
        if unit:
            rows[name]["unit"] = unit
        amount = f"{mean:.4g} {unit}".rstrip()
        text.append(f"{name}: mean absolute error {amount}, {len(index)} frames")
    if interval is not None:
        low, high = ends
        inside = ((low <= truth) & (truth <= high)).sum(axis=0).tolist()
        widths = (high - low).mean(axis=0).tolist()
        for k, (name, unit) in enumerate(zip(rows, units, strict=True)):
            covered = _coverage(inside[k], len(index), interval)
            width = f"{widths[k]:.4g} {unit}".rstrip()
            line = _coverage_line(covered, "intervals")
            text.append(f"{name}: {line}; mean width {width}")
            covered["mean_width"] = _finite(widths[k])
            rows[name]["coverage"] = covered
    return {"frames": len(index), "errors": rows, "text": text}


def confusions(names: Sequence[str], counts: np.ndarray) -> list[str]:
    """Lines of a table of counts [L, L], a row a true class."""
    names = [printable(name) for name in names]
    heads = [name[:12] for name in names]
    numbers = [str(n) for n in counts.ravel()]
    width = max(len(name) for name in names)
    cell = max(len(text) for text in [*heads, *numbers])
    lines = ["rows are the true classes, columns the predicted ones"]
    lines.append(" ".join([" " * width, *(f"{head:>{cell}}" for head in heads)]))
    for name, row in zip(names, counts, strict=True):
        lines.append(" ".join([f"{name:{width}}", *(f"{n:>{cell}}" for n in row)]))
    return lines


def _batched(items: Iterable[Any]) -> Iterator[list[Any]]:
    waiting = iter(items)
    while some := list(itertools.islice(waiting, BATCH)):
        yield some
