"""``hdc predict``, ``hdc evaluate`` and ``hdc info``: what a saved model answers."""

from __future__ import annotations

import json
from pathlib import Path

import click
import numpy as np

from hdc.command import answers, messages, options, scores, work
from hdc.command.source import Source, recording
from hdc.readers import ARRAY, VIDEO, kind_of
from hdc.readers.listing import SUFFIXES, all_files, is_image


@click.command(short_help="Classify new images.")
@options.model
@options.trusted
@click.argument("images", type=options.FILE, nargs=-1, required=True)
@options.template
@options.axes
@options.image_column
@options.reject
@options.interval
@click.option(
    "--proba",
    is_flag=True,
    help="Also the probability of the best class; with --json of all classes.",
)
@options.json
def predict(
    model: Path,
    trusted: tuple[str, ...],
    images: tuple[Path, ...],
    template: str | None,
    axes: tuple[str, ...] | None,
    image_column: str,
    reject: float | None,
    interval: float | None,
    proba: bool,
    as_json: bool,
) -> None:
    """Classify images, or predict their numbers.

    IMAGES are image files, videos, arrays or tables of frames, or folders with their sub-folders.
    A folder without images is read as one of arrays and videos.
    Each frame has a line: its file and label. With the read-out majority, the line adds the
    distance of each class as a share of the bits: unrelated frames differ in half of them.
    --interval adds lower and upper ends of each number, or all classes that the frame may be of,
    none if it is like no class. Probabilities and intervals hold for frames recorded under the
    training conditions.
    """
    found, window = work.load(model, trusted)
    files: list[Path] = []
    for path in images:
        is_listed = path.is_dir() and template is None
        files += _files_in(path) if is_listed else [path]
    wanted = answers.Wanted(reject, interval, proba)
    settings = {"template": template, "axes": axes, "image_column": image_column}
    rows = answers.ask(found, window, files, wanted, settings)
    refused = number = 0
    for number, answer in enumerate(rows, 1):
        refused += answer.get("label", "") is None
        row = answers.table_row(answer)
        if number == 1 and not as_json:
            click.echo("\t".join(row))
        click.echo(json.dumps(answer) if as_json else "\t".join(row.values()))
    if reject:
        limit = messages.limit_of_refused(reject, found.left_out_)
        text = f"refused {refused} of {number} frames; expected at most {limit} of known ones"
        click.echo(text, err=True)


def _files_in(root: Path) -> list[Path]:
    """Every image of a folder and its sub-folders, in natural order; where there is none, every
    file of arrays and video.

    Raises:
        ValueError: there is none of them, or a folder in it is a link.
    """
    files = all_files(root)
    found = [file for file in files if is_image(file)]
    found = found or [file for file in files if kind_of(root / file) in (ARRAY, VIDEO)]
    if not found:
        raise ValueError(
            f"{root}: expected images ({', '.join(SUFFIXES)}), arrays or videos, found none"
        )
    return [root / file for file in found]


@click.command(short_help="Test a model on new labelled images.")
@options.model
@options.trusted
@recording
@options.reject
@options.interval
@options.json
def evaluate(
    model: Path,
    trusted: tuple[str, ...],
    source: Source,
    reject: float | None,
    interval: float | None,
    as_json: bool,
) -> None:
    """Measure accuracy and confusions on a RECORDING, or errors of its numbers.

    The interval of the accuracy is Wilson's, for 95 %. R² is the share of the variance that is
    predicted. With --interval 0.9 the command counts how often intervals or sets contain the truth
    on this RECORDING. They are made to contain it for 90 % of the frames recorded under the
    training conditions.
    """
    found, window = work.load(model, trusted)
    frames = work.frames_for(found, window, source)
    result = scores.score(found, frames, np.arange(len(frames)), reject, interval)
    if as_json:
        click.echo(json.dumps(result))
    else:
        messages.say(*messages.score_lines(result), *messages.confusions(result))
        before = found.metadata_.get("held_out")
        share = result.get("accuracy", before)
        if isinstance(before, float) and before - share > messages.FALL:
            messages.say(messages.DIFFERS)


@click.command(short_help="Describe a saved model.")
@options.model
@options.trusted
def info(model: Path, trusted: tuple[str, ...]) -> None:
    """Show what a model was trained on, how it sees frames, and what it takes, as JSON."""
    found, _ = work.load(model, trusted)
    click.echo(json.dumps(messages.described(found, model), indent=2))
