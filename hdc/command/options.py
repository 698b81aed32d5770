"""Options that several commands share; :mod:`hdc.command.source` has the options of a recording."""

from __future__ import annotations

from contextlib import suppress
from json import loads as json_of
from pathlib import Path
from typing import Any

import click

RATE = 0.05
"""Share of frames of known classes that ``--reject`` alone may refuse."""
FILE = click.Path(path_type=Path)
SHARE = click.FloatRange(0, 1, min_open=True, max_open=True)


def _names(text: str) -> tuple[str, ...]:
    """Words between commas."""
    return tuple(text.replace(" ", "").split(","))


template = click.option(
    "--template",
    metavar="PATTERN",
    help="Path of an image in the folder, such as '{session}/{label}/*_{order}.png'; of a file of "
    "arrays or a video, such as '{label}_{group}.avi'; or of an array in a file that has one per "
    "trial, such as '{label}_{group}/frames'.",
)
axes = click.option(
    "--axes",
    type=_names,
    metavar="NAMES",
    help="Axes of an array, such as height,width,frame.",
)
image_column = click.option(
    "--image-column",
    default="image",
    metavar="NAME",
    help="Column of the table that names the image.",
)


def _setting(text: str) -> tuple[str, Any]:
    """``PART__NAME=VALUE`` as a name and a value: JSON, or else text."""
    name, equals, value = text.partition("=")
    if not equals or "__" not in name:
        wanted = "PART__NAME=VALUE such as encoder__thresholds=15"
        raise click.BadParameter(f"expected {wanted}, found {text}")
    with suppress(ValueError):
        return name, json_of(value)
    return name, value


parameters = click.option(
    "--set",
    "parameters",
    multiple=True,
    type=_setting,
    metavar="PART__NAME=VALUE",
    help="Set a parameter of the encoder or the readout, such as encoder__thresholds=15; may be "
    "repeated.",
)
output = click.option(
    "-o",
    "--output",
    type=FILE,
    required=True,
    help="File to write.",
)
model = click.argument("model", type=FILE)
trusted = click.option(
    "--trusted",
    multiple=True,
    metavar="MODULE.CLASS",
    help="Import this class of your own, which the model names; may be repeated.",
)
_CIRCULAR = "learn cosine and sine as two columns of the table"
LEFT = {
    "compare --budget": "rows come cheapest first, and Ctrl-C keeps those that are done",
    "compare --all": "the list is short",
    "compare --encoder": "hdc train --encoder --test-fraction tests another form",
    "compare --readout": "hdc train --readout --test-fraction tests another form",
    "compare --draws": "there is no learning curve",
    "compare --output": "there is no figure",
    "compare -o": "there is no figure",
    "compare --test-fraction": "each frame is tested once, or --test names others",
    "compare --json": "hdc evaluate --json writes the accuracy of a model",
    "compare --circular": _CIRCULAR,
    "train --circular": _CIRCULAR,
    "train --choose": "hdc compare shows the options of the best form",
    "recalibrate --seed": "each recalibration of a model replaces other bits",
}
"""Options of commands that left, and what to do instead."""
json = click.option("--json", "as_json", is_flag=True, help="Write JSON.")
reject = click.option(
    "--reject",
    type=click.FloatRange(0, 0.5, min_open=True),
    is_flag=False,
    flag_value=RATE,
    default=None,
    metavar="[RATE]",
    help="Refuse frames unlike every class; about this share of frames like those trained on is "
    f"refused, too ({RATE} if no number follows).",
)
interval = click.option(
    "--interval",
    type=SHARE,
    metavar="SHARE",
    help="Answer with intervals of values, or sets of classes, that contain the truth for this "
    "share of the frames, such as 0.9.",
)
