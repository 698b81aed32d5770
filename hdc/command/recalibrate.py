"""``hdc recalibrate``: a model adapted to a changed sensor."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click
import numpy as np

from hdc.command import messages, options, work
from hdc.io import check_replaceable
from hdc.readers import Recording
from hdc.readers.batches import Batches


@click.command(short_help="Adapt a model to a changed sensor.")
@options.model
@options.recording
@options.output
@click.option(
    "--p",
    type=click.FloatRange(0, 1),
    help="Probability that a bit is replaced, or share of the new votes or discriminants. "
    "[default: 0.5]",
)
@click.option(
    "--method",
    type=click.Choice(["replace", "merge"]),
    help="Replace bits with probability p, as published, or merge votes, the "
    "only way of a model with the read-out counts. [default: replace]",
)
@click.option(
    "--seed", type=click.IntRange(0), help="Choice of the bits replaced. [default: 0]"
)
def recalibrate(
    model: Path,
    recording: Path,
    output: Path,
    p: float | None,
    method: str | None,
    seed: int | None,
    **source: Any,
) -> None:
    """Adapt a model to a changed sensor.

    The new RECORDING is of some or all of the classes of the model, or of its numbers. A model
    with the read-out trained does not adapt by labels: train it anew.

    A model with --encoder reference can do without labels: the RECORDING is then a folder of images
    without sub-folders, or an array of frames without labels, and its mean frame becomes the new
    reference. It has to show the classes about as often as the training frames did. Frames of one
    class alone, or without a touch, can spoil the model; a warning says so if the model puts the
    frames into few classes.
    """
    check_replaceable(output)
    found, window = work.load(model)
    given = not (p is None and method is None and seed is None)
    if not hasattr(found, "classes_"):
        if given:
            raise click.UsageError(
                "expected no --p, --method or --seed for a model of numbers"
            )
        frames = work.frames_for(found, window, recording, source)
        line = _by_values(found, frames)
    elif (
        unlabelled := work.unlabelled_frames(found, window, recording, source)
    ) is not None:
        if given:
            raise click.UsageError(
                "expected no --p, --method or --seed for frames without labels"
            )
        found.rezero(unlabelled)
        line = f"re-referenced by {len(unlabelled)} new frames without labels"
    else:
        frames = work.frames_for(found, window, recording, source)
        share = 0.5 if p is None else p
        line = _by_labels(found, frames, share, method or "replace", seed or 0)
    found.save(output)
    click.echo(f"{output}: {line}")


def _by_values(model: Any, frames: Recording) -> str:
    """Adapt a model of numbers to new frames with theirs, and say to how many."""
    if frames.values is None:
        raise ValueError("--values: expected a table of the new numbers, found none")
    model.recalibrate(Batches(frames, np.arange(len(frames))), frames.values)
    return f"{len(frames)} new frames with {messages.learnt(frames)}"


def _by_labels(
    model: Any, frames: Recording, share: float, method: str, seed: int
) -> str:
    """Adapt a classifier to new labelled frames, and say to which."""
    by_name = {str(c): c for c in model.classes_.tolist()}
    labels = [by_name[name] for name in frames.names]
    model.recalibrate(
        Batches(frames, np.arange(len(frames))), labels, share, seed, method
    )
    names, counts = np.unique(frames.names, return_counts=True)
    line = f"{len(frames)} new frames of {len(names)} classes, at least {counts.min()} of each"
    line += f", {method}, p = {share:g}"
    others = sorted({*by_name} - {*names})
    return f"{line}\nnot recalibrated: {', '.join(others)}" if others else line
