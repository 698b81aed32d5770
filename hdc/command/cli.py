"""Options of the command ``hdc``; :mod:`hdc.command.work` does the work.

torch takes seconds to import, so it is not imported before the words, and the files that they name,
were checked.
"""

from __future__ import annotations

import json
import os
from collections.abc import Callable
from functools import wraps
from pathlib import Path
from typing import Any

import click

import hdc
from hdc import readers
from hdc.readers.files import check_file, shown
from hdc.readers.listing import image_files, is_image

RATE = 0.05
"""Share of frames of known classes that ``--reject`` alone may refuse."""


class _File(click.ParamType[Path]):
    """A path as it is, blanks and brackets included; ``~`` is the home folder."""

    name = "path"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Path:
        if value == "":
            self.fail("expected a path, found nothing", param, ctx)
        return Path(os.path.expanduser(value))


class _Share(click.FloatRange):
    """A range of numbers that NaN is not in."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        number = super().convert(value, param, ctx)
        if number != number:
            self.fail(f"{value} is not in the range {self._describe_range()}.", param, ctx)
        return number


def _options(*options: Callable[..., Any]) -> Callable[..., Any]:
    """One decorator of several, in the order of the help."""

    def decorate(command: Callable[..., Any]) -> Callable[..., Any]:
        for option in reversed(options):
            command = option(command)
        return command

    return decorate


_recording = _options(
    click.argument("recording", type=_File()),
    click.option("--template", metavar="PATTERN",
                 help="Path of an image in the folder, such as '{session}/{label}/*_{order}.png'."),
    click.option("--values", "table", type=_File(), metavar="CSV",
                 help="Table of numbers to learn or compare with, a row an image."),
    click.option("--column", "columns", multiple=True, metavar="NAME",
                 help="Column of numbers; may be repeated. [default: all numeric ones]"),
    click.option("--image-column", default="image", metavar="NAME",
                 help="Column of the table that names the image."),
    click.option("--intervals", type=_File(), metavar="CSV",
                 help="Table of a video. [default: beside it]"),
)  # fmt: skip


def _pixels(command: Callable[..., Any]) -> Callable[..., Any]:
    """Options --crop and --subsample; the command gets them as one `window`."""

    @click.option("--crop", type=click.IntRange(0), nargs=4, metavar="X Y WIDTH HEIGHT",
                  help="Pixels to keep, from the top left corner. [default: all]")  # fmt: skip
    @click.option("--subsample", type=click.IntRange(1), default=1, metavar="N",
                  help="Keep every N-th pixel on both axes.")  # fmt: skip
    @wraps(command)
    def with_window(crop: tuple[int, ...] | None, subsample: int, **options: Any) -> Any:
        try:
            window = readers.Window(crop, subsample)
        except readers.SettingError as error:
            raise click.UsageError(f"--{error}") from error
        return command(window=window, **options)

    return with_window


_SHARE = _Share(0, 1, min_open=True, max_open=True)
_output = click.option(
    "-o", "--output", type=_File(), required=True, help="File to write the model to."
)
_model = click.argument("model", type=_File())
_json = click.option("--json", "as_json", is_flag=True, help="Write JSON.")
_reject = click.option(
    "--reject", type=_Share(0, 0.5, min_open=True), is_flag=False, flag_value=RATE,
    default=None, metavar="[RATE]",
    help="Refuse frames unlike every class; about this share of frames like those trained on is "
    f"refused, too ({RATE} if no number follows).",
)  # fmt: skip


@click.group(context_settings={"help_option_names": ["-h", "--help"], "show_default": True})
@click.version_option(hdc.__version__, prog_name="hdc", message="%(prog)s %(version)s")
def cli() -> None:
    """Train a hyperdimensional classifier of images, and use it.

    A RECORDING is a folder of images with one sub-folder a class, a manifest.csv (columns file,
    label), a --template or a table of --values; an .npz with frames [N, H, W] and labels [N]; or a
    video with a CSV table of intervals (columns start_s, end_s, label) beside it.
    """


@cli.command()
@_recording
@_output
@_pixels
@click.option("--test-fraction", type=_SHARE,
              help="Hold out this share: the last sessions if known, else at random.")  # fmt: skip
@click.option("--seed", type=click.IntRange(0), default=0, help="Choice of the frames held out.")
@click.option("--readout", type=click.Choice(["prototype", "ridge", "neighbours"]),
              help="How bits are read. [default: prototype; for numbers ridge]")  # fmt: skip
@click.option("--balance/--no-balance", default=None,
              help="Whether classes of unequal size count alike. [default: balanced]")  # fmt: skip
def train(
    recording: Path,
    output: Path,
    window: readers.Window,
    test_fraction: float | None,
    seed: int,
    readout: str | None,
    balance: bool | None,
    **source: Any,
) -> None:
    """Learn the classes of a RECORDING, or its numbers with --values."""
    readers.check_path(recording, source["intervals"])
    _check_output(output)
    from hdc.command import work

    frames = work.open_frames(recording, window, **source)
    click.echo(work.train(frames, window, output, test_fraction, seed, readout, balance))


@cli.command()
@_model
@click.argument("images", type=_File(), nargs=-1, required=True)
@_reject
@click.option("--json", "as_json", is_flag=True, help="One JSON object a line.")
def predict(model: Path, images: tuple[Path, ...], reject: float | None, as_json: bool) -> None:
    """Classify images.

    IMAGES are image files, videos, or folders, whose images and those of their sub-folders are
    taken. For each: file, label, margin (how much farther the second nearest class is) and the
    distance of each class, as shares of the pixels; 0.5 is the distance of noise.
    """
    _check_model(model)
    files = [file for image in images for file in _images(image)]
    from hdc.command import work

    for line in work.predict(model, files, reject, as_json):
        click.echo(line)


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
    _check_model(model)
    readers.check_path(recording, source["intervals"])
    from hdc.command import work

    click.echo(work.evaluate(model, recording, source, reject, as_json))


@cli.command()
@_model
@_recording
@_output
@click.option("--p", type=_Share(0, 1), default=0.5, help="Share of the new frames.")
@click.option("--method", type=click.Choice(["replace", "merge"]), default="replace",
              help="Replace bits with probability p, as published, or merge votes.")  # fmt: skip
@click.option("--seed", type=click.IntRange(0), default=0, help="Choice of the bits replaced.")
def recalibrate(
    model: Path, recording: Path, output: Path, p: float, method: str, seed: int, **source: Any
) -> None:
    """Adapt a model to a changed sensor.

    The new RECORDING is of some or all of the classes of the model.
    """
    _check_model(model)
    readers.check_path(recording, source["intervals"])
    _check_output(output)
    from hdc.command import work

    click.echo(work.recalibrate(model, recording, source, output, p, method, seed))


@cli.command()
@_recording
@click.option("--test", "other", type=_File(), metavar="RECORDING",
              help="Test on this recording, of another day.")  # fmt: skip
@click.option("-o", "--output", type=_File(), help="File to write a page of HTML to.")
@_pixels
@click.option("--test-fraction", type=_SHARE, default=0.2, help="Share of frames to hold out.")
@click.option("--draws", type=click.IntRange(1, 100), default=5, metavar="N",
              help="Random choices of frames at each number a class.")  # fmt: skip
@_json
def compare(
    recording: Path,
    other: Path | None,
    output: Path | None,
    window: readers.Window,
    test_fraction: float,
    draws: int,
    as_json: bool,
    **source: Any,
) -> None:
    """Compare read-outs of bits and grey values on a RECORDING.

    Accuracy for 1, 2, 5 … frames a class, held out at random and by time, and advice. Frames are
    held in memory.
    """
    if output:
        _check_page(output)
    for path in filter(None, (recording, other)):
        readers.check_path(path, source["intervals"])
    from hdc.command import comparison, work

    frames = work.open_frames(recording, window, **source)
    tests = work.open_frames(other, window, **source) if other else None
    result = comparison.compare(frames, tests, recording, test_fraction, draws)
    if output:
        comparison.write_page(output, result)
    click.echo(json.dumps(result, ensure_ascii=False) if as_json else comparison.text(result))


@cli.command()
@click.option("--camera", type=click.IntRange(0), metavar="N", help="Number of the camera.")
@click.option("--folder", type=_File(), metavar="RECORDING", help="Play this back instead.")
@_pixels
@click.option("--host", metavar="ADDRESS", help="Listen there; a token is then asked of everybody. "
              "[default: this computer alone]")  # fmt: skip
@click.option("--port", type=click.IntRange(1, 65535), default=8080)
def live(
    camera: int | None,
    folder: Path | None,
    window: readers.Window,
    host: str | None,
    port: int,
) -> None:
    """Teach a model in the browser.

    A page shows the frames of a camera, or of a RECORDING played back, and what the model says.
    """
    if (camera is None) == (folder is None):
        raise click.UsageError("expected one of --camera and --folder")
    from hdc.live import Camera, Recorded, Source
    from hdc.live.page import serve

    source: Source
    if folder is not None:
        source = Recorded(folder, window)
    else:
        assert camera is not None
        try:
            source = Camera(camera, window)
        except ValueError as error:
            raise click.UsageError(str(error)) from error
    serve(source, host, port)


@cli.command()
@_model
@_json
def info(model: Path, as_json: bool) -> None:
    """Show what a model was trained on."""
    _check_model(model)
    from hdc.command import work

    click.echo(work.info(model, as_json))


# Checks before anything is read -----------------------------------------------------------------


def _check_model(path: Path) -> None:
    if not path.exists():
        raise ValueError(f"{shown(path)}: expected a saved model, found no such file")
    if path.is_file() and is_image(path.name):
        raise ValueError(
            f"{shown(path)}: expected a saved model, found an image; the model is first"
        )


def _check_output(path: Path) -> None:
    """Refuse a name that cannot be written, or that is taken by anything but a saved model."""
    if not path.parent.is_dir():
        raise ValueError(f"{shown(path)}: expected a folder to write into, found none")
    from hdc.io import check_replaceable

    check_replaceable(path)


def _check_page(path: Path) -> None:
    """As :func:`_check_output`, for a page of ``hdc compare``."""
    if not os.path.lexists(path):
        return _check_output(path)
    if path.is_symlink() or not path.is_file() or b"<title>hdc compare" not in path.read_bytes():
        raise ValueError(
            f"{shown(path)}: expected a page of hdc compare or no file, found another; not replaced"
        )


def _images(path: Path) -> list[Path]:
    if path.is_dir():
        return image_files(path)
    check_file(path)
    return [path]
