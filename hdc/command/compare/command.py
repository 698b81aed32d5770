"""``hdc compare``: which encoder and read-out suit a recording, beside models of grey values."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import click

from hdc.command import messages, options, work
from hdc.readers import Window


@click.command(short_help="Choose a model for your images.")
@options.recording
@click.option(
    "--test",
    "other",
    type=options.FILE,
    metavar="RECORDING",
    help="Test on this recording, of another day.",
)
@click.option(
    "--encoder",
    "encoders",
    multiple=True,
    metavar="NAME",
    help="Choose among this encoder, or a module.Class; may be repeated. [default: a short list]",
)
@click.option(
    "--readout",
    "readouts",
    multiple=True,
    metavar="NAME",
    help="Choose among this read-out, or a module.Class; may be repeated. [default: a short list]",
)
@click.option(
    "--all",
    "every",
    is_flag=True,
    help="After the short list, try every encoder with every read-out of the library.",
)
@click.option(
    "--budget",
    type=click.FloatRange(0, min_open=True),
    metavar="MINUTES",
    help="Stop after about this time with what is done; promising forms are tried first. "
    "[default: as long as it takes]",
)
@options.circular
@options.pixels
@options.fraction
@click.option(
    "--draws",
    type=click.IntRange(1, 100),
    default=3,
    metavar="N",
    help="Random choices of frames at each point of the learning curve.",
)
@click.option(
    "-o",
    "--output",
    "figure",
    type=options.FILE,
    metavar="FILE",
    help="Draw the learning curve: .svg, .pdf or .png.",
)
@options.json
def compare(
    recording: Path,
    other: Path | None,
    encoders: tuple[str, ...],
    readouts: tuple[str, ...],
    every: bool,
    budget: float | None,
    period: float | None,
    crop: tuple[int, ...] | None,
    subsample: int,
    test_fraction: float,
    draws: int,
    figure: Path | None,
    as_json: bool,
    **source: Any,
) -> None:
    """Find the encoder and read-out for a RECORDING, and compare with models of grey values.

    Cross-validation of the training frames chooses encoder, read-out and the settings of the
    baselines, by session if there are several. The choice is tested on frames held out at random,
    and on later ones: the other recording, else the last sessions, else the last frames of each
    class. Each model has its training time, time per frame and size. The last lines have the line
    to type, its gain, the best baseline, and the cost of one grey level of rounding. Frames are
    held in memory.
    """
    if every and (encoders or readouts):
        raise click.UsageError("expected --all, or --encoder and --readout")
    from hdc.command.compare import budget as time
    from hdc.command.compare import curve, judge, show

    if figure is not None:
        curve.check_figure(figure)
    window = Window(crop, subsample)
    frames = work.open_frames(recording, window, **source)
    work.check_circular(frames, period)
    if period is None and not as_json:
        for line in messages.circular_lines(frames):
            click.echo(line)
    tests = None
    if other is not None:
        tests = work.open_frames(other, window, **source)
    result = judge.compare(
        frames,
        tests,
        test_fraction,
        draws,
        encoders,
        readouts,
        every,
        time.Budget(budget),
        period,
        (lambda _: None) if as_json else click.echo,
    )
    chosen = result["chosen"].split(", ")
    result["recording"] = str(recording)
    result["command"] = messages.command_line(
        recording, window, source, chosen[0], chosen[1], period
    )
    if figure is not None:
        curve.draw(result, figure)
    if as_json:
        click.echo(json.dumps(result, ensure_ascii=False))
    else:
        click.echo("\n" + show.text(result))
