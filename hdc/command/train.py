"""``hdc train``: a model of a recording."""

from __future__ import annotations

import math
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import click
import numpy as np

import hdc
from hdc.command import messages, options, scores, splits
from hdc.command.source import Source, pixels, recording, truth_of
from hdc.io import check_replaceable
from hdc.readers import Recording, Window

DEFAULT = ("levels", "lda")
"""Encoder and read-out for classes: chosen by the rule in docs/claims.md."""
PUBLISHED = ("median", "majority")
"""Encoder and read-out of the paper."""
OF_VALUES = ("median", "ridge")
"""Encoder and read-out for numbers."""


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
def train(
    source: Source,
    window: Window,
    output: Path,
    test_fraction: float | None,
    encoder: str | None,
    readout: str | None,
    parameters: tuple[tuple[str, Any], ...],
) -> None:
    """Learn the classes of a RECORDING, or its numbers with --values.

    A rule that was fixed before its measurement chose the default form. The published form is
    --encoder median --readout majority. It also learns frames of one class, for a model that finds
    frames unlike them (hdc predict --reject), and more frames than lda can learn.
    """
    frames = source.open(window, fewest_classes=1)
    check_replaceable(output)
    rows, tested, unit = np.arange(len(frames)), None, None
    if test_fraction is not None:
        (rows, tested), unit = splits.hold_out(frames, test_fraction)
    model, lines = _untrained(frames, len(rows), encoder, readout)
    model.set_params(**dict(parameters))
    given = _learnable(model, frames, rows)
    model.fit(given, truth_of(frames)[rows], **_together(frames, rows))
    model.columns_ = list(frames.features) or None
    lines += messages.content_lines(frames, rows)
    metadata = _metadata(frames, window)
    if tested is not None and unit is not None:
        said, kept = _held_out(model, frames, tested, unit)
        lines += said
        metadata |= kept
    model.save(output, metadata=metadata)
    form = messages.form_line(model, output)
    if (model.encoder, model.readout) == DEFAULT:
        form += "; --encoder {} --readout {} is the published form".format(*PUBLISHED)
    first = f"{output}: {len(rows)} frames, {messages.whole(frames)}"
    messages.say(first, *lines, form, *messages.reading_lines(frames))


def _untrained(
    frames: Recording,
    n: int,
    encoder: str | None,
    readout: str | None,
) -> tuple[Any, list[str]]:
    """A model of these parts that learns n frames of a recording, and a line on why its read-out is
    not the default one."""
    kind: type = hdc.HDCClassifier
    default = DEFAULT if len(frames.classes) > 1 else PUBLISHED
    if frames.values is not None:
        kind, default = hdc.HDCRegressor, OF_VALUES
    model = kind(encoder or default[0], readout or default[1])
    why = "" if readout or default != DEFAULT else _why_not(model, n, frames)
    if not why:
        return model, []
    return kind(encoder or PUBLISHED[0], PUBLISHED[1]), [why]


def _why_not(model: Any, n: int, frames: Recording) -> str:
    """Why the default read-out cannot learn n frames; empty where it can."""
    from hdc.readouts.discriminant import MOST_FRAMES

    n_bits = model.fresh("encoder").dimension(math.prod(frames.frame_shape))
    if min(n, n_bits) <= MOST_FRAMES:
        return ""
    return (
        f"majority in place of {DEFAULT[1]}, which learns at most {MOST_FRAMES} frames of more "
        f"than {MOST_FRAMES} bits, found {n} of {n_bits}"
    )


def _held_out(
    model: Any, frames: Recording, tested: np.ndarray, unit: splits.Units
) -> tuple[list[str], dict[str, Any]]:
    """Lines on the frames that were held out, and why they were these; and the accuracy, which is
    kept with the model. A model of one class is asked how many of them it refuses."""
    is_of_one = frames.values is None and len(frames.classes) == 1
    result = scores.score(model, frames, tested, options.RATE if is_of_one else None)
    first, *others = messages.score_lines(result)
    lines = [f"held out {splits.HOW[unit.kind]}: {first}", *others]
    if unit.why:
        lines.append(f"held out {splits.HOW[unit.kind]} because {unit.why}")
    return lines, {"held_out": result.get("accuracy")}


def _metadata(frames: Recording, window: Window) -> dict[str, Any]:
    """Settings and names that are kept with a model of a recording."""
    metadata: dict[str, Any] = {"crop": window.crop, "subsample": window.subsample}
    if window.crop is not None and frames.image_shape:
        metadata["image"] = list(frames.image_shape)
    if frames.values is not None:
        metadata["values"] = list(frames.value_names)
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
