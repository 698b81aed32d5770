"""``hdc train``: a model of a recording."""

from __future__ import annotations

from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import click

import hdc
from hdc.command import holdout, messages, options, scores, work
from hdc.io import check_replaceable
from hdc.readers import Window


@click.command(short_help="Train a model on labelled images.")
@options.recording
@options.output
@options.pixels
@click.option(
    "--test-fraction",
    type=options.SHARE,
    help="Share of frames to hold out: the last sessions if known, else at random.",
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
    recording: Path,
    output: Path,
    crop: tuple[int, ...] | None,
    subsample: int,
    test_fraction: float | None,
    encoder: str | None,
    readout: str | None,
    choose: bool,
    period: float | None,
    **source: Any,
) -> None:
    """Learn the classes of a RECORDING, or its numbers with --values."""
    if choose and (encoder or readout):
        raise click.UsageError("expected --choose, or --encoder and --readout")
    from hdc.command.learn import learn, would_try  # late: torch takes seconds

    window = Window(crop, subsample)
    frames = work.open_frames(recording, window, **source)
    work.check_circular(frames, period)
    check_replaceable(output)
    training, test, how = holdout.hold_out(frames, test_fraction)
    model, chosen_line = learn(frames, training, encoder, readout, choose, period)
    metadata: dict[str, Any] = {"crop": window.crop, "subsample": window.subsample}
    if frames.values is not None:
        metadata["values"] = list(frames.value_names)
    if any(frames.value_units):
        metadata["units"] = list(frames.value_units)
    metadata["trained"] = datetime.now(UTC).isoformat(timespec="seconds")
    metadata["version"] = hdc.__version__
    model.save(output, metadata=metadata)
    click.echo(
        f"{output}: {len(training)} frames, {messages.learnt(frames)}, "
        f"{messages.size(frames.frame_shape)}"
    )
    if chosen_line:
        click.echo(chosen_line)
    if frames.values is None:
        click.echo(messages.class_line(frames, training))
    click.echo(messages.session_line(frames))
    if len(test):
        click.echo(f"held out {how}: {scores.score(model, frames, test)['text'][0]}")
        click.echo(messages.guess_line(frames, training, test, period))
        if not (encoder or readout or choose):
            click.echo(would_try(frames.values is not None))
    if how == "at random":
        click.echo(f"held out at random because {holdout.why_random(frames)}")
    hints = messages.circular_lines(frames) if period is None else []
    for line in [*messages.reading_line(frames), *hints]:
        click.echo(line)
