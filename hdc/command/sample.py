"""``hdc sample``: a small recording to try the other commands on."""

from __future__ import annotations

from pathlib import Path

import click

from hdc.command import messages, options
from hdc.io import write_atomically

FRAMES = Path(__file__).with_name("recording")
"""Frames of the simulated sensor, 63 × 63 pixels: docs/sensor.md says how they were made."""


@click.command(short_help="Write a small recording to try hdc on.")
@click.argument("folder", type=options.FILE, default=Path())
def sample(folder: Path) -> None:
    """Write a small recording of three touches into FOLDER, to try the other commands on.

    The folder touches was recorded first; the sensor had drifted before tomorrow and later were.
    """
    for part in sorted(FRAMES.iterdir(), reverse=True):
        files = sorted(part.rglob("*.png"))
        (folder / part.name).mkdir(parents=True)
        for file in files:
            target = folder / file.relative_to(FRAMES)
            write_atomically(target, file.read_bytes())
        classes = ", ".join(sorted({file.parent.name for file in files}))
        messages.say(f"{folder / part.name}: {len(files)} frames of {classes}")
