"""The commands of ``hdc``, a function each; :mod:`hdc.command.work` has what they share.

torch takes seconds to import, so it is imported when the first frame is learnt or asked about.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import click
import numpy as np

import hdc
from hdc.command import answers, work
from hdc.command.export import export
from hdc.io import check_replaceable
from hdc.readers import Window
from hdc.readers.batches import Batches
from hdc.readers.listing import image_files

RATE = 0.05
"""Share of frames of known classes that ``--reject`` alone may refuse."""
_FILE = click.Path(path_type=Path)
_SHARE = click.FloatRange(0, 1, min_open=True, max_open=True)


def _options(*options: Callable[..., Any]) -> Callable[..., Any]:
    """One decorator of several, in the order of the help."""

    def decorate(command: Any) -> Any:
        for option in reversed(options):
            command = option(command)
        return command

    return decorate


_recording = _options(
    click.argument("recording", type=_FILE),
    click.option(
        "--template",
        metavar="PATTERN",
        help="Path of an image in the folder, such as '{session}/{label}/*_{order}.png'.",
    ),
    click.option(
        "--values",
        "table",
        type=_FILE,
        metavar="CSV",
        help="Table of numbers to learn or compare with, a row per image or frame.",
    ),
    click.option(
        "--column",
        "value_columns",
        multiple=True,
        metavar="NAME",
        help="Column of numbers; may be repeated. [default: all numeric ones]",
    ),
    click.option(
        "--image-column",
        default="image",
        metavar="NAME",
        help="Column of the table that names the image.",
    ),
)
_pixels = _options(
    click.option(
        "--crop",
        type=click.IntRange(0),
        nargs=4,
        metavar="X Y WIDTH HEIGHT",
        help="Pixels to keep, from the top left corner. [default: all]",
    ),
    click.option(
        "--subsample",
        type=click.IntRange(1),
        default=1,
        metavar="N",
        help="Keep every N-th pixel on both axes.",
    ),
)
_output = click.option(
    "-o", "--output", type=_FILE, required=True, help="File to write the model to."
)
_model = click.argument("model", type=_FILE)
_json = click.option("--json", "as_json", is_flag=True, help="Write JSON.")
_reject = click.option(
    "--reject",
    type=click.FloatRange(0, 0.5, min_open=True),
    is_flag=False,
    flag_value=RATE,
    default=None,
    metavar="[RATE]",
    help="Refuse frames unlike every class; about this share of frames like those trained on is "
    f"refused, too ({RATE} if no number follows).",
)


@click.group(
    context_settings={"help_option_names": ["-h", "--help"], "show_default": True}
)
@click.version_option(hdc.__version__, prog_name="hdc", message="%(prog)s %(version)s")
def cli() -> None:
    """Train a hyperdimensional classifier of images, and use it.

    A RECORDING is a folder of images with one sub-folder per class, a manifest.csv (columns file,
    label), a --template or a table of --values; an .npz with frames [N, H, W] or [N, D] and labels
    or values [N]; a .csv with a row of numbers and a label per frame; or a video with a CSV table
    of intervals (columns start_s, end_s, label) beside it, or with a table of --values.
    """


@cli.command()
@_recording
@_output
@_pixels
@click.option(
    "--test-fraction",
    type=_SHARE,
    help="Hold out this share: the last sessions if known, else at random.",
)
@click.option(
    "--encoder",
    default="median",
    metavar="NAME",
    help="How frames become bits: median, quantile, levels, reference, or a module.Class.",
)
@click.option(
    "--readout",
    metavar="NAME",
    help="How bits are read: majority, counts, ridge, neighbours, lda, trained, or "
    "a module.Class; for numbers ridge or neighbours. [default: majority; for numbers ridge]",
)
def train(
    recording: Path,
    output: Path,
    crop: tuple[int, ...] | None,
    subsample: int,
    test_fraction: float | None,
    encoder: str,
    readout: str | None,
    **source: Any,
) -> None:
    """Learn the classes of a RECORDING, or its numbers with --values."""
    window = Window(crop, subsample)
    frames = work.open_frames(recording, window, **source)
    check_replaceable(output)
    training, test, how = work.hold_out(frames, test_fraction)
    batches = Batches(frames, training)
    metadata: dict[str, Any] = {"crop": window.crop, "subsample": window.subsample}
    if frames.values is not None:
        model: Any = hdc.HDCRegressor(encoder, readout or "ridge")
        model.fit(batches, frames.values[training])
        metadata["values"] = list(frames.value_names)
        if any(frames.value_units):
            metadata["units"] = list(frames.value_units)
        named = work.with_units(frames.value_names, frames.value_units)
        learnt = f"values of {', '.join(named)}"
    else:
        model = hdc.HDCClassifier(encoder, readout or "majority")
        model.fit(batches, np.array(frames.names)[training])
        learnt = f"{len(frames.classes)} classes"
    metadata["trained"] = datetime.now(UTC).isoformat(timespec="seconds")
    metadata["version"] = hdc.__version__
    model.save(output, metadata=metadata)
    click.echo(f"{output}: {len(training)} frames, {learnt}, {work.size(frames.shape)}")
    if frames.values is None:
        click.echo(work.class_line(frames, training))
    click.echo(work.session_line(frames))
    if len(test):
        click.echo(f"held out {how}: {answers.score(model, frames, test)['text'][0]}")
    if how == "at random":
        click.echo(f"held out at random because {work.why_random(frames)}")


@cli.command()
@_model
@click.argument("images", type=_FILE, nargs=-1, required=True)
@_reject
@_json
def predict(
    model: Path, images: tuple[Path, ...], reject: float | None, as_json: bool
) -> None:
    """Classify images.

    IMAGES are image files, videos, arrays or tables of frames, or folders, whose images and those
    of their sub-folders are taken. For each: file, label, margin (how much farther the second
    nearest class is) and the distance of each class, as shares of the pixels; 0.5 is the distance
    of noise.
    """
    found, window = work.load(model)
    files: list[Path] = []
    for path in images:
        if path.is_dir():
            files += image_files(path)
        else:
            files.append(path)
    for number, answer in enumerate(answers.ask(found, window, files, reject)):
        if as_json:
            click.echo(json.dumps(answer, ensure_ascii=False))
            continue
        if number == 0:
            click.echo("\t".join(answers.heads(found, answer)))
        click.echo("\t".join(answers.cells(answer)))


@cli.command()
@_model
@_recording
@_reject
@_json
def evaluate(
    model: Path, recording: Path, reject: float | None, as_json: bool, **source: Any
) -> None:
    """Measure accuracy and confusions on a RECORDING.

    The interval of the accuracy is Wilson's, for 95 %.
    """
    found, window = work.load(model)
    frames = work.frames_for(found, window, recording, source)
    result = answers.score(found, frames, np.arange(len(frames)), reject)
    lines = result.pop("text")
    if as_json:
        click.echo(json.dumps(result, ensure_ascii=False))
    else:
        click.echo("\n".join(lines))


@cli.command()
@_model
@_recording
@_output
@click.option(
    "--p", type=click.FloatRange(0, 1), default=0.5, help="Share of the new frames."
)
@click.option(
    "--method",
    type=click.Choice(["replace", "merge"]),
    default="replace",
    help="Replace bits with probability p, as published, or merge votes.",
)
@click.option(
    "--seed", type=click.IntRange(0), default=0, help="Choice of the bits replaced."
)
def recalibrate(
    model: Path,
    recording: Path,
    output: Path,
    p: float,
    method: str,
    seed: int,
    **source: Any,
) -> None:
    """Adapt a model to a changed sensor.

    The new RECORDING is of some or all of the classes of the model.
    """
    check_replaceable(output)
    found, window = work.load(model)
    if not hasattr(found, "classes_"):
        raise ValueError(
            f"{model}: expected a classifier, found {type(found).__name__}"
        )
    frames = work.frames_for(found, window, recording, source)
    by_name = {str(c): c for c in found.classes_.tolist()}
    labels = [by_name[name] for name in frames.names]
    batches = Batches(frames, np.arange(len(frames)))
    found.recalibrate(batches, labels, p, seed, method)
    found.save(output)
    names, counts = np.unique(frames.names, return_counts=True)
    new = f"{len(frames)} new frames of {len(names)} classes, at least {counts.min()} of each"
    click.echo(f"{output}: {new}, {method}, p = {p:g}")
    if old := sorted({*by_name} - {*names}):
        click.echo(f"not recalibrated: {', '.join(old)}")


@cli.command()
@_recording
@click.option(
    "--test",
    "other",
    type=_FILE,
    metavar="RECORDING",
    help="Test on this recording, of another day.",
)
@_pixels
@click.option(
    "--test-fraction", type=_SHARE, default=0.2, help="Share of frames to hold out."
)
@click.option(
    "--draws",
    type=click.IntRange(1, 100),
    default=5,
    metavar="N",
    help="Random choices of frames at each number per class.",
)
@_json
def compare(
    recording: Path,
    other: Path | None,
    crop: tuple[int, ...] | None,
    subsample: int,
    test_fraction: float,
    draws: int,
    as_json: bool,
    **source: Any,
) -> None:
    """Compare read-outs of bits and grey values on a RECORDING.

    Accuracy for 1, 2, 5 … frames per class, held out at random and by time, and advice. Frames are
    held in memory.
    """
    from hdc.command import comparison

    window = Window(crop, subsample)
    frames = work.open_frames(recording, window, **source)
    tests = None
    if other is not None:
        tests = work.open_frames(other, window, **source)
    result = comparison.compare(frames, tests, recording, test_fraction, draws)
    if as_json:
        click.echo(json.dumps(result, ensure_ascii=False))
    else:
        click.echo(comparison.text(result))


@cli.command()
@click.argument("model", type=_FILE, required=False)
@click.option(
    "--camera", type=click.IntRange(0), metavar="N", help="Number of the camera."
)
@click.option(
    "--folder", type=_FILE, metavar="RECORDING", help="Play this back instead."
)
@click.option("--video", type=_FILE, metavar="FILE", help="Play this, without labels.")
@_pixels
@click.option(
    "--host", metavar="ADDRESS", help="Listen there. [default: this computer alone]"
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
@_model
def info(model: Path) -> None:
    """Show what a model was trained on, as JSON."""
    found, _ = work.load(model)
    rows: dict[str, Any] = {
        "kind": type(found).__name__,
        "encoder": repr(found.encoder_),
        "readout": repr(found.readout_),
        "frames": work.size(found.frame_shape_),
        **found.metadata_,
    }
    if hasattr(found, "classes_"):
        counts = zip(found.classes_, found.counts_, strict=True)
        rows["classes"] = {str(c): int(n) for c, n in counts}
    click.echo(json.dumps(rows, ensure_ascii=False, indent=2))


cli.add_command(export)
