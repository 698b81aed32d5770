"""A model of a recording, of named parts or of those that cross-validation chooses."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

import hdc
from hdc.command.compare.choose import choose
from hdc.command.compare.frames import read_frames
from hdc.encoders import make_encoder
from hdc.readers import Recording
from hdc.readers.batches import Batches
from hdc.selection import combinations


def learn(
    recording: Recording,
    rows: np.ndarray,
    encoder: str | None,
    readout: str | None,
    chosen: bool,
    period: float | None = None,
) -> tuple[Any, str]:
    """A model trained on the frames `rows`, and a line on how it was chosen, or nothing.

    Args:
        recording: of classes, or of values.
        rows: indices of the training frames.
        encoder, readout: names; None is that of a model without a choice.
        chosen: whether to choose both by cross-validation instead.
        period: of values that go round; None for those that do not.
    """
    line = ""
    images: Any
    if chosen:
        frames = replace(read_frames(recording, rows=rows), period=period)
        combination, line = choose(frames)
        encoder, readout = combination.encoder, combination.readout
        images = frames.bank.frames
    elif make_encoder(encoder or "median").learns:  # it reads all frames twice
        images = read_frames(recording, rows=rows).bank.frames
    else:
        images = Batches(recording, rows)
    model: Any
    if recording.values is not None:
        model = hdc.HDCRegressor(encoder or "median", readout or "ridge", period=period)
        model.fit(images, recording.values[rows])
    else:
        model = hdc.HDCClassifier(encoder or "median", readout or "majority")
        model.fit(images, np.array(recording.names)[rows])
    model._columns = list(recording.features) or None
    return model, line


def would_try(learns_values: bool) -> str:
    """A line on the forms that ``--choose`` tries after the one without a choice."""
    first, *others = combinations((), (), learns_values)
    listed = "; ".join(form.name for form in others)
    return f"--choose would try, besides {first.name}: {listed}"
