"""How well a model does on a recording, in numbers; :mod:`hdc.command.messages` says them."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from itertools import chain
from typing import Any

import numpy as np

from hdc.accuracy import r_squared, wilson
from hdc.command.answers import Wanted, batched, columns
from hdc.command.source import truth_of
from hdc.readers import Recording
from hdc.readers.recording import with_progress


def score(
    model: Any,
    recording: Recording,
    index: np.ndarray,
    reject: float | None = None,
    interval: float | None = None,
) -> dict[str, Any]:
    """Accuracy and confusions, or errors of values, of the n frames `index`.

    With a share to `reject` also how many frames were refused, and with an `interval` how often
    the truth was in the intervals or sets.
    """
    wanted = Wanted(reject, interval)
    frames = with_progress(recording.stream(index), len(index), "Evaluating")
    parts = [columns(model, np.stack(some), wanted) for some in batched(frames)]
    found = {name: [*chain(*(part[name] for part in parts))] for name in parts[0]}
    unit, by = recorded_together(recording, index)
    if "values" in found:
        errors = _errors(model, recording, index, found, interval, unit)
        return {"frames": len(index), "errors": errors}
    truth = np.array(recording.names)[index]
    result = _accuracy(model, truth, found["label"], unit)
    if reject:
        refused = found["known"].count(False)
        result |= {"reject": reject, "refused": refused, "left_out": model.left_out_}
    if interval is not None:
        result["coverage"] = _of_sets(found["set"], truth, interval, unit)
    return {"frames": len(index), "interval_by": by, **result}


def _accuracy(
    model: Any, truth: np.ndarray, labels: Sequence[Any], unit: np.ndarray
) -> dict[str, Any]:
    """Accuracy with its interval, that of the majority-class baseline, confusions."""
    names = [str(label) for label in model.classes_]
    answers = np.array([str(label) for label in labels])
    right = answers == truth
    guessed = names[int(model.counts_.argmax())]
    pairs = Counter(zip(truth.tolist(), answers.tolist(), strict=True))
    return {
        "accuracy": float(right.mean()),
        "interval": [*interval_of(right, unit)],
        "guessed": guessed,
        "guess": float((truth == guessed).mean()),
        "classes": names,
        "confusion": [[pairs[row, column] for column in names] for row in names],
    }


def _errors(
    model: Any,
    recording: Recording,
    index: np.ndarray,
    found: Mapping[str, Any],
    interval: float | None,
    unit: np.ndarray,
) -> dict[str, Any]:
    """Errors and R² of each value, its coverage and width of intervals, if asked for; by name."""
    truth, answers = truth_of(recording)[index], np.array(found["values"])
    rows: dict[str, Any] = {}
    for k, name in enumerate(recording.value_names):
        right, answered = truth[:, k], answers[:, k]
        rows[name] = {
            "mean_absolute_error": float(np.abs(answered - right).mean()),
            "guess": float(np.abs(right - model.mean_[k]).mean()),
            "r_squared": r_squared(right, answered),
            "unit": recording.value_units[k],
        }
        if interval is not None:
            low, high = np.array(found["intervals"])[:, k].T
            coverage = _coverage((low <= right) & (right <= high), interval, unit)
            width = float((high - low).mean())
            coverage["mean_width"] = width if np.isfinite(width) else None
            rows[name]["coverage"] = coverage
    return rows


def _of_sets(
    sets: Sequence[Sequence[Any]], truth: np.ndarray, asked: float, unit: np.ndarray
) -> dict[str, Any]:
    """How often sets of labels contain the truth, and their mean size."""
    inside = [name in map(str, own) for name, own in zip(truth, sets, strict=True)]
    size = float(np.mean([len(own) for own in sets]))
    return _coverage(np.array(inside), asked, unit) | {"mean_size": size}


def _coverage(inside: np.ndarray, asked: float, unit: np.ndarray) -> dict[str, Any]:
    share, interval = float(np.mean(inside)), [*interval_of(inside, unit)]
    return {"asked": asked, "share": share, "interval": interval}


def recorded_together(
    recording: Recording, index: np.ndarray
) -> tuple[np.ndarray, str]:
    """The session [n] of each of the frames `index`, else its group, else a number of its own; and
    how many there are, in words."""
    n = len(index)
    for kind, known in (("session", recording.session), ("group", recording.group)):
        if known is not None:
            different, unit = np.unique(known[index], return_inverse=True)
            if 1 < len(different) < n:
                return unit, f"{len(different)} {kind}s"
    return np.arange(n), f"{n} frames"


def interval_of(right: np.ndarray, unit: np.ndarray) -> tuple[float, float]:
    """95 % interval of the share of frames [n] that are right, which vary unit by unit.

    It is Wilson's of the number of frames that would vary as much if each were a unit: p(1 − p)/v
    with v = k/(k − 1)·Σ(rᵢ − p·nᵢ)²/n², where rᵢ of the nᵢ frames of unit i of k are right (Korn,
    Graubard, Survey Methodology 24, 193 (1998)); where p is 0 or 1, it is k. For few units it is
    divided by the squared ratio of the quantiles of Student's t, with k − 1 degrees of freedom,
    and of the normal distribution (expanded as in Abramowitz, Stegun, 26.7.5).
    """
    sizes, counts = np.bincount(unit), np.bincount(unit, weights=right)
    n, k, share = len(right), len(sizes), float(np.mean(right))
    if k == n:
        return wilson(int(right.sum()), n)
    variance = k / (k - 1) * float(((counts - share * sizes) ** 2).sum()) / n**2
    as_many = float(k if share in (0, 1) else n)
    if variance > 0:
        as_many = min(share * (1 - share) / variance, n)
    free = k - 1
    as_many /= 1 + 2.42 / free + 4.35 / free**2
    return wilson(share * as_many, as_many)
