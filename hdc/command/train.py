"""``hdc train``: a model of a recording, of named parts or of those that are chosen."""

from __future__ import annotations

from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import click
import numpy as np

import hdc
from hdc.command import messages, options, scores, splits
from hdc.command.source import (
    Source,
    check_circular,
    pixels,
    recording,
    truth_of,
)
from hdc.io import check_replaceable
from hdc.readers import Recording, Window
from hdc.readers.recording import with_progress


@click.command(short_help="Train a model on labelled images.")
@recording
@options.output
@pixels
@click.option(
    "--test-fraction",
    type=options.SHARE,
    help="Share of each class to hold out: its last sessions if known, else whole groups, else "
    "frames at random.",
)
@click.option(
    "--encoder",
    metavar="NAME",
    help="How frames become bits: median, quantile, levels, reference, reference_levels, "
    "deviation, smoothed, or a module.Class. [default: median]",
)
@click.option(
    "--readout",
    metavar="NAME",
    help="How bits are read: majority, counts, ridge, neighbours, lda, trained, kernel, "
    "or a module.Class; for numbers ridge or neighbours. [default: majority; for numbers ridge]",
)
@options.parameters
@options.circular
@click.option(
    "--choose",
    is_flag=True,
    help="Take the encoder and the read-out that are best in cross-validation of the training "
    "frames, by session if there are several. Frames are held in memory.",
)
def train(
    source: Source,
    window: Window,
    output: Path,
    test_fraction: float | None,
    encoder: str | None,
    readout: str | None,
    parameters: tuple[tuple[str, Any], ...],
    choose: bool,
    period: float | None,
) -> None:
    """Learn the classes of a RECORDING, or its numbers with --values.

    Frames of one class alone make a model that finds frames unlike them: hdc predict --reject.
    """
    if choose and (encoder or readout or parameters):
        raise click.UsageError(
            "expected --choose alone, or --encoder, --readout and --set without it"
        )
    frames = source.open(window, fewest_classes=2 if choose else 1)
    check_circular(frames, period)
    check_replaceable(output)
    rows, tested, unit = _split(frames, test_fraction)
    if choose:
        model, given, lines = chosen(frames, rows, period)
    else:
        model = _untrained(frames, encoder, readout, period)
        model.set_params(**dict(parameters))
        given, lines = _learnable(model, frames, rows), []
    model.fit(given, truth_of(frames)[rows], **_together(frames, rows))
    model._columns = list(frames.features) or None
    lines += messages.content_lines(frames, rows)
    metadata = _metadata(frames, window)
    if unit is not None:
        said, kept = _held_out(model, frames, tested, unit)
        lines += said
        metadata |= kept
    model.save(output, metadata=metadata)
    advice = "" if choose else "; --choose tries others"
    lines.append(messages.form_line(model, output) + advice)
    lines += messages.reading_lines(frames)
    lines += messages.circular_lines(frames, period)
    first = f"{output}: {len(rows)} frames, {messages.whole(frames)}"
    messages.say(first, *lines)


def _split(
    frames: Recording, test_fraction: float | None
) -> tuple[np.ndarray, np.ndarray, splits.Units | None]:
    """Rows to learn and to test, and the units that are held out; all are learnt without a
    fraction."""
    if test_fraction is None:
        every = np.arange(len(frames))
        return every, every[:0], None
    (rows, tested), unit = splits.hold_out(frames, test_fraction)
    return rows, tested, unit


def _untrained(
    frames: Recording, encoder: str | None, readout: str | None, period: float | None
) -> Any:
    """A model of these parts that learns the classes or the numbers of a recording."""
    if frames.values is None:
        return hdc.HDCClassifier(encoder or "median", readout or "majority")
    return hdc.HDCRegressor(encoder or "median", readout or "ridge", period=period)


def _held_out(
    model: Any, frames: Recording, tested: np.ndarray, unit: splits.Units
) -> tuple[list[str], dict[str, Any]]:
    """Lines on the frames that were held out, and why they were these; and the accuracy, which is
    kept with the model. A model of one class is asked how many of them it refuses."""
    is_of_one = frames.values is None and len(frames.classes) == 1
    rate = options.RATE if is_of_one else None
    result = scores.score(model, frames, tested, rate)
    first, *others = messages.score_lines(result)
    lines = [f"held out {splits.HOW[unit.kind]}: {first}", *others]
    if why := unit.reason(frames):
        lines.append(f"held out {splits.HOW[unit.kind]} because {why}")
    if is_of_one or frames.values is not None:
        return lines, {}
    return lines, {"held_out": result["accuracy"]}


def _metadata(frames: Recording, window: Window) -> dict[str, Any]:
    """Settings and names that are kept with a model of a recording."""
    metadata: dict[str, Any] = {"crop": window.crop, "subsample": window.subsample}
    if window.crop is not None and frames.image_shape:
        metadata["image"] = list(frames.image_shape)
    if frames.values is not None:
        metadata["values"] = list(frames.value_names)
    if any(frames.value_units):
        metadata["units"] = list(frames.value_units)
    metadata["trained"] = datetime.now(UTC).isoformat(timespec="seconds")
    metadata["version"] = hdc.__version__
    return metadata


def _together(frames: Recording, rows: np.ndarray) -> dict[str, Any]:
    """The argument ``groups`` of a classifier: frames that were recorded together calibrate its
    rejection."""
    if frames.values is not None:
        return {}
    unit = splits.units(frames, rows)
    return {} if unit.kind == "frame" else {"groups": unit.of}


def _learnable(model: Any, recording: Recording, rows: np.ndarray) -> Any:
    """The frames `rows`, which are decoded as a model asks for them."""
    from hdc.encoders import make_encoder

    if make_encoder(model.encoder).learns:  # it reads all frames twice
        return recording.frames(rows)
    return recording.batches(rows)


def chosen(
    recording: Recording, rows: np.ndarray, period: float | None
) -> tuple[Any, Any, list[str]]:
    """The untrained form that is best in cross-validation of the frames `rows`, what it takes of
    these, and what to say."""
    from hdc.command.compare import candidates, judge

    data, (folds,) = judge.prepared(recording, rows, period=period)
    forms = candidates.forms((), (), recording.values is not None, period)
    shown = with_progress(forms, len(forms), "Choosing")
    answers = judge.compared(shown, data, [folds])
    tried = {form: rows[0] for form, rows in answers if not isinstance(rows, str)}
    best = judge.best(tried)
    mine, published = (float(tried[form].losses.mean()) for form in (best, forms[0]))
    if recording.values is not None:
        found = f"{mine:.3g} of the constant baseline's error, {forms[0].name} {published:.3g}"
    else:
        found = f"accuracy {1 - mine:.1%}, the published form {1 - published:.1%}"
    lines = [f"chosen: {best.name} among {len(tried)} by {folds.how} ({found})"]
    if why := folds.units.reason(recording):
        lines.append(f"chosen by {folds.how} because {why}")
    all_rows = np.arange(len(rows))
    given, _ = data.given(best.model, all_rows, all_rows)
    return best.model, given, lines
