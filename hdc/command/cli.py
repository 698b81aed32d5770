"""What can be typed after ``hdc``; what it does is in :mod:`hdc.command.work`.

torch takes seconds to import, so it is not imported before the words, and the files that they name,
were looked at.
"""

from __future__ import annotations

import os
import tempfile
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import click

import hdc
from hdc import readers
from hdc.readers.files import file_size, shown
from hdc.readers.listing import image_files

RATE = 0.01
"""Share of frames of known classes that --reject alone may lose; that of ``predict``."""


class _File(click.ParamType[Path]):
    """A path as it is, blanks and brackets included; ``~`` is the home folder."""

    name = "path"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Path:
        return Path(os.path.expanduser(value))


class _OptionalRate(click.Command):
    """``--reject`` with or without a number after it, which click would take for its value."""

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        for i, word in enumerate(args):
            if word == "--reject" and not _is_number(args[i + 1 : i + 2]):
                args[i] = f"--reject={RATE}"
        return super().parse_args(ctx, args)


def _is_number(words: Sequence[str]) -> bool:
    try:
        return bool(words) and float(words[0]) is not None
    except ValueError:
        return False


def _recording(command: Callable[..., Any]) -> Callable[..., Any]:
    """The argument and option of all that read labelled frames."""
    argument = click.argument("recording", type=_File())
    option = click.option(
        "--intervals", type=_File(), metavar="CSV", help="Table of a video. [default: beside it]"
    )
    return argument(option(command))


def _pixels(command: Callable[..., Any]) -> Callable[..., Any]:
    """Which pixels of an image are kept."""
    crop = click.option(
        "--crop", type=click.IntRange(0), nargs=4, metavar="X Y WIDTH HEIGHT",
        help="Pixels to keep, from the top left corner. [default: all]",
    )  # fmt: skip
    subsample = click.option(
        "--subsample", type=click.IntRange(1), default=1, metavar="N",
        help="Keep every N-th pixel on both axes.",
    )  # fmt: skip
    return crop(subsample(command))


def _window(crop: tuple[int, ...] | None, subsample: int) -> readers.Window:
    try:
        return readers.Window(crop, subsample)
    except readers.SettingError as error:
        raise click.UsageError(f"--{error}") from error


_SHARE = click.FloatRange(0, 1, min_open=True, max_open=True)

_output = click.option(
    "-o", "--output", type=_File(), required=True, help="File to write the model to."
)
_model = click.argument("model", type=_File())


@click.group(context_settings={"help_option_names": ["-h", "--help"], "show_default": True})
@click.version_option(hdc.__version__, prog_name="hdc", message="%(prog)s %(version)s")
def cli() -> None:
    """Train a hyperdimensional classifier of images, and use it.

    A RECORDING is a folder with one sub-folder of images a class, or with a manifest.csv (columns
    file, label); an .npz with frames [N, H, W] and labels [N]; or a video with a CSV table of
    intervals (columns start_s, end_s, label) beside it.
    """


@cli.command()
@_recording
@_output
@_pixels
@click.option("--test-fraction", type=_SHARE,
              help="Hold out this share of each class, and tell the accuracy on it.")  # fmt: skip
@click.option("--seed", type=click.IntRange(0), default=0, help="Choice of the frames held out.")
def train(
    recording: Path,
    output: Path,
    intervals: Path | None,
    crop: tuple[int, ...] | None,
    subsample: int,
    test_fraction: float | None,
    seed: int,
) -> None:
    """Learn the classes of a RECORDING.

    Each of its files is read once.
    """
    window = _window(crop, subsample)
    _check_output(output)
    readers.check_path(recording, intervals)
    from hdc.command import work

    stream = readers.open_stream(recording, intervals, readers.Options(window))
    click.echo(work.train(stream, window, output, test_fraction, seed))


@cli.command(cls=_OptionalRate)
@_model
@click.argument("images", type=_File(), nargs=-1, required=True)
@click.option("--reject", type=click.FloatRange(0, 0.5, min_open=True), metavar="[RATE]",
              help="Answer none for images like no class; about this share of those of known "
              f"classes is lost ({RATE} if no number is given).")  # fmt: skip
@click.option("--json", "as_json", is_flag=True, help="One JSON object a line.")
def predict(model: Path, images: tuple[Path, ...], reject: float | None, as_json: bool) -> None:
    """Classify images.

    IMAGES are files, or folders, whose images and those of their sub-folders are taken. For each:
    file, label, margin (how much farther the second nearest class is) and the distance of each
    class, as shares of the pixels; 0.5 is the distance of noise.
    """
    _check_model(model)
    files = [file for image in images for file in _images(image)]
    from hdc.command import work

    for line in work.predict(model, files, reject, as_json):
        click.echo(line)


@cli.command()
@_model
@_recording
def evaluate(model: Path, recording: Path, intervals: Path | None) -> None:
    """Tell accuracy and confusions on a RECORDING.

    The interval of the accuracy is Wilson's, for 95 %.
    """
    _check_model(model)
    readers.check_path(recording, intervals)
    from hdc.command import work

    click.echo(work.evaluate(model, recording, intervals))


@cli.command()
@_model
@_recording
@_output
@click.option("--p", type=click.FloatRange(0, 1), default=0.5, help="Share of the new frames.")
@click.option("--method", type=click.Choice(["replace", "merge"]), default="replace",
              help="Replace bits with probability p, as published, or merge votes.")  # fmt: skip
@click.option("--seed", type=click.IntRange(0), default=0, help="Choice of the bits replaced.")
def recalibrate(
    model: Path,
    recording: Path,
    output: Path,
    intervals: Path | None,
    p: float,
    method: str,
    seed: int,
) -> None:
    """Adapt a model to a changed sensor.

    The new RECORDING is of some or all of the classes of the model.
    """
    _check_output(output)
    _check_model(model)
    readers.check_path(recording, intervals)
    from hdc.command import work

    click.echo(work.recalibrate(model, recording, intervals, output, p, method, seed))


@cli.command()
@_recording
@click.option("-o", "--output", type=_File(), help="File to write a page of HTML to.")
@_pixels
@click.option("--test-fraction", type=_SHARE, default=0.2,
              help="Share of each class to hold out at random.")  # fmt: skip
@click.option("--seeds", type=click.IntRange(1, 100), default=3, metavar="N",
              help="How often other frames are held out.")  # fmt: skip
@click.option("--json", "as_json", is_flag=True, help="One JSON object instead of the table.")
def compare(
    recording: Path,
    output: Path | None,
    intervals: Path | None,
    crop: tuple[int, ...] | None,
    subsample: int,
    test_fraction: float,
    seeds: int,
    as_json: bool,
) -> None:
    """Compare classifiers on a RECORDING.

    HDC, ridge and softmax regression and a small network: accuracy on frames held out, times,
    sizes; with -o a page with learning curve and confusions, too. Frames are held in memory.
    """
    window = _window(crop, subsample)
    if output:
        _check_output(output)
    readers.check_path(recording, intervals)
    if output:
        with _fonts_elsewhere():
            from hdc.command import compare_page
    from hdc.command import compare as comparing

    frames = readers.open_recording(recording, intervals, window.crop, window.subsample)
    result = comparing.compare(frames, recording, test_fraction, seeds)
    if output:
        output.write_text(compare_page.page(result), encoding="utf-8")
    click.echo(result.json() if as_json else comparing.text(result))


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
    crop: tuple[int, ...] | None,
    subsample: int,
    host: str | None,
    port: int,
) -> None:
    """Teach a model in the browser.

    A page shows the frames of a camera, or of a RECORDING played back, and what the model says.
    """
    if (camera is None) == (folder is None):
        raise click.UsageError("expected one of --camera and --folder")
    window = _window(crop, subsample)
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
def info(model: Path) -> None:
    """Tell what a model was trained on."""
    _check_model(model)
    from hdc.command import work

    click.echo(work.info(model))


def _check_model(path: Path) -> None:
    if not path.exists():
        raise ValueError(f"{shown(path)}: expected a saved model, found no such file")


def _check_output(path: Path) -> None:
    """Found before anything is read: that the model could not be written in the end."""
    if not path.parent.is_dir():
        raise ValueError(f"{shown(path)}: expected a folder to write into, found none")
    if path.is_dir():
        raise ValueError(f"{shown(path)}: expected a file name, found a folder")
    if not os.access(path.parent, os.W_OK):
        raise ValueError(f"{shown(path)}: expected a folder that can be written, found none")


@contextmanager
def _fonts_elsewhere() -> Iterator[None]:
    """matplotlib keeps a list of fonts in the home folder; the command writes its page only."""
    with tempfile.TemporaryDirectory() as folder:
        used = os.environ.setdefault("MPLCONFIGDIR", folder)
        try:
            yield
        finally:
            if used == folder:
                del os.environ["MPLCONFIGDIR"]


def _images(path: Path) -> list[Path]:
    if path.is_dir():
        return image_files(path)
    file_size(path)  # raises: no such file
    return [path]
