"""A model's answers for frames, and the table that shows them."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from hdc import readers
from hdc.command.messages import printable, with_units
from hdc.command.work import check_fits, check_size, value_names
from hdc.readers import VECTORS, VIDEO, Window, kind_of
from hdc.readers.images import stream_files
from hdc.readers.known import numbered

BATCH = 32
"""Frames asked about at a time: meanwhile threads decode the next ones."""
NONE = "(none of these)"
_BY_CLASS = ("distances", "probabilities")
Placed = tuple[object, np.ndarray]
"""A frame, after where it is from."""


class Wanted(NamedTuple):
    """Fields of an answer besides the label or the values; see :func:`ask`."""

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
    image_column: str = "image",
) -> Iterator[dict[str, Any]]:
    """The model's answers for image files, then for each frame of arrays, tables and videos.

    Each has ``file``, and of a regressor ``values`` by name, or else ``label`` (None: none of
    these). Where classes have prototypes, ``margin`` and ``distances`` by class follow. With an
    `interval`, the share of frames that shall hold the truth, values have ``intervals`` by name
    (an end of None is infinite), and labels the ``set`` of all classes that may be. With `proba`
    the best class has a ``probability``, and ``probabilities`` are those by class. `axes` are those
    of arrays, and `image_column` is that of a .parquet; see :func:`hdc.readers.open_recording`.

    Raises:
        ValueError: `proba` of a regressor, or of a model that has no probabilities.
    """
    wanted = Wanted(reject, interval, proba)
    kinds = {file: kind_of(readers.split_name(file)[0]) for file in files}
    images = [file for file in files if not kinds[file]]
    stills = zip(images, stream_files(images, window), strict=True)
    yield from _answers(model, stills, wanted)
    for array in [f for f in files if kinds[f] not in ("", VIDEO)]:
        frames = _of_array(model, array, window, axes, image_column)
        yield from _answers(model, frames, wanted)
    for video in [f for f in files if kinds[f] == VIDEO]:
        # All before the first is given: at its end a video may turn out to be cut off.
        frames = _of_video(video, window)
        yield from list(_answers(model, frames, wanted))


def _of_array(
    model: Any,
    path: Path,
    window: Window,
    axes: Sequence[str] | None,
    image_column: str,
) -> Iterator[Placed]:
    """Frames of a file of arrays or a table, which may have labels and values or not."""
    columns = value_names(model) if kind_of(path) == VECTORS else ()
    recording = readers.open_recording(
        path,
        axes=axes,
        image_column=image_column,
        value_columns=columns,
        window=window,
        fewest_classes=0,
    )
    check_fits(model, recording)
    for i, frame in enumerate(recording.stream()):
        yield recording.place(i), frame


def _of_video(path: Path, window: Window) -> Iterator[Placed]:
    from hdc.readers.film import stream_video  # late: PyAV is of the extra files

    for time, frame in stream_video(path, window):
        yield f"{path} at {time:.3f} s", frame


def _answers(
    model: Any, frames: Iterable[Placed], wanted: Wanted
) -> Iterator[dict[str, Any]]:
    for some in batched(frames):
        for place, frame in some:
            check_size(model, frame.shape, place)
        batch = np.stack([frame for _, frame in some])
        answers = _of_batch(model, batch, wanted)
        for (place, _), answer in zip(some, answers, strict=True):
            yield {"file": str(place)} | answer


def _of_batch(model: Any, batch: np.ndarray, wanted: Wanted) -> list[dict[str, Any]]:
    """Values of each frame, or its label, with what belongs to it."""
    if hasattr(model, "classes_"):
        columns = _label_columns(model, batch, wanted)
    elif wanted.proba:
        found = type(model).__name__
        raise ValueError(f"--proba: expected a model of classes, found {found}")
    else:
        columns = _value_columns(model, batch, wanted.interval)
    rows = zip(*columns.values(), strict=True)
    return [dict(zip(columns, row, strict=True)) for row in rows]


def _label_columns(
    model: Any, batch: np.ndarray, wanted: Wanted
) -> dict[str, Sequence[Any]]:
    """Labels; margins and distances where classes have prototypes; and what is wanted."""
    labels = model.predict(batch).tolist()
    if wanted.reject:
        known = model.is_known(batch, wanted.reject)
        pairs = zip(labels, known, strict=True)
        labels = [label if like else None for label, like in pairs]
    columns: dict[str, Sequence[Any]] = {"label": labels}
    if wanted.interval is not None:
        sets = model.predict_set(batch, outside(wanted.interval))
        columns["set"] = [possible.tolist() for possible in sets]
    if wanted.proba:
        shares = model.predict_proba(batch)
        columns["probability"] = shares.max(1).tolist()
        columns["probabilities"] = _by_name(model.classes_, shares)
    from hdc.readouts import Majority  # late: torch takes seconds, and is there by now

    if isinstance(model.readout_, Majority):
        shares = model.distances(batch) / model.dimension_
        columns["margin"] = [_margin(row) for row in shares.tolist()]
        columns["distances"] = _by_name(model.classes_, shares)
    return columns


def _value_columns(
    model: Any, batch: np.ndarray, interval: float | None
) -> dict[str, Sequence[Any]]:
    """Values by name, and the ends of their intervals if there is a share to hold."""
    names = value_names(model) or numbered(len(model.mean_))
    if interval is None:
        values = model.predict(batch).reshape(len(batch), -1)
        return {"values": _by_name(names, values)}
    values, low, high = with_ends(model, batch, interval)
    ends = np.stack([low, high], axis=2).astype(object)
    ends[np.isinf(ends.astype(float))] = None
    return {"values": _by_name(names, values), "intervals": _by_name(names, ends)}


def _by_name(names: Iterable[Any], rows: np.ndarray) -> list[dict[str, Any]]:
    """Rows [N, k, …] as a dictionary each."""
    keys = [str(name) for name in names]
    return [dict(zip(keys, row, strict=True)) for row in rows.tolist()]


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


def _margin(distances: list[float]) -> float | None:
    """How much farther the second nearest class is; None of one class."""
    if len(distances) < 2:
        return None
    first, second = sorted(distances)[:2]
    return second - first


def heads(model: Any, answer: dict[str, Any]) -> list[str]:
    """Names of the columns of a table of such answers."""
    if "values" in answer:
        units = model.metadata_.get("units", ())
        columns = ["file", *with_units(list(answer["values"]), units)]
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
    """Text of the cells of a part of an answer."""
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


def batched(items: Iterable[Any]) -> Iterator[list[Any]]:
    """Lists of so many at a time."""
    waiting = iter(items)
    while some := list(itertools.islice(waiting, BATCH)):
        yield some
