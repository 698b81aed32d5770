"""A model of a recording, of named parts or of those that cross-validation chooses."""

from __future__ import annotations

from typing import Any

import numpy as np

import hdc
from hdc.command import work
from hdc.command.compare.choose import choose
from hdc.command.compare.frames import read_frames
from hdc.encoders import make_encoder
from hdc.readers import Recording
from hdc.readers.batches import Batches


def learn(
    recording: Recording,
    rows: np.ndarray,
    encoder: str | None,
    readout: str | None,
    chosen: bool,
) -> tuple[Any, str]:
    """A model trained on the frames `rows`, and a line on how it was chosen, or nothing.

    Args:
        recording: of classes, or of values.
        rows: indices of the training frames.
        encoder, readout: names; None is that of a model without a choice.
        chosen: whether to choose both by cross-validation instead.
    """
    line = ""
    images: Any
    if chosen:
        frames = read_frames(recording, rows=rows)
        combination, line = choose(frames)
        encoder, readout = combination.encoder, combination.readout
        images = frames.bank.frames
    elif make_encoder(encoder or "median").learns:  # it reads all frames twice
        images = read_frames(recording, rows=rows).bank.frames
    else:
        images = Batches(recording, rows)
    if recording.values is not None:
        regressor = hdc.HDCRegressor(encoder or "median", readout or "ridge")
        return regressor.fit(images, recording.values[rows]), line
    classifier = hdc.HDCClassifier(encoder or "median", readout or "majority")
    return classifier.fit(images, np.array(recording.names)[rows]), line


def learnt(recording: Recording) -> str:
    """What a model learns of a recording, in words."""
    if recording.values is None:
        return f"{len(recording.classes)} classes"
    names = work.with_units(recording.value_names, recording.value_units)
    return f"values of {', '.join(names)}"
