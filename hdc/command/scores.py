"""How well a model does on a recording, in numbers; :mod:`hdc.command.messages` says them."""

from __future__ import annotations

from collections import Counter
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
) -> dict[str, Any]:
    """Accuracy and confusions, or errors of values, of the n frames `index`.

    With a share to `reject` also how many frames were refused.
    """
    frames = with_progress(recording.stream(index), len(index), "Evaluating")
    batches = map(np.stack, batched(frames))
    parts = [columns(model, batch, Wanted(reject)) for batch in batches]
    found = {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}
    if "values" in found:
        errors = _errors(model, recording, index, found["values"])
        return {"frames": len(index), "errors": errors}
    truth, answers = np.array(recording.names)[index], found["label"].astype(str)
    result = _accuracy(model, truth, answers)
    if reject:
        refused = int((~found["known"]).sum())
        result |= {"reject": reject, "refused": refused, "left_out": model.left_out_}
    unit, by = recorded_together(recording, index)
    interval = [*interval_of(answers == truth, unit)]
    return {"frames": len(index), "interval": interval, "interval_by": by, **result}


def _accuracy(model: Any, truth: np.ndarray, answers: np.ndarray) -> dict[str, Any]:
    """Accuracy, that of the majority-class baseline, and confusions."""
    names = [str(label) for label in model.classes_]
    guessed = names[int(model.counts_.argmax())]
    pairs = Counter(zip(truth.tolist(), answers.tolist(), strict=True))
    return {
        "accuracy": float((answers == truth).mean()),
        "guessed": guessed,
        "guess": float((truth == guessed).mean()),
        "classes": names,
        "confusion": [[pairs[row, column] for column in names] for row in names],
    }


def _errors(
    model: Any, recording: Recording, index: np.ndarray, answers: np.ndarray
) -> dict[str, Any]:
    """Errors and R² of each value, by name."""
    truth = truth_of(recording)[index]
    rows: dict[str, Any] = {}
    for k, name in enumerate(recording.value_names):
        right, answered = truth[:, k], answers[:, k]
        rows[name] = {
            "mean_absolute_error": float(np.abs(answered - right).mean()),
            "guess": float(np.abs(right - model.mean_[k]).mean()),
            "r_squared": r_squared(right, answered),
            "unit": recording.value_units[k],
        }
    return rows


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
