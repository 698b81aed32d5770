"""Lines that the commands print of a recording and of a model."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import click
import numpy as np

from hdc.command import printable
from hdc.readers import Recording, natural_key

FALL = 0.1
"""Fall of the accuracy on another recording from which on the sensor is said to differ."""
DIFFERS = (
    "Your sensor differs between the recordings: record five frames of each class and hdc "
    "recalibrate the model."
)
LISTED = 12
"""Classes, sessions, arrays, columns or readings that are shown."""


def content_lines(recording: Recording, learnt: np.ndarray) -> list[str]:
    """The classes and sessions that are learnt, with the frames of each."""
    sessions = session_line(recording, learnt)
    if recording.values is not None:
        return [sessions]
    names = np.array(recording.names)[learnt].tolist()
    return [f"classes: {_counted(names, recording.classes)}", sessions]


def form_line(model: Any, path: Path) -> str:
    """The form and both sizes of a model that was saved."""
    used, stored = model.prediction_bytes_, path.stat().st_size
    form = f"{model.encoder}, {model.readout}"
    return f"form: {form}; {used:,} bytes to predict, {stored:,} in the file"


def whole(recording: Recording) -> str:
    """Content of a recording that a model learns, and the size of its frames."""
    return f"{learnt(recording)}, {size(recording.frame_shape)}"


def learnt(recording: Recording) -> str:
    """Content of a recording that a model learns, in words."""
    if recording.values is None:
        return f"{len(recording.classes)} classes"
    names = with_units(recording.value_names, recording.value_units)
    return f"values of {', '.join(names)}"


def reading_lines(recording: Recording) -> list[str]:
    """How the file was read, where it could be read otherwise; or nothing."""
    return [f"read: {'; '.join(recording.notes)}"] if recording.notes else []


def session_line(recording: Recording, rows: np.ndarray) -> str:
    """The sessions of the frames `rows`, and how many of them each has."""
    if recording.session is None:
        return "sessions: none known"
    names = recording.samples.get("session_name", recording.session)
    texts = [str(name) for name in names[rows].tolist()]
    return f"sessions: {_counted(texts, sorted(set(texts), key=natural_key))}"


def _counted(names: Sequence[str], different: Sequence[str]) -> str:
    counts = Counter(names)
    return ", ".join(shortened([f"{name} ({counts[name]})" for name in different]))


def shortened(items: list[str]) -> list[str]:
    """The first items of a long list, and how many more there are."""
    rest = len(items) - LISTED
    return [*items[:LISTED], f"… {rest} more"] if rest > 0 else items


def say(*lines: str) -> None:
    """Print lines, of which a name of a file or a class can hold no code of a terminal."""
    for line in lines:
        click.echo(printable(line))


def size(shape: Sequence[int]) -> str:
    """The size of a frame in words, width first."""
    return f"{' × '.join(str(side) for side in reversed(shape))} pixels"


def with_units(names: Sequence[str], units: Sequence[str]) -> list[str]:
    """Names of values, with the unit in brackets where there is one."""
    pairs = zip(names, units, strict=True)
    return [f"{name} [{unit}]" if unit else name for name, unit in pairs]


def described(model: Any, path: Path) -> dict[str, Any]:
    """Description of a saved model; the last rows say what was trained."""
    rows: dict[str, Any] = {
        "kind": type(model).__name__,
        "encoder": repr(model.encoder_),
        "readout": repr(model.readout_),
        "frames": size(model.frame_shape_),
        "bytes to predict": model.prediction_bytes_,
        "bytes of the file": path.stat().st_size,
        **model.metadata_,
    }
    if hasattr(model, "classes_"):
        names = map(str, model.classes_.tolist())
        rows["classes"] = dict(zip(names, model.counts_.tolist(), strict=True))
    return rows


# Scores ------------------------------------------------------------------------------------------


def percent(share: float) -> str:
    """A share in per cent."""
    return f"{100 * share:.1f} %"


def score_lines(result: Mapping[str, Any]) -> list[str]:
    """A score in lines for people."""
    if "errors" in result:
        errors = result["errors"].items()
        found = [_error_line(name, own, result["frames"]) for name, own in errors]
        widths = [_width_line(*one) for one in errors if "coverage" in one[1]]
        return [*found, *widths]
    n, share = result["frames"], result["accuracy"]
    low, high = result["interval"]
    by = f" by {result['interval_by']}".removesuffix(f" by {n} frames")
    found = [
        f"accuracy {percent(share)} (95 % interval {percent(low)} to {percent(high)}{by}), "
        f"{round(share * n)} of {n} frames",
        f"majority-class baseline (always {result['guessed']}): accuracy "
        f"{percent(result['guess'])}",
    ]
    if "refused" in result:
        limit = limit_of_refused(result["reject"], result["left_out"])
        text = (
            f"refused {result['refused']} of {n} known frames; expected at most {limit}"
        )
        found.append(text)
    if "coverage" in result:
        own = result["coverage"]
        line = _coverage_line(own, "sets")
        found.append(f"{line}; {own['mean_size']:.2f} classes a set")
    return found


def limit_of_refused(reject: float, left_out: str) -> str:
    """How many of known frames may be refused, and whether it holds for another session.

    Args:
        reject: the share that was asked for.
        left_out: what the model left out to calibrate it: "group" or "frame".
    """
    here = "" if left_out == "group" else " (not calibrated for another session)"
    return f"{100 * reject:g} %{here}"


def _error_line(name: str, own: Mapping[str, Any], n: int) -> str:
    error, guess = (_number(own[key], own) for key in ("mean_absolute_error", "guess"))
    return (
        f"{name}: mean absolute error {error} (mean baseline {guess}), R² "
        f"{own['r_squared']:.3f}, {n} frames"
    )


def _width_line(name: str, own: Mapping[str, Any]) -> str:
    width = own["coverage"]["mean_width"]
    line = _coverage_line(own["coverage"], "intervals")
    shown = _number(float("inf") if width is None else width, own)
    return f"{name}: {line}; mean width {shown}"


def _number(value: float, own: Mapping[str, Any]) -> str:
    """A number with its unit, if it has one."""
    return f"{value:.4g} {own['unit']}".rstrip()


def _coverage_line(found: Mapping[str, Any], what: str) -> str:
    low, high = found["interval"]
    return (
        f"{what} for {found['asked']:g} contain the truth for {percent(found['share'])} of these "
        f"frames (95 % interval {percent(low)} to {percent(high)})"
    )


def confusions(result: Mapping[str, Any]) -> list[str]:
    """Lines of the table of a score's confusions, a row a true class; none of values."""
    if "classes" not in result:
        return []
    names = result["classes"]
    rows = [["", *names]]
    for name, counts in zip(names, result["confusion"], strict=True):
        rows.append([name, *map(str, counts)])
    width = max(len(cell) for row in rows for cell in row)
    found = ["rows are the true classes, columns the predicted ones"]
    for name, *cells in rows:
        padded = (cell.rjust(width) for cell in cells)
        found.append(" ".join([name.ljust(width), *padded]))
    return found
