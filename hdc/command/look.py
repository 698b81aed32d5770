"""``hdc look``: what a recording holds, and what to type for each way to read it."""

from __future__ import annotations

import shlex
from collections import Counter
from pathlib import Path, PurePath

import click
import numpy as np

from hdc import readers
from hdc.command import messages
from hdc.command.source import Source, recording
from hdc.readers import Recording, Window, about, stores
from hdc.readers.files import Ambiguous
from hdc.readers.listing import all_files
from hdc.readers.table import columns_in
from hdc.readers.template import numbered


class _Typed(click.Command):
    """A command that keeps the words of its line, to show them with others."""

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        ctx.obj = list(args)
        return super().parse_args(ctx, args)


@click.command(cls=_Typed, short_help="Show how a recording is read.")
@recording
@click.pass_obj
def look(typed: list[str], source: Source) -> None:
    """Show what a RECORDING holds, and the line to type for hdc train.

    A RECORDING that can be read in several ways has a line for each.
    """
    file, _ = readers.split_name(source.path)
    path = next(word for word in typed if Path(word) == source.path)
    typed.remove(path)
    said = messages.shortened(contents(file)) if file.exists() else []
    messages.say(*said)
    for taken, frames in _readings([str(source.path), *typed])[: messages.LISTED]:
        if said:
            messages.say("")
        said = _described(taken, frames)
        messages.say(*said)


# Its contents -----------------------------------------------------------------------------------


def contents(path: Path) -> list[str]:
    """A line on each array, column or kind of file of a recording."""
    of_kind = {
        readers.FOLDER: _files,
        readers.ARRAY: _arrays,
        readers.VECTORS: _table,
    }
    found = of_kind.get(readers.kind_of(path))
    return [] if found is None else found(path)


def _table(path: Path) -> list[str]:
    return [f"columns: {', '.join(messages.shortened(columns_in(path)))}"]


def _files(folder: Path) -> list[str]:
    """How many files of each suffix there are, and the first of them."""
    files = all_files(folder)
    suffixes = [PurePath(file).suffix.lower() for file in files]
    return [
        f"{n} {suffix or 'other'} files, such as {files[suffixes.index(suffix)]}"
        for suffix, n in Counter(suffixes).most_common()
    ]


def _arrays(path: Path) -> list[str]:
    store = stores.load(path)
    lines = []
    for name, array in store.arrays.items():
        kind = "text" if array.dtype.kind == "U" else array.dtype.name
        lines.append(f"{name}: {kind} {tuple(array.shape)}")
    return lines + [f"{name}: not read, {why}" for name, why in store.unread.items()]


# How it can be read ------------------------------------------------------------------------------


@click.command()
@recording
def _opened(source: Source) -> Recording:
    """A recording opened as a line of words says."""
    return source.open(Window())


def _readings(words: list[str]) -> list[tuple[list[str], Recording]]:
    """Each way in which the words of a command line can be read: with what is added, and opened.

    Raises:
        ValueError: there is none.
    """
    try:
        return [(words, _opened.main(words, standalone_mode=False))]
    except Ambiguous as error:
        found: list[tuple[list[str], Recording]] = []
        refused: ValueError = error
        for choice in reversed(error.choices[: messages.LISTED]):
            try:
                found = _readings(_with(words, choice)) + found
            except ValueError as why:
                refused = why
        if (
            not found
        ):  # why the first choice fails says more than that there are several
            raise refused from error
        return found


def _with(words: list[str], choice: str) -> list[str]:
    """Words with one of the choices, which is options or another path."""
    if choice.startswith("--"):
        return [*words, *shlex.split(choice)]
    return [choice, *words[1:]]


def _described(words: list[str], frames: Recording) -> list[str]:
    """Content of a reading, and the line to type for it."""
    lines = [f"{len(frames)} frames, {messages.whole(frames)}"]
    if frames.features:
        first, *_, last = (frames.features[0], *frames.features)
        n = len(frames.features)
        lines.append(f"a frame is the {n} columns from {first} to {last}")
    if frames.session is not None:
        lines.append(messages.session_line(frames, np.arange(len(frames))))
    if frames.group is not None:
        n = len(np.unique(frames.group))
        lines.append(f"groups: {n}, each learnt or tested as a whole")
    lines += messages.reading_lines(frames)
    lines += [*_twins_lines(words, frames), *_unit_lines(frames)]
    test = ("--test-fraction", "0.2", "-o", "model.safetensors")
    return [*lines, shlex.join(["hdc", "train", *words, *test])]


def _unit_lines(frames: Recording) -> list[str]:
    """The option for each column that seems to number recordings, where none is known."""
    if frames.session is not None or frames.group is not None:
        return []
    lines = []
    for name, column in frames.samples.items():
        n = len(np.unique(column))
        if about.is_of_units(name) and 1 < n < len(frames):
            word = shlex.quote(name)
            lines.append(
                f"{word} has {n} values: --sessions {word} tests whole recordings, --groups {word} "
                "whole objects"
            )
    return lines


def _twins_lines(words: list[str], frames: Recording) -> list[str]:
    """A question, where names of classes differ in a number alone; or nothing."""
    template = numbered(frames.classes)
    if not template:
        return []
    in_folders = Path(words[0]).is_dir() and "--template" not in words
    read = f"--template '{template}/*'" if in_folders else template
    return [f"do numbers of the classes count recordings? {read} reads them so"]
