"""``hdc compare``: which encoder and read-out suit a recording, beside models of grey values."""

from __future__ import annotations

import json
from pathlib import Path

import click

from hdc.command import messages, options, work
from hdc.command.source import Source, pixels, recording
from hdc.readers import Window


@click.command(short_help="Choose a model for your images.")
@recording
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
@pixels
@click.option(
    "--test-fraction",
    type=options.SHARE,
    default=0.2,
    help="Share of frames to hold out.",
)
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
    source: Source,
    window: Window,
    other: Path | None,
    encoders: tuple[str, ...],
    readouts: tuple[str, ...],
    every: bool,
    budget: float | None,
    period: float | None,
    test_fraction: float,
    draws: int,
    figure: Path | None,
    as_json: bool,
) -> None:
    """Find the encoder and read-out for a RECORDING, and compare with models of grey values.

    Cross-validation of the training frames chooses encoder, read-out and the settings of the
    baselines, by group or session if there are several. The choice is tested on frames held out at
    random, and on later ones: the other recording, else the last sessions, else whole groups, else
    the last frames of each class. Each model has its training time, time per frame and size. The
    last lines have the line to type, its gain, the best baseline, and the cost of one grey level of
    rounding. Frames are held in memory.
    """
    if every and (encoders or readouts):
        raise click.UsageError("expected --all, or --encoder and --readout")
    from hdc.command.compare import budget as time
    from hdc.command.compare import curve, judge, show

    if figure is not None:
        curve.check_figure(figure)
    frames = source.open(window)
    work.check_circular(frames, period)
    if period is None and not as_json:
        for line in messages.circular_lines(frames):
            click.echo(line)
    tests = None if other is None else source.like(other).open(window)
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
    result["recording"] = str(source.path)
    result["command"] = source.training_line(window, *_parts(result["chosen"], period))
    if figure is not None:
        curve.draw(result, figure)
    if as_json:
        click.echo(json.dumps(result, ensure_ascii=False))
    else:
        click.echo("\n" + show.text(result))


def _parts(chosen: str, period: float | None) -> list[str]:
    """Options of the parts that were chosen."""
    encoder, readout = chosen.split(", ")
    around = [] if period is None else ["--circular", f"{period:.12g}"]
    return [*around, "--encoder", encoder, "--readout", readout]
