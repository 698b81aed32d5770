"""``hdc sample``: a small recording to try the other commands on."""

from __future__ import annotations

import shutil
from pathlib import Path

import click

from hdc.command import messages, options

FRAMES = Path(__file__).with_name("recording")
"""Frames of the simulated sensor, 63 × 63 pixels: docs/sensor.md says how they were made."""


@click.command(short_help="Write a small recording to try hdc on.")
@click.argument("folder", type=options.FILE, default=Path())
def sample(folder: Path) -> None:
    """Write a small recording of three touches into FOLDER, to try the other commands on.

    The folder touches was recorded first; the sensor had drifted before tomorrow and later were.
    """
    for part in sorted(FRAMES.iterdir(), reverse=True):
        _copy(part, folder / part.name)
        classes = ", ".join(sorted(path.name for path in part.iterdir()))
        frames = len(list(part.rglob("*.png")))
        messages.say(f"{folder / part.name}: {frames} frames of {classes}")


def _copy(source: Path, target: Path) -> None:
    """Copy a folder; one error names the first file that cannot be written."""
    try:
        shutil.copytree(source, target)
    except shutil.Error as error:  # of all files
        _, path, why = error.args[0][0]
        raise OSError(f"{path}: {why}") from error
