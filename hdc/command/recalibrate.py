"""``hdc recalibrate``: a model adapted to a changed sensor."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Any

import click
import numpy as np

from hdc.command import options
from hdc.command.messages import learnt, say
from hdc.command.source import Source, recording
from hdc.command.work import frames_for, load
from hdc.io import check_replaceable
from hdc.readers import Recording

PUBLISHED = (
    "recalibrate: replacing bits, as published, can lower the accuracy; test the new model on "
    "other frames with hdc evaluate, or recalibrate a model of --readout lda"
)


@click.command(short_help="Adapt a model to a changed sensor.")
@options.model
@options.trusted
@recording
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
    help="Replace bits with probability p, as published, or merge votes. [default: replace; "
    "merge for the read-out counts]",
)
def recalibrate(
    model: Path,
    trusted: tuple[str, ...],
    source: Source,
    output: Path,
    p: float | None,
    method: str | None,
) -> None:
    """Adapt a MODEL to a changed sensor.

    The new RECORDING is of some or all of the classes of the model, or has its numbers. A model
    with the read-out trained does not adapt by labels: train it anew.

    A model with --encoder reference can do without labels: the RECORDING is then a folder of images
    without sub-folders, or an array of frames without labels, and its mean frame becomes the new
    reference. It has to show the classes about as often as the training frames did. Frames of one
    class alone, or without a touch, can spoil the model; a warning says so if the model puts the
    frames into few classes.
    """
    check_replaceable(output)
    found, window = load(model, trusted)
    frames = frames_for(found, window, source, fewest_classes=0)
    every = {"p": p, "method": method}
    given = {name: value for name, value in every.items() if value is not None}
    if hasattr(found, "classes_") and frames.labels is not None:
        line = _by_labels(found, frames, given)
    elif given:
        wrong = " or ".join(f"--{name}" for name in given)
        raise click.UsageError(
            f"expected no {wrong} for numbers, or for frames without labels"
        )
    elif not hasattr(found, "classes_"):
        found.recalibrate(_batches(frames), frames.values)
        line = f"{len(frames)} new frames, {learnt(frames)}"
    elif hasattr(found, "rezero"):
        found.rezero(frames)
        line = f"re-referenced by {len(frames)} new frames without labels"
    else:
        raise ValueError(
            f"{source.path}: expected labels, or a model with an encoder such as reference, "
            "which adapts without"
        )
    found.save(output)
    say(f"{output}: {line}")


def _by_labels(model: Any, frames: Recording, given: dict[str, Any]) -> str:
    """Recalibrate a classifier; a line on what by."""
    if not hasattr(model, "recalibrate"):
        raise ValueError(
            "recalibrate: expected the read-out majority, counts, ridge, neighbours or lda, found "
            f"{model.readout_!r}; hdc train on the frames of both days"
        )
    by_name = {str(c): c for c in model.classes_.tolist()}
    labels = [by_name[name] for name in frames.names]
    model.recalibrate(_batches(frames), labels, **given)
    methods = getattr(model.readout_, "methods", ("merge",))
    if given.get("method", methods[0]) == "replace":
        warnings.warn(PUBLISHED, stacklevel=2)
    names, counts = np.unique(frames.names, return_counts=True)
    return f"{len(frames)} new frames of {len(names)} classes, at least {counts.min()} of each"


def _batches(frames: Recording) -> Any:
    return frames.batches(np.arange(len(frames)))
