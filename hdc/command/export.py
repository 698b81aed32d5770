"""``hdc export``: a model as a header of C99."""

from __future__ import annotations

import re
import warnings
from pathlib import Path

import click

from hdc.command import messages, options, work
from hdc.io import check_replaceable, write_atomically

LARGE = 2**18
"""Bytes of tables that a small board seldom has."""
TOO_LARGE = (
    "tables of more than 256 kB; hdc train --subsample 2 makes a model of a quarter of them, and "
    "--encoder median --readout majority the smallest"
)


@click.command(short_help="Write a model as a C99 header.")
@options.model
@options.output
@click.option(
    "--bits",
    type=click.Choice(["8", "16"]),
    default="8",
    help="Bits per pixel of the frames on the board.",
)
@options.reject
@click.option(
    "--test-vectors",
    type=click.IntRange(0),
    default=0,
    metavar="N",
    help="Write a program beside it that compares N frames with Python.",
)
def export(
    model: Path,
    output: Path,
    bits: str,
    reject: float | None,
    test_vectors: int,
) -> None:
    """Write a MODEL as one header of C99, for a robot or a small board.

    For the encoders median, quantile, levels and deviation, and the read-outs majority, trained and
    lda. The header has no floating point, allocates nothing and calls no library.
    """
    from hdc import export as exporting

    name = _name(output)
    program = output.with_name(f"{output.stem}_test.c")
    for written in (output, program) if test_vectors else (output,):
        check_replaceable(written, "a file that hdc export wrote", _is_exported)
    found, window = work.load(model)
    try:
        plan = exporting.Plan.of(found, name, int(bits), reject, window)
    except ValueError as error:
        raise ValueError(f"{model}: {error}") from error
    messages.say(
        f"classes: {len(plan.classes)}, frames of {messages.size(plan.frame_shape)} of "
        f"{bits} bits, {plan.dimension} bits compared",
        f"tables: {plan.constant_bytes} bytes",
        f"memory: {plan.scratch_bytes} bytes, and {plan.frame_bytes} of the frame",
    )
    if plan.constant_bytes > LARGE:
        warnings.warn(f"{model}: {TOO_LARGE}", stacklevel=2)
    origin = f"{model.name}, trained {found.metadata_.get('trained', 'in Python')}"
    write_atomically(output, exporting.header(plan, output.name, origin))
    messages.say(f"{output}: written")
    if test_vectors:
        text = exporting.test_vectors(
            plan, found, output.name, program.name, test_vectors
        )
        write_atomically(program, text)
        messages.say(f"{program}: written, {test_vectors} frames")


def _name(output: Path) -> str:
    """The beginning of all names in a header, from its file's name."""
    name = re.sub(r"\W+", "_", output.stem, flags=re.ASCII)
    if output.suffix not in (".h", ".hpp") or not re.match(r"[A-Za-z]", name):
        raise ValueError(
            f"{output}: expected a header such as touch.h, its name beginning with a letter"
        )
    return name


def _is_exported(path: Path) -> bool:
    """Whether an export wrote a file."""
    from hdc.export.header import MARK

    return MARK.encode() in path.read_bytes()[:1000]
