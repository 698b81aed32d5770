"""``hdc train``: a model of a recording, of named parts or of those that are chosen."""

from __future__ import annotations

from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import click
import numpy as np

import hdc
from hdc.command import messages, options
from hdc.command.holdout import hold_out, why_random
from hdc.command.source import Source, pixels, recording
from hdc.command.work import check_circular
from hdc.io import check_replaceable
from hdc.readers import Recording, Window
from hdc.readers.batches import Batches


@click.command(short_help="Train a model on labelled images.")
@recording
@options.output
@pixels
@click.option(
    "--test-fraction",
    type=options.SHARE,
    help="Share of frames to hold out: the last sessions if known, else whole groups, else at "
    "random.",
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
    choose: bool,
    period: float | None,
) -> None:
    """Learn the classes of a RECORDING, or its numbers with --values."""
    if choose and (encoder or readout):
        raise click.UsageError("expected --choose, or --encoder and --readout")
    from hdc.command.scores import score  # late: torch takes seconds

    frames = source.open(window)
    check_circular(frames, period)
    check_replaceable(output)
    training, test, how = hold_out(frames, test_fraction)
    model, chosen_line = learn(frames, training, encoder, readout, choose, period)
    model.save(output, metadata=_metadata(frames, window))
    size = messages.size(frames.frame_shape)
    lines = [f"{output}: {len(training)} frames, {messages.learnt(frames)}, {size}"]
    lines += chosen_line
    if frames.values is None:
        lines.append(messages.class_line(frames, training))
    lines.append(messages.session_line(frames))
    if len(test):
        first, *others = score(model, frames, test)["text"]
        lines += [f"held out {how}: {first}", *others]
        if not (encoder or readout or choose):
            lines.append(would_try(frames.values is not None))
    if how == "at random":
        lines.append(f"held out at random because {why_random(frames)}")
    lines += messages.reading_line(frames)
    lines += messages.circular_lines(frames) if period is None else []
    click.echo("\n".join(lines))


def _metadata(frames: Recording, window: Window) -> dict[str, Any]:
    """What is kept with a model of a recording."""
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


def learn(
    recording: Recording,
    rows: np.ndarray,
    encoder: str | None,
    readout: str | None,
    chosen: bool,
    period: float | None = None,
) -> tuple[Any, list[str]]:
    """A model trained on the frames `rows`, and a line on how it was chosen, if it was.

    Args:
        recording: of classes, or of values.
        rows: indices of the training frames.
        encoder, readout: names; None is that of a model without a choice.
        chosen: whether to choose both by cross-validation instead.
        period: of values that go round; None for those that do not.
    """
    from hdc.command.compare.frames import read_frames
    from hdc.encoders import make_encoder

    lines: list[str] = []
    images: Any
    if chosen:
        from hdc.command.compare.choose import choose

        frames = replace(read_frames(recording, rows=rows), period=period)
        combination, line = choose(frames)
        lines.append(line)
        encoder, readout = combination.encoder, combination.readout
        images = frames.bank.frames
    elif make_encoder(encoder or "median").learns:  # it reads all frames twice
        images = read_frames(recording, rows=rows).bank.frames
    else:
        images = Batches(recording, rows)
    model: Any
    if recording.values is not None:
        model = hdc.HDCRegressor(encoder or "median", readout or "ridge", period=period)
        model.fit(images, recording.values[rows])
    else:
        model = hdc.HDCClassifier(encoder or "median", readout or "majority")
        model.fit(images, np.array(recording.names)[rows])
    model._columns = list(recording.features) or None
    return model, lines


def would_try(learns_values: bool) -> str:
    """A line on the forms that ``--choose`` tries after the one without a choice."""
    from hdc.selection import combinations

    first, *others = combinations((), (), learns_values)
    listed = "; ".join(form.name for form in others)
    return f"--choose would try, besides {first.name}: {listed}"
