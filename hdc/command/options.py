"""Options that several commands share."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import click

RATE = 0.05
"""Share of frames of known classes that ``--reject`` alone may refuse."""
FILE = click.Path(path_type=Path)
SHARE = click.FloatRange(0, 1, min_open=True, max_open=True)


def together(*options: Callable[..., Any]) -> Callable[..., Any]:
    """One decorator of several options, in the order of the help."""

    def decorate(command: Any) -> Any:
        for option in reversed(options):
            command = option(command)
        return command

    return decorate


def _names(_: Any, __: Any, text: str | None) -> tuple[str, ...] | None:
    """Words between commas."""
    return None if text is None else tuple(text.replace(" ", "").split(","))


axes = click.option(
    "--axes",
    metavar="NAMES",
    callback=_names,
    help="Axes of an array, such as height,width,frame.",
)
recording = together(
    click.argument("recording", type=FILE),
    click.option(
        "--template",
        metavar="PATTERN",
        help="Path of an image in the folder, such as '{session}/{label}/*_{order}.png'.",
    ),
    click.option(
        "--values",
        "table",
        type=FILE,
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
        help="Column of the table that names the image, or that holds it.",
    ),
    click.option(
        "--labels",
        metavar="NAME",
        help="Array or column of labels, or a CSV with a row per frame.",
    ),
    axes,
    click.option(
        "--skip-damaged", is_flag=True, help="Leave damaged images out, and count them."
    ),
    click.option(
        "--skip-missing",
        is_flag=True,
        help="Leave rows of a table out whose image is missing, and count them.",
    ),
)
pixels = together(
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
circular = click.option(
    "--circular",
    "period",
    type=click.FloatRange(0, min_open=True),
    metavar="PERIOD",
    help="The numbers go round with this period, such as 360 for degrees. They are predicted by "
    "sine and cosine, and errors are taken the shorter way round.",
)
output = click.option(
    "-o", "--output", type=FILE, required=True, help="File to write the model to."
)
TRUSTED = "hdc.trusted"
"""Where the names of ``--trusted`` are kept in the context of a command."""


def _keep_trusted(context: click.Context, _: object, names: tuple[str, ...]) -> None:
    context.meta[TRUSTED] = names


model = together(
    click.argument("model", type=FILE),
    click.option(
        "--trusted",
        multiple=True,
        expose_value=False,
        callback=_keep_trusted,
        metavar="MODULE.CLASS",
        help="Import this class of your own, which the model names; may be repeated.",
    ),
)
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
    help="Answer with intervals of values, or sets of classes, that are to hold the truth for this "
    "share of the frames, such as 0.9.",
)
fraction = click.option(
    "--test-fraction", type=SHARE, default=0.2, help="Share of frames to hold out."
)
