"""How well a model does on a recording, in numbers; :mod:`hdc.command.messages` says them."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import chain
from typing import Any

import numpy as np

from hdc import circular
from hdc.accuracy import accuracy, confusion, r_squared, wilson
from hdc.command.answers import Wanted, batched, columns
from hdc.readers import Recording
from hdc.readers.recording import with_progress


def score(
    model: Any,
    recording: Recording,
    index: np.ndarray,
    reject: float | None = None,
    interval: float | None = None,
) -> dict[str, Any]:
    """Accuracy, confusions and wrong frames, or errors of values, of the frames `index`.

    With a share to `reject` also how many frames were refused, and with an `interval` how often
    the truth was in the intervals or sets.
    """
    wanted = Wanted(reject, interval, distances=False)
    frames = with_progress(recording.stream(index), len(index), "Evaluating")
    parts = [columns(model, np.stack(some), wanted) for some in batched(frames)]
    found = {name: [*chain(*(part[name] for part in parts))] for name in parts[0]}
    of = _of_classes if hasattr(model, "classes_") else _of_values
    return {"frames": len(index), **of(model, recording, index, found, wanted)}


def _of_classes(
    model: Any,
    recording: Recording,
    index: np.ndarray,
    found: Mapping[str, Any],
    wanted: Wanted,
) -> dict[str, Any]:
    """Accuracy with its interval and that of a guess, confusions, and the frames that are wrong."""
    names = [str(label) for label in model.classes_]
    row = {name: k for k, name in enumerate(names)}
    truth = np.array([row[name] for name in np.array(recording.names)[index].tolist()])
    answers = np.array([row[str(label)] for label in found["label"]])
    largest = int(model.counts_.argmax())
    wrong = np.flatnonzero(answers != truth)
    result: dict[str, Any] = {
        "accuracy": accuracy(answers, truth),
        "interval": [*wilson(len(index) - len(wrong), len(index))],
        "guessed": names[largest],
        "guess": float((truth == largest).mean()),
        "classes": names,
        "confusion": confusion(answers, truth, len(names)).tolist(),
        "wrong": [
            {
                "file": recording.place(index[k]),
                "label": names[truth[k]],
                "predicted": names[answers[k]],
            }
            for k in wrong
        ],
    }
    if wanted.reject:
        result |= {"reject": wanted.reject, "refused": found["known"].count(False)}
    if wanted.interval is not None:
        sets = [[str(label) for label in own] for own in found["set"]]
        inside = [names[k] in own for k, own in zip(truth, sets, strict=True)]
        size = float(np.mean([len(own) for own in sets]))
        result["coverage"] = _coverage(inside, wanted.interval) | {"mean_size": size}
    return result


def _of_values(
    model: Any,
    recording: Recording,
    index: np.ndarray,
    found: Mapping[str, Any],
    wanted: Wanted,
) -> dict[str, Any]:
    """Errors and R² of each value; coverage and width of its intervals, if asked for."""
    assert recording.values is not None
    truth = recording.values[index]
    arrays = {name: np.array(rows) for name, rows in found.items()}
    period = model.period
    errors = circular.errors(arrays["values"], truth, period).mean(axis=0)
    guesses = circular.errors(truth, model.mean_, period).mean(axis=0)
    rows: dict[str, Any] = {}
    for k, name in enumerate(recording.value_names):
        rows[name] = {
            "mean_absolute_error": float(errors[k]),
            "guess": float(guesses[k]),
            "r_squared": _explained(truth[:, k], arrays["values"][:, k], period),
        }
        if any(recording.value_units[k : k + 1]):
            rows[name]["unit"] = recording.value_units[k]
        if wanted.interval is not None:
            low, high = arrays["low"][:, k], arrays["high"][:, k]
            inside = (low <= truth[:, k]) & (truth[:, k] <= high)
            width = float((high - low).mean())
            width_or_none = width if np.isfinite(width) else None
            coverage = _coverage(inside, wanted.interval)
            rows[name]["coverage"] = coverage | {"mean_width": width_or_none}
    return {"errors": rows}


def _coverage(inside: Any, asked: float) -> dict[str, Any]:
    share = float(np.mean(inside))
    interval = [*wilson(int(np.sum(inside)), len(inside))]
    return {"asked": asked, "share": share, "interval": interval}


def _explained(truth: np.ndarray, predicted: np.ndarray, period: float | None) -> float:
    """R² of one value [N]; of a circular one the mean of those of cosine and sine."""
    pairs = [(truth, predicted)]
    if period is not None:
        planes = [circular.to_plane(v[:, None], period) for v in (truth, predicted)]
        pairs = list(zip(planes[0].T, planes[1].T, strict=True))
    return float(np.mean([r_squared(*pair) for pair in pairs]))
