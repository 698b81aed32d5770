"""A model's answers for frames: columns of a batch, of which rows and scores are made."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from hdc import readers
from hdc.command import printable
from hdc.command.work import check_fits, check_size, value_names
from hdc.readers import VECTORS, VIDEO, Window, kind_of
from hdc.readers.about import numbered
from hdc.readers.images import stream_files

BATCH = 32
"""Frames asked about at a time: meanwhile threads decode the next ones."""
NONE = "(none of these)"
Placed = tuple[object, np.ndarray]
"""A frame, after where it is from."""


class Wanted(NamedTuple):
    """Parts of an answer besides the label or the values.

    Attributes:
        reject: share of known frames that may be refused as none of the classes.
        interval: share of frames of which sets or intervals are to hold the truth.
        proba: whether probabilities of the classes are wanted.
    """

    reject: float | None = None
    interval: float | None = None
    proba: bool = False

    @property
    def alpha(self) -> float | None:
        """Share of frames of which they may miss the truth: 1 − 0.9 is 0.1, not a bit less."""
        return None if self.interval is None else round(1 - self.interval, 12)


def columns(model: Any, frames: np.ndarray, wanted: Wanted) -> dict[str, Any]:
    """The answers for frames [n, …] by name; each frame is encoded once.

    A classifier gives ``label`` [n], and where they are wanted ``known`` [n], ``set`` (a list of n
    lists), ``probability`` of the best class [n] and ``probabilities`` [n, L], and where there are
    prototypes ``distances`` [n, L] as shares of the bits. A regressor gives ``values`` [n, T], and
    ``intervals`` [n, T, 2] where they are wanted.

    Raises:
        ValueError: probabilities or rejection by a regressor, or by a model that has none.
    """
    words = model.encode(frames)
    if hasattr(model, "classes_"):
        return _of_classes(model, words, wanted)
    return _of_values(model, words, wanted)


def _of_classes(model: Any, words: Any, wanted: Wanted) -> dict[str, Any]:
    found = {"label": model.predict(words)}
    if wanted.reject:
        found["known"] = model.is_known(words, wanted.reject)
    if wanted.alpha is not None:
        sets = model.predict_set(words, wanted.alpha)
        found["set"] = [labels.tolist() for labels in sets]
    if wanted.proba:
        found["probabilities"] = model.predict_proba(words)
        found["probability"] = found["probabilities"].max(axis=1)
    if hasattr(model, "distances"):
        found["distances"] = model.distances(words) / model.dimension_
    return found


def _of_values(model: Any, words: Any, wanted: Wanted) -> dict[str, Any]:
    for option, given in (("--proba", wanted.proba), ("--reject", wanted.reject)):
        if given:
            found = type(model).__name__
            raise ValueError(f"{option}: expected a model of classes, found {found}")
    if wanted.alpha is None:
        return {"values": model.predict(words).reshape(len(words), -1)}
    parts = model.predict(words, return_interval=True, alpha=wanted.alpha)
    values, *ends = (part.reshape(len(words), -1) for part in parts)
    return {"values": values, "intervals": np.stack(ends, axis=2)}


def batched(items: Iterable[Any]) -> Iterator[list[Any]]:
    """Lists of so many at a time."""
    waiting = iter(items)
    while some := list(itertools.islice(waiting, BATCH)):
        yield some


# Rows --------------------------------------------------------------------------------------------


def ask(
    model: Any,
    window: Window,
    files: Sequence[Path],
    wanted: Wanted,
    settings: Mapping[str, Any],
) -> Iterator[dict[str, Any]]:
    """The model's answers for image files, and for each frame of arrays, tables and videos.

    Each has ``file``, and of a regressor ``values`` by name, or else ``label`` (None: none of
    these). Where classes have prototypes, ``distances`` by class follow, as shares of the bits.
    With an interval, values have ``intervals`` by name (an end of None is infinite), and labels the
    ``set`` of all classes that may be. With probabilities the best class has a
    ``probability``, and every class has one in ``probabilities``. The `settings` are ``template``,
    ``axes`` and ``image_column`` of :func:`hdc.readers.open_recording`.

    Raises:
        ValueError: a template or axes where all files are images and videos, a file cannot be read,
            or its frames do not fit the model.
    """
    for name in ("template", "axes"):
        if settings.get(name) and all(_kind(file) in ("", VIDEO) for file in files):
            expected = "expected a folder or a file of arrays"
            raise ValueError(f"--{name}: {expected}, found {files[0]}")
    for kind, alike in itertools.groupby(files, _kind):
        for placed in _sources(model, kind, [*alike], window, settings):
            yield from _rows(model, placed, wanted)


def _kind(file: Path) -> str:
    """The kind of recording that holds frames; empty for an image."""
    return kind_of(readers.split_name(file)[0])


def _sources(
    model: Any,
    kind: str,
    files: Sequence[Path],
    window: Window,
    settings: Mapping[str, Any],
) -> Iterable[Iterable[Placed]]:
    """Frames of files of one kind; images are decoded ahead, one file after the other."""
    if not kind:
        return [zip(files, stream_files(files, window), strict=True)]
    if kind == VIDEO:
        return (_of_video(file, window) for file in files)
    return (_recorded(model, file, window, settings) for file in files)


def _recorded(
    model: Any, path: Path, window: Window, settings: Mapping[str, Any]
) -> Iterator[Placed]:
    """Frames of a recording, which may have labels and values or not."""
    recording = readers.open_recording(
        path,
        value_columns=value_names(model) if kind_of(path) == VECTORS else (),
        window=window,
        check=False,
        fewest_classes=0,
        **settings,
    )
    check_fits(model, recording)
    for i, frame in enumerate(recording.stream()):
        yield recording.place(i), frame


def _of_video(path: Path, window: Window) -> Iterator[Placed]:
    from hdc.readers.film import stream_video  # late: PyAV is of the extra files

    for time, frame in stream_video(path, window):
        yield f"{path} at {time:.3f} s", frame


def _rows(
    model: Any, frames: Iterable[Placed], wanted: Wanted
) -> Iterator[dict[str, Any]]:
    for some in batched(frames):
        for place, frame in some:
            check_size(model, frame.shape, place)
        found = columns(model, np.stack([frame for _, frame in some]), wanted)
        names: Sequence[str] = [str(label) for label in getattr(model, "classes_", ())]
        if "values" in found:
            names = value_names(model) or numbered(found["values"].shape[1])
        for k, (place, _) in enumerate(some):
            row = {name: _own(column[k], names) for name, column in found.items()}
            if not row.pop("known", True):
                row["label"] = None
            yield {"file": str(place), **row}


def _own(item: Any, names: Sequence[str]) -> Any:
    """An item of a column as JSON, by name where there is one for each class or value."""
    if isinstance(item, list):
        return item
    if item.ndim == 2:  # of intervals; JSON has no infinite numbers
        item = np.where(np.isfinite(item), item, None)
    own = item.tolist()
    return dict(zip(names, own, strict=True)) if item.ndim else own


def table_row(answer: Mapping[str, Any]) -> dict[str, str]:
    """The cells of an answer's line in a table, by the heads of their columns."""
    cells: dict[str, Any] = {}
    for name, part in answer.items():
        if name == "probabilities":  # the table has that of the best class
            continue
        if isinstance(part, dict):
            cells |= {f"{name} {key}": own for key, own in part.items()}
        else:
            cells[name] = NONE if part is None and name == "label" else part
    return {printable(name): _cell(cell) for name, cell in cells.items()}


def _cell(item: Any) -> str:
    if isinstance(item, list):
        return ", ".join(map(_cell, item)) or NONE
    if item is None:  # an infinite end of an interval
        return "-"
    return f"{item:.4f}" if isinstance(item, float) else printable(str(item))
