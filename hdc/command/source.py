"""The RECORDING of a command line: its options, and how it is opened."""

from __future__ import annotations

import functools
import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import click
import numpy as np

from hdc import readers
from hdc.command.options import FILE, axes, image_column, template
from hdc.readers import VIDEO, Recording, Window, kind_of

_OPTIONS = (
    template,
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
    image_column,
    click.option(
        "--labels",
        metavar="NAME",
        help="Array of labels.",
    ),
    axes,
    click.option(
        "--sessions",
        metavar="NAME",
        help="Array or column of the session of each frame. [default: session]",
    ),
    click.option(
        "--groups",
        metavar="NAME",
        help="Array or column of what was recorded together. [default: group]",
    ),
)
_PIXELS = (
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


@dataclass(frozen=True)
class Source:
    """A recording as it was given: its path, and settings of :func:`hdc.readers.open_recording`."""

    path: Path
    settings: Mapping[str, Any] = field(default_factory=dict)

    def open(self, window: Window, fewest_classes: int = 2) -> Recording:
        """The recording; images are decoded when needed."""
        frames = readers.open_recording(
            self.path,
            window=window,
            check=kind_of(self.path) == VIDEO,  # decoded from its beginning each time
            fewest_classes=fewest_classes,
            **self.settings,
        )
        if line := frames.left_out():
            warnings.warn(line, stacklevel=2)
        return frames

    def with_values(self, names: Sequence[str]) -> Source:
        """The same with these values in this order, unless others are given."""
        given = self.settings.get("value_columns") or names
        if set(given) != set(names):
            return self
        return Source(self.path, {**self.settings, "value_columns": tuple(names)})

    def like(self, path: Path) -> Source:
        """Another recording, opened as this one.

        Raises:
            ValueError: a table has the labels or numbers of this recording alone.
        """
        given = Path(str(self.settings.get("table") or "")).expanduser()
        if given.is_file():  # and not named from the folder of each
            raise ValueError(
                f"--test: expected labels and numbers in {path}, found {given} for both recordings"
            )
        return Source(path, self.settings)


def truth_of(recording: Recording) -> np.ndarray:
    """The truth that a model learns: names of the classes [N]; or values [N, T] where there are
    any, even with labels."""
    if recording.values is not None:
        return recording.values
    return np.array(recording.names)


def recording(command: Callable[..., Any]) -> Callable[..., Any]:
    """Give a command the argument RECORDING and its options, as a Source."""

    @functools.wraps(command)
    def with_source(recording: Path, **given: Any) -> Any:
        settings = {name: given.pop(name) for name in _SETTINGS}
        return command(source=Source(recording, settings), **given)

    return click.argument("recording", type=FILE)(_with(with_source, _OPTIONS))


def pixels(command: Callable[..., Any]) -> Callable[..., Any]:
    """Give a command the options of the pixels that are kept, as a Window."""

    @functools.wraps(command)
    def with_window(crop: Any, subsample: int, **given: Any) -> Any:
        return command(window=Window(crop, subsample), **given)

    return _with(with_window, _PIXELS)


def _with(
    command: Callable[..., Any], options: Sequence[Callable[..., Any]]
) -> Callable[..., Any]:
    return functools.reduce(lambda made, add: add(made), reversed(options), command)


_SETTINGS = (
    "template",
    "table",
    "value_columns",
    "image_column",
    "labels",
    "axes",
    "sessions",
    "groups",
)
