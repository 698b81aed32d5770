"""How well a model does on a recording: numbers, and the same in lines for people."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from hdc import circular
from hdc.accuracy import accuracy, confusion, r_squared, wilson
from hdc.command.answers import batched, outside, with_ends
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
    """Accuracy, confusions and wrong frames (or errors of values), and ``text``: lines for people.

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
    truth = np.array(recording.names)[index]
    result = _accuracy(model, recording, np.concatenate(predicted), index)
    lines = result["text"]
    if reject:
        refused = int((~np.concatenate(known)).sum())
        result["refused"] = refused
        lines.append(
            f"--reject {reject:g} refuses {refused} of them as none of the classes"
        )
    if interval is not None:
        result["coverage"], line = _coverage_of_sets(sets, truth, interval)
        lines.append(line)
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
    """Accuracy with its interval and that of a guess, confusions, and the frames that are wrong."""
    names = [str(c) for c in model.classes_]
    row = {name: k for k, name in enumerate(names)}
    truth = np.array(recording.names)[index].tolist()
    found = [str(c) for c in predicted]
    true = np.array([row[name] for name in truth])
    read = np.array([row[name] for name in found])
    right = int((read == true).sum())
    share = accuracy(read, true)
    low, high = wilson(right, len(index))
    wrong = [
        {"file": recording.place(i), "label": a, "predicted": b}
        for i, a, b in zip(index, truth, found, strict=True)
        if a != b
    ]
    largest = int(model.counts_.argmax())
    guess = float((true == largest).mean())
    interval = f"95 % interval {low:.1%} to {high:.1%}"
    return {
        "frames": len(index),
        "accuracy": share,
        "interval": [low, high],
        "guess": guess,
        "classes": names,
        "confusion": confusion(read, true, len(names)).tolist(),
        "wrong": wrong,
        "text": [
            f"accuracy {share:.1%} ({interval}), {right} of {len(index)} frames",
            f"a guess of {printable(names[largest])}, the largest class: accuracy {guess:.1%}",
        ],
    }


def _score_of_values(
    model: Any, recording: Recording, index: np.ndarray, interval: float | None
) -> dict[str, Any]:
    """Errors and R² of each value; coverage and width of its intervals, if asked for."""
    assert recording.values is not None
    parts: list[tuple[np.ndarray, ...]] = []
    for batch in _evaluated(recording, index):
        if interval is None:
            parts.append((model.predict(batch).reshape(len(batch), -1),))
        else:
            parts.append(with_ends(model, batch, interval))
    predicted, *ends = (np.concatenate(part) for part in zip(*parts, strict=True))
    truth = recording.values[index]
    errors = circular.errors(predicted, truth, model.period).mean(axis=0).tolist()
    mean = model.mean_
    guesses = circular.errors(truth, mean, model.period).mean(axis=0).tolist()
    units = recording.value_units or ("",) * len(errors)
    rows: dict[str, Any] = {}
    text = []
    for k, (name, unit) in enumerate(zip(recording.value_names, units, strict=True)):
        share = _explained(truth[:, k], predicted[:, k], model.period)
        rows[name] = {
            "mean_absolute_error": errors[k],
            "guess": guesses[k],
            "r_squared": share,
        }
        if unit:
            rows[name]["unit"] = unit
        amounts = [f"{amount[k]:.4g} {unit}".rstrip() for amount in (errors, guesses)]
        text.append(
            f"{printable(name)}: mean absolute error {amounts[0]} (a guess of the mean "
            f"{amounts[1]}), R² {share:.3f}, {len(index)} frames"
        )
    if interval is not None:
        low, high = ends
        inside = ((low <= truth) & (truth <= high)).sum(axis=0).tolist()
        widths = (high - low).mean(axis=0).tolist()
        for k, (name, unit) in enumerate(zip(rows, units, strict=True)):
            covered = _coverage(inside[k], len(index), interval)
            width = f"{widths[k]:.4g} {unit}".rstrip()
            line = _coverage_line(covered, "intervals")
            text.append(f"{printable(name)}: {line}; mean width {width}")
            covered["mean_width"] = widths[k] if np.isfinite(widths[k]) else None
            rows[name]["coverage"] = covered
    return {"frames": len(index), "errors": rows, "text": text}


def _explained(truth: np.ndarray, predicted: np.ndarray, period: float | None) -> float:
    """R² of one value [N]; of a circular one the mean of those of cosine and sine."""
    pairs = [(truth, predicted)]
    if period is not None:
        planes = [circular.to_plane(v[:, None], period) for v in (truth, predicted)]
        pairs = list(zip(planes[0].T, planes[1].T, strict=True))
    return float(np.mean([r_squared(*pair) for pair in pairs]))


def confusions(result: dict[str, Any]) -> list[str]:
    """Lines of the table of a score's confusions, a row a true class; none of values."""
    if "classes" not in result:
        return []
    counts = np.array(result["confusion"])
    names = [printable(name) for name in result["classes"]]
    heads = _shortened(names)
    numbers = [str(n) for n in counts.ravel()]
    width = max(len(name) for name in names)
    cell = max(len(text) for text in [*heads, *numbers])
    lines = ["rows are the true classes, columns the predicted ones"]
    lines.append(" ".join([" " * width, *(f"{head:>{cell}}" for head in heads)]))
    for name, row in zip(names, counts, strict=True):
        lines.append(" ".join([f"{name:{width}}", *(f"{n:>{cell}}" for n in row)]))
    return lines


def _shortened(names: Sequence[str], least: int = 12) -> list[str]:
    """The beginnings of names, so long that they differ."""
    for length in range(least, max(map(len, names))):
        found = [name[:length] for name in names]
        if len(set(found)) == len(names):
            return found
    return list(names)
