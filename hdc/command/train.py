"""``hdc train``: a model of a recording, of named parts or of those that are chosen."""

from __future__ import annotations

import math
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

DEFAULT = ("levels", "lda")
"""Encoder and read-out for classes: chosen by the rule in docs/claims.md."""
PUBLISHED = ("median", "majority")
"""Encoder and read-out of the paper."""


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
    help="How frames become bits: median, levels, deviation, reference, reference_levels, another "
    "name of docs/api.md, or a module.Class. [default: levels; for numbers median]",
)
@click.option(
    "--readout",
    metavar="NAME",
    help="How bits are read: majority, lda, ridge, neighbours, kernel, another name of "
    "docs/api.md, or a module.Class; for numbers ridge or neighbours. [default: lda; for numbers "
    "ridge]",
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

    A rule that was fixed before its measurement chose the default form. The published form is
    --encoder median --readout majority. It also learns frames of one class, for a model that finds
    frames unlike them (hdc predict --reject), and more frames than lda can learn.
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
        model, lines = _untrained(frames, len(rows), encoder, readout, period)
        model.set_params(**dict(parameters))
        given = _learnable(model, frames, rows)
    model.fit(given, truth_of(frames)[rows], **_together(frames, rows))
    model.columns_ = list(frames.features) or None
    lines += messages.content_lines(frames, rows)
    metadata = _metadata(frames, window)
    if unit is not None:
        said, kept = _held_out(model, frames, tested, unit)
        lines += said
        metadata |= kept
    model.save(output, metadata=metadata)
    lines.append(messages.form_line(model, output) + _advice(model, choose))
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
    frames: Recording,
    n: int,
    encoder: str | None,
    readout: str | None,
    period: float | None,
) -> tuple[Any, list[str]]:
    """A model of these parts that learns n frames of a recording, and a line on why its read-out is
    not the default one."""
    from hdc.readouts.discriminant import MOST_FRAMES

    if frames.values is not None:
        parts = encoder or "median", readout or "ridge"
        return hdc.HDCRegressor(*parts, period=period), []
    if len(frames.classes) == 1:  # nothing to tell apart
        return hdc.HDCClassifier(encoder or PUBLISHED[0], readout or PUBLISHED[1]), []
    model = hdc.HDCClassifier(encoder or DEFAULT[0], readout or DEFAULT[1])
    n_bits = model.fresh("encoder").dimension(math.prod(frames.frame_shape))
    if readout is not None or min(n, n_bits) <= MOST_FRAMES:
        return model, []
    why = (
        f"majority in place of {DEFAULT[1]}, which learns at most {MOST_FRAMES} frames of more "
        f"than {MOST_FRAMES} bits, found {n} of {n_bits}"
    )
    return hdc.HDCClassifier(encoder or PUBLISHED[0], PUBLISHED[1]), [why]


def _advice(model: Any, choose: bool) -> str:
    """The end of the line on the form of a model: options of other forms."""
    if choose:
        return ""
    if (model.encoder, model.readout) == DEFAULT:
        encoder, readout = PUBLISHED
        published = f"--encoder {encoder} --readout {readout}"
        return f"; {published} is the published form, --choose tries others"
    return "; --choose tries others"


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
        shares = messages.percent(1 - mine), messages.percent(1 - published)
        found = "accuracy {}, the published form {}".format(*shares)
    lines = [f"chosen: {best.name} among {len(tried)} by {folds.how} ({found})"]
    if why := folds.units.reason(recording):
        lines.append(f"chosen by {folds.how} because {why}")
    all_rows = np.arange(len(rows))
    given, _ = data.given(best.model, all_rows, all_rows)
    return best.model, given, lines
