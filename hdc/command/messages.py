"""Lines that the commands print of a recording and of a model."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from hdc.readers import Recording, natural_key

TURN = 360
"""Degrees; values that span this share of them look like angles of a whole turn."""
_WHOLE = 0.9
_DEGREES = re.compile(r"deg|angle|°|theta|yaw|rotation|azimuth|orientation")
_MARKUP = re.compile(r"(?::\w+:)?`+~?([^`]*)`+")
"""A name in a docstring, as Sphinx marks it."""
LISTED = 12
"""Names of classes or sessions that one line shows."""


def class_line(recording: Recording, index: np.ndarray) -> str:
    """The classes of some frames, and how many each has."""
    names = np.array(recording.names)[index].tolist()
    return f"classes: {_counted(names, recording.classes)}"


def circular_lines(recording: Recording, period: float | None = None) -> list[str]:
    """A line on each value that looks like degrees of a whole turn, unless a period is given."""
    lines: list[str] = []
    if period is not None:
        return lines
    units = recording.value_units or ("",) * len(recording.value_names)
    for column, name in enumerate(recording.value_names):
        assert recording.values is not None
        numbers = recording.values[:, column]
        low, high = float(numbers.min()), float(numbers.max())
        named = _DEGREES.search(f"{name} {units[column]}".lower())
        turns = low >= -TURN / 2 and high <= TURN and high - low >= _WHOLE * TURN
        if named and turns:
            lines.append(
                f"{printable(name)}: {low:.4g} to {high:.4g} looks like angles of a whole turn; "
                "--circular 360 predicts them by sine and cosine"
            )
    return lines


def whole(recording: Recording) -> str:
    """What a recording has to learn, and the size of its frames."""
    return f"{learnt(recording)}, {size(recording.frame_shape)}"


def learnt(recording: Recording) -> str:
    """Content of a recording that a model learns, in words."""
    if recording.values is None:
        return f"{len(recording.classes)} classes"
    names = with_units(recording.value_names, recording.value_units)
    return f"values of {', '.join(names)}"


def reading_line(recording: Recording) -> list[str]:
    """How the file was read, where it could be read otherwise; or nothing."""
    return [f"read: {'; '.join(recording.notes)}"] if recording.notes else []


def session_line(recording: Recording) -> str:
    """The sessions of a recording, and how many frames each has."""
    if recording.session is None:
        return "sessions: none known"
    names = recording.samples.get("session_name", recording.session)
    texts = [str(name) for name in names.tolist()]
    return f"sessions: {_counted(texts, sorted(set(texts), key=natural_key))}"


def _counted(names: Sequence[str], different: Sequence[str]) -> str:
    counts = Counter(names)
    shown = [f"{printable(name)} ({counts[name]})" for name in different[:LISTED]]
    if len(different) > LISTED:
        shown.append(f"… {len(different)} in all")
    return ", ".join(shown)


def printable(text: str) -> str:
    """A name on one line of a table: tabs, line feeds and the like are written as escapes."""
    return "".join(c if c.isprintable() else repr(c)[1:-1] for c in text)


def size(shape: Sequence[int]) -> str:
    """The size of a frame in words, width first."""
    return f"{' × '.join(str(side) for side in reversed(shape))} pixels"


def with_units(names: Sequence[str], units: Sequence[str]) -> list[str]:
    """Names of values, with the unit in brackets where there is one."""
    if not any(units):
        return list(names)
    pairs = zip(names, units, strict=True)
    return [f"{name} [{unit}]" if unit else name for name, unit in pairs]


def described(model: Any, path: Path) -> dict[str, Any]:
    """Description of a saved model; the last rows say what was trained."""
    classifies = hasattr(model, "classes_")
    n_outputs = len(model.classes_ if classifies else model.mean_)
    n_file = path.stat().st_size
    n_used = n_file  # of numbers: the training frames are kept, and all of it is needed
    if classifies:
        n_used = model.prediction_bytes_
    unit = "class" if classifies else "value"
    rows: dict[str, Any] = {
        "kind": type(model).__name__,
        "encoder": repr(model.encoder_),
        "encoder in words": _in_words(model.encoder_),
        "readout": repr(model.readout_),
        "readout in words": _in_words(model.readout_),
        "frames": size(model.frame_shape_),
        f"bits per pixel and {unit}": round(
            8 * n_used / model.n_features_in_ / n_outputs, 2
        ),
        "bytes to predict": n_used,
        "bytes of the file": n_file,
        **model.metadata_,
    }
    if classifies:
        counts = zip(model.classes_, model.counts_, strict=True)
        rows["classes"] = {str(c): int(n) for c, n in counts}
    return rows


def _in_words(part: object) -> str:
    """The first paragraph of what a part of a model says of itself."""
    text = type(part).__doc__ or ""
    first = " ".join(text.strip().partition("\n\n")[0].split())
    return _MARKUP.sub(r"\1", first)
