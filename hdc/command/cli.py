"""The commands of ``hdc``, a function each; :mod:`hdc.command.work` has what they share.

torch takes seconds to import, so it is imported when the first frame is learnt or asked about.
"""

from __future__ import annotations

import json
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import click
import numpy as np

import hdc
from hdc.command import answers, options, work
from hdc.command.export import export
from hdc.command.look import look
from hdc.command.sample import sample
from hdc.io import check_replaceable
from hdc.readers import Recording, Window
from hdc.readers.batches import Batches
from hdc.readers.listing import image_files


@click.group(
    context_settings={"help_option_names": ["-h", "--help"], "show_default": True}
)
@click.version_option(hdc.__version__, prog_name="hdc", message="%(prog)s %(version)s")
def cli() -> None:
    """Train a hyperdimensional classifier of images, and use it.

    A RECORDING is a folder of images with one sub-folder per class, a manifest.csv (columns file,
    label), a --template or a table of --values; frames [N, H, W] or [N, D] with labels or values
    [N] in an .npz, .mat or .h5, or in a TIFF or .npy with a CSV beside it; a .parquet with a column
    of images; a .csv with a row of numbers and a label per frame; or a video with a CSV table of
    intervals (columns start_s, end_s, label) beside it. hdc look RECORDING shows how it is read.
    """


@cli.command()
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
    "frames; by session where there are sessions. Frames are held in memory.",
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
    training, test, how = work.hold_out(frames, test_fraction)
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
        f"{output}: {len(training)} frames, {work.learnt(frames)}, {work.size(frames.frame_shape)}"
    )
    if chosen_line:
        click.echo(chosen_line)
    if frames.values is None:
        click.echo(work.class_line(frames, training))
    click.echo(work.session_line(frames))
    if len(test):
        click.echo(f"held out {how}: {answers.score(model, frames, test)['text'][0]}")
        click.echo(work.guess_line(frames, training, test, period))
        if not (encoder or readout or choose):
            click.echo(would_try(frames.values is not None))
    if how == "at random":
        click.echo(f"held out at random because {work.why_random(frames)}")
    hints = work.circular_lines(frames) if period is None else []
    for line in [*work.reading_line(frames), *hints]:
        click.echo(line)


@cli.command()
@options.model
@click.argument("images", type=options.FILE, nargs=-1, required=True)
@options.axes
@options.reject
@options.interval
@click.option(
    "--proba",
    is_flag=True,
    help="Also the probability of the best class; with --json those of all classes.",
)
@options.json
def predict(
    model: Path,
    images: tuple[Path, ...],
    axes: tuple[str, ...] | None,
    reject: float | None,
    interval: float | None,
    proba: bool,
    as_json: bool,
) -> None:
    """Classify images, or predict their numbers.

    IMAGES are image files, videos, arrays or tables of frames, or folders, whose images and those
    of their sub-folders are taken. For each: file and label; with the read-out majority also the
    margin (how much farther the second nearest class is) and the distance of each class, as shares
    of the bits: unrelated frames differ in half of them. With --interval also lower and upper ends
    of each number, or all classes that the frame may be of; none where it is like no class.
    Probabilities are calibrated by the training frames, and hold for frames that come as these did.
    """
    found, window = work.load(model)
    files: list[Path] = []
    for path in images:
        if path.is_dir():
            files += image_files(path)
        else:
            files.append(path)
    for number, answer in enumerate(
        answers.ask(found, window, files, reject, interval, proba, axes)
    ):
        if as_json:
            click.echo(json.dumps(answer, ensure_ascii=False))
            continue
        if number == 0:
            click.echo("\t".join(answers.heads(found, answer)))
        click.echo("\t".join(answers.cells(answer)))


@cli.command()
@options.model
@options.recording
@options.reject
@options.interval
@options.json
def evaluate(
    model: Path,
    recording: Path,
    reject: float | None,
    interval: float | None,
    as_json: bool,
    **source: Any,
) -> None:
    """Measure accuracy and confusions on a RECORDING, or errors of its numbers.

    The interval of the accuracy is Wilson's, for 95 %. With --interval 0.9 the command counts how
    often the truth lay in intervals or sets that are made to hold it for 90 % of the frames, if
    these come as the training frames did: the coverage says what that is worth on this RECORDING.
    """
    found, window = work.load(model)
    frames = work.frames_for(found, window, recording, source)
    result = answers.score(found, frames, np.arange(len(frames)), reject, interval)
    lines = result.pop("text")
    if as_json:
        click.echo(json.dumps(result, ensure_ascii=False))
    else:
        click.echo("\n".join(lines))


@cli.command()
@options.model
@options.recording
@options.output
@click.option(
    "--p",
    type=click.FloatRange(0, 1),
    help="Probability that a bit is replaced, or share of the new votes or discriminants. "
    "[default: 0.5]",
)
@click.option(
    "--method",
    type=click.Choice(["replace", "merge"]),
    help="Replace bits with probability p, as published, or merge votes, the "
    "only way of a model with the read-out counts. [default: replace]",
)
@click.option(
    "--seed", type=click.IntRange(0), help="Choice of the bits replaced. [default: 0]"
)
def recalibrate(
    model: Path,
    recording: Path,
    output: Path,
    p: float | None,
    method: str | None,
    seed: int | None,
    **source: Any,
) -> None:
    """Adapt a model to a changed sensor.

    The new RECORDING is of some or all of the classes of the model. A model with the read-out
    trained does not adapt by labels: train it anew.

    A model with --encoder reference can do without labels: the RECORDING is then a folder of images
    without sub-folders, or an array of frames without labels, and its mean frame becomes the new
    reference. It has to show the classes about as often as the training frames did. Frames of one
    class alone, or without a touch, can spoil the model; a warning says so if the model puts the
    frames into few classes.
    """
    check_replaceable(output)
    found, window = work.load(model)
    if not hasattr(found, "classes_"):
        raise ValueError(
            f"{model}: expected a classifier, found {type(found).__name__}"
        )
    without_labels = work.unlabelled_frames(found, window, recording, source)
    if without_labels is not None:
        if not (p is None and method is None and seed is None):
            raise click.UsageError(
                "expected no --p, --method or --seed for frames without labels"
            )
        found.rezero(without_labels)
        found.save(output)
        n = len(without_labels)
        click.echo(f"{output}: zeroed by {n} new frames without labels")
        return
    frames = work.frames_for(found, window, recording, source)
    share = 0.5 if p is None else p
    _learn_anew(found, frames, output, share, method or "replace", seed or 0)


def _learn_anew(
    found: Any,
    frames: Recording,
    output: Path,
    share: float,
    method: str,
    seed: int,
) -> None:
    """Recalibrate a model by labelled frames, save it, and say by what."""
    by_name = {str(c): c for c in found.classes_.tolist()}
    labels = [by_name[name] for name in frames.names]
    batches = Batches(frames, np.arange(len(frames)))
    found.recalibrate(batches, labels, share, seed, method)
    found.save(output)
    names, counts = np.unique(frames.names, return_counts=True)
    new = f"{len(frames)} new frames of {len(names)} classes, at least {counts.min()} of each"
    click.echo(f"{output}: {new}, {method}, p = {share:g}")
    if old := sorted({*by_name} - {*names}):
        click.echo(f"not recalibrated: {', '.join(old)}")


@cli.command()
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

    Encoder and read-out are chosen by cross-validation of the training frames, by session where
    there are two or more, and so are the settings of the rivals. Frames held out at random, and
    later ones (the other recording, else the last sessions, else the last frames of each class)
    only judge the choice. Each model has its training time, time a frame and size. The last lines
    say what to type, what that wins, whether a rival outside the library is better, and what one
    grey level of rounding costs. Frames are held in memory.
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
        for line in work.circular_lines(frames):
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
    result["command"] = work.command_line(
        recording, window, source, chosen[0], chosen[1], period
    )
    if figure is not None:
        curve.draw(result, figure)
    if as_json:
        click.echo(json.dumps(result, ensure_ascii=False))
    else:
        click.echo("\n" + show.text(result))


@cli.command()
@click.argument("model", type=options.FILE, required=False)
@click.option(
    "--camera", type=click.IntRange(0), metavar="N", help="Number of the camera."
)
@click.option(
    "--folder", type=options.FILE, metavar="RECORDING", help="Play this back instead."
)
@click.option(
    "--video", type=options.FILE, metavar="FILE", help="Play this, without labels."
)
@options.pixels
@click.option(
    "--host",
    metavar="ADDRESS",
    help="Listen at this address. [default: this computer alone]",
)
@click.option("--port", type=click.IntRange(1, 65535), default=8080)
def live(
    model: Path | None,
    camera: int | None,
    folder: Path | None,
    video: Path | None,
    crop: tuple[int, ...] | None,
    subsample: int,
    host: str | None,
    port: int,
) -> None:
    """Teach a model in the browser, or watch a MODEL that was trained.

    A page shows the frames of a camera, or of a RECORDING or a video played back, and what the
    model says. A MODEL has its own crop and subsampling.
    """
    if sum(given is not None for given in (camera, folder, video)) != 1:
        raise click.UsageError("expected one of --camera, --folder and --video")
    if model is not None and (crop is not None or subsample != 1):
        raise click.UsageError("expected no --crop or --subsample with a MODEL")
    from hdc.live import open_source
    from hdc.live.page import serve

    trained = None
    window = Window(crop, subsample)
    if model is not None:
        trained, window = work.load(model)
    source = open_source(window, folder, video, camera or 0)
    if trained is not None:
        work.check_size(trained, source.shape, source.title)
    serve(source, host, port, trained)


@cli.command()
@options.model
def info(model: Path) -> None:
    """Show what a model was trained on, how it sees frames, and what it takes, as JSON."""
    found, _ = work.load(model)
    click.echo(json.dumps(work.described(found, model), ensure_ascii=False, indent=2))


cli.add_command(export)
cli.add_command(look)
cli.add_command(sample)
