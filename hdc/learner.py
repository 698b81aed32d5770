"""Learning chunk by chunk: frames to hypervectors, and these to what a classifier learns."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import torch
from torch import Tensor

from hdc import inputs
from hdc.encoders import Median, Quantile
from hdc.encoders.ranks import RankEncoder, ties_of
from hdc.estimator import CHUNK, Estimator
from hdc.learned import Learned
from hdc.readouts import Counting, Counts, Majority


def learn(
    model: Estimator, learned: Learned, frames: Any, labels: Sequence[inputs.Label]
) -> Iterator[int]:
    """Learn frames of known classes; yield how many there were once all classes have one.

    A read-out that wants all hypervectors at once has them before the last yield.

    Args:
        model: whose encoder makes the hypervectors.
        learned: what is learned, so far nothing.
        frames: with a shape, as of :func:`hdc.inputs.indexable`.
        labels: one per frame.
    """
    most = int(torch.bincount(learned.rows_of(labels)).max())
    learned.majority.counters_.reserve(most)
    words: Tensor | None = None
    for start in range(0, len(frames), CHUNK):
        part = model._chunk(frames, start)
        backend = model._backend(part)
        chosen = labels[start : start + CHUNK]
        if _in_one_read(model, learned, part, backend):
            _add_in_one_read(model, learned, part, chosen, start)
        else:
            # Memory for words is used again where nobody keeps them.
            room = words if isinstance(learned.readout, Counting) else None
            words = model._encode(part, start, backend, room)
            learned.add(words, chosen, backend)
        seen = min(start + CHUNK, len(frames))
        if seen == len(frames):
            learned.finish(backend)
        elif learned.waits:
            continue
        if (learned.counts > 0).all():
            yield seen


def _in_one_read(model: Estimator, learned: Learned, frames: Any, backend: str) -> bool:
    """Whether compiled kernels encode and count such frames in one read of them."""
    if backend != "compiled" or not isinstance(frames, Tensor):
        return False
    ours = type(model.encoder_) in (Median, Quantile)
    counted = type(learned.readout) in (Majority, Counts)
    if not ours or not counted:
        return False
    return frames.dtype == torch.uint8 and model.dimension_ > 1


def _add_in_one_read(
    model: Estimator,
    learned: Learned,
    frames: Tensor,
    labels: Sequence[inputs.Label],
    first: int,
) -> None:
    """Learn 8-bit frames, of whose hypervectors only those of the sample are kept."""
    encoder = model.encoder_
    assert isinstance(encoder, RankEncoder)
    n_pixels = model.n_features_in_
    inputs.check_shape(frames.shape[1:], model.frame_shape_, type(model).__name__)
    chosen = learned.sample.choose(labels)
    (n_ones,) = encoder.ones(n_pixels)
    rows = learned.rows_of(labels)
    kept, equal, split = learned.majority.add_frames(
        frames, rows, list(chosen), n_ones, encoder.ties
    )
    learned.sample.keep(chosen, kept)
    encoder.warn(ties_of(equal, split, n_pixels), n_pixels, first)
