"""How well a model does on a recording: numbers, and the same in lines for people."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from hdc import circular
from hdc.accuracy import accuracy, confusion, r_squared, wilson
from hdc.command.answers import batched, finite, outside, with_ends
from hdc.command.messages import printable
from hdc.readers import Recording
from hdc.readers.recording import with_progress


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
    for some in batched(frames):
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
    shares = _explained(truth, predicted, model.period)
    for name, unit, mean, share in zip(
        recording.value_names, units, means, shares, strict=True
    ):
        rows[name] = {"mean_absolute_error": mean, "r_squared": share}
        if unit:
            rows[name]["unit"] = unit
        amount = f"{mean:.4g} {unit}".rstrip()
        text.append(
            f"{name}: mean absolute error {amount}, R² {share:.3f}, {len(index)} frames"
        )
    if interval is not None:
        low, high = ends
        inside = ((low <= truth) & (truth <= high)).sum(axis=0).tolist()
        widths = (high - low).mean(axis=0).tolist()
        for k, (name, unit) in enumerate(zip(rows, units, strict=True)):
            covered = _coverage(inside[k], len(index), interval)
            width = f"{widths[k]:.4g} {unit}".rstrip()
            line = _coverage_line(covered, "intervals")
            text.append(f"{name}: {line}; mean width {width}")
            covered["mean_width"] = finite(widths[k])
            rows[name]["coverage"] = covered
    return {"frames": len(index), "errors": rows, "text": text}


def _explained(
    truth: np.ndarray, predicted: np.ndarray, period: float | None
) -> list[float]:
    """R² of each value; of circular ones the mean of those of cosine and sine."""
    if period is None:
        return [r_squared(*pair) for pair in zip(truth.T, predicted.T, strict=True)]
    planes = [circular.to_plane(values, period).T for values in (truth, predicted)]
    shares = [r_squared(*pair) for pair in zip(*planes, strict=True)]
    n = truth.shape[1]
    return [(shares[k] + shares[n + k]) / 2 for k in range(n)]


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
