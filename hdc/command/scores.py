"""How well a model does on a recording: numbers, and apart from them lines for people."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from hdc import circular
from hdc.accuracy import accuracy, confusion, r_squared, wilson
from hdc.command.answers import Wanted, batched, columns
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
    """Accuracy, confusions and wrong frames, or errors of values, of the frames `index`.

    With a share to `reject` also how many frames were refused, and with an `interval` how often
    the truth was in the intervals or sets.
    """
    wanted = Wanted(reject, interval, distances=False)
    frames = with_progress(recording.stream(index), len(index), "Evaluating")
    parts = [columns(model, np.stack(some), wanted) for some in batched(frames)]
    if not hasattr(model, "classes_"):
        return _of_values(model, recording, index, parts, interval)
    truth = np.array(recording.names)[index].tolist()
    read = np.concatenate([part["label"] for part in parts])
    result = _of_classes(model, recording, index, truth, read)
    if reject:
        result["refused"] = sum(int((~part["known"]).sum()) for part in parts)
    if interval is not None:
        sets = [possible for part in parts for possible in part["set"]]
        inside = [name in map(str, own) for name, own in zip(truth, sets, strict=True)]
        result["coverage"] = _coverage(sum(inside), len(inside), interval)
        result["coverage"]["mean_size"] = float(np.mean([len(own) for own in sets]))
    return result


def _of_classes(
    model: Any,
    recording: Recording,
    index: np.ndarray,
    truth: list[str],
    read: np.ndarray,
) -> dict[str, Any]:
    """Accuracy with its interval and that of a guess, confusions, and the frames that are wrong."""
    names = [str(label) for label in model.classes_]
    row = {name: k for k, name in enumerate(names)}
    found = [str(label) for label in read]
    true = np.array([row[name] for name in truth])
    answers = np.array([row[name] for name in found])
    largest = int(model.counts_.argmax())
    wrong = [
        {"file": recording.place(i), "label": a, "predicted": b}
        for i, a, b in zip(index, truth, found, strict=True)
        if a != b
    ]
    return {
        "frames": len(index),
        "accuracy": accuracy(answers, true),
        "interval": [*wilson(int((answers == true).sum()), len(index))],
        "guessed": names[largest],
        "guess": float((true == largest).mean()),
        "classes": names,
        "confusion": confusion(answers, true, len(names)).tolist(),
        "wrong": wrong,
    }


def _of_values(
    model: Any,
    recording: Recording,
    index: np.ndarray,
    parts: Sequence[Mapping[str, np.ndarray]],
    interval: float | None,
) -> dict[str, Any]:
    """Errors and R² of each value; coverage and width of its intervals, if asked for."""
    assert recording.values is not None
    truth = recording.values[index]
    found = {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}
    period = model.period
    errors = circular.errors(found["values"], truth, period).mean(axis=0)
    guesses = circular.errors(truth, model.mean_, period).mean(axis=0)
    units = recording.value_units or ("",) * len(errors)
    rows: dict[str, Any] = {}
    for k, (name, unit) in enumerate(zip(recording.value_names, units, strict=True)):
        rows[name] = {
            "mean_absolute_error": float(errors[k]),
            "guess": float(guesses[k]),
            "r_squared": _explained(truth[:, k], found["values"][:, k], period),
        }
        if unit:
            rows[name]["unit"] = unit
        if interval is not None:
            low, high = found["low"][:, k], found["high"][:, k]
            inside = int(((low <= truth[:, k]) & (truth[:, k] <= high)).sum())
            width = float((high - low).mean())
            coverage = _coverage(inside, len(index), interval)
            coverage["mean_width"] = width if np.isfinite(width) else None
            rows[name]["coverage"] = coverage
    return {"frames": len(index), "errors": rows}


def _coverage(inside: int, n: int, asked: float) -> dict[str, Any]:
    return {"asked": asked, "share": inside / n, "interval": [*wilson(inside, n)]}


def _explained(truth: np.ndarray, predicted: np.ndarray, period: float | None) -> float:
    """R² of one value [N]; of a circular one the mean of those of cosine and sine."""
    pairs = [(truth, predicted)]
    if period is not None:
        planes = [circular.to_plane(v[:, None], period) for v in (truth, predicted)]
        pairs = list(zip(planes[0].T, planes[1].T, strict=True))
    return float(np.mean([r_squared(*pair) for pair in pairs]))


# Lines -------------------------------------------------------------------------------------------


def lines(result: Mapping[str, Any], reject: float | None = None) -> list[str]:
    """A score in lines for people."""
    if "errors" in result:
        errors = result["errors"].items()
        n = result["frames"]
        found = [_error_line(name, own, n) for name, own in errors]
        found += [_width_line(name, own) for name, own in errors if "coverage" in own]
        return found
    n, share = result["frames"], result["accuracy"]
    low, high = result["interval"]
    guessed = printable(result["guessed"])
    found = [
        f"accuracy {share:.1%} (95 % interval {low:.1%} to {high:.1%}), {round(share * n)} of {n} "
        "frames",
        f"a guess of {guessed}, the largest class: accuracy {result['guess']:.1%}",
    ]
    if reject:
        found.append(
            f"--reject {reject:g} refuses {result['refused']} of them as none of the classes"
        )
    if "coverage" in result:
        size = result["coverage"]["mean_size"]
        line = _coverage_line(result["coverage"], "sets")
        found.append(f"{line}; {size:.2f} classes a set")
    return found


def _error_line(name: str, own: Mapping[str, Any], n: int) -> str:
    unit = own.get("unit", "")
    error = f"{own['mean_absolute_error']:.4g} {unit}".rstrip()
    guess = f"{own['guess']:.4g} {unit}".rstrip()
    return (
        f"{printable(name)}: mean absolute error {error} (a guess of the mean {guess}), R² "
        f"{own['r_squared']:.3f}, {n} frames"
    )


def _width_line(name: str, own: Mapping[str, Any]) -> str:
    width = own["coverage"]["mean_width"]
    amount = "inf" if width is None else f"{width:.4g}"
    line = _coverage_line(own["coverage"], "intervals")
    amount = f"{amount} {own.get('unit', '')}".rstrip()
    return f"{printable(name)}: {line}; mean width {amount}"


def _coverage_line(found: Mapping[str, Any], what: str) -> str:
    low, high = found["interval"]
    return (
        f"{what} for {found['asked']:g} hold the truth for {found['share']:.1%} of these frames "
        f"(95 % interval {low:.1%} to {high:.1%})"
    )


def confusions(result: Mapping[str, Any]) -> list[str]:
    """Lines of the table of a score's confusions, a row a true class; none of values."""
    if "classes" not in result:
        return []
    counts = np.array(result["confusion"])
    names = [printable(name) for name in result["classes"]]
    heads = _shortened(names)
    numbers = [str(n) for n in counts.ravel()]
    width = max(len(name) for name in names)
    cell = max(len(text) for text in [*heads, *numbers])
    found = ["rows are the true classes, columns the predicted ones"]
    found.append(" ".join([" " * width, *(f"{head:>{cell}}" for head in heads)]))
    for name, row in zip(names, counts, strict=True):
        found.append(" ".join([f"{name:{width}}", *(f"{n:>{cell}}" for n in row)]))
    return found


def _shortened(names: Sequence[str], least: int = 12) -> list[str]:
    """The beginnings of names, so long that they differ."""
    for length in range(least, max(map(len, names))):
        found = [name[:length] for name in names]
        if len(set(found)) == len(names):
            return found
    return list(names)
