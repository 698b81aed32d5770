"""Conditions for merging two models."""

from __future__ import annotations

import torch

from hdc import inputs
from hdc.encoders import ENCODERS, Encoder, make_encoder
from hdc.estimator import Estimator
from hdc.parameters import describe
from hdc.readouts import make_readout


def check_kind(mine: Estimator, theirs: Estimator) -> None:
    """Raise ValueError for models of another class, or with another read-out or encoder."""
    expected, found = _kind(mine), _kind(theirs)
    if expected != found:
        raise ValueError(f"merge: expected a {expected}, found a {found}")
    own, others = _encoder_of(mine), _encoder_of(theirs)
    if describe(own, ENCODERS) != describe(others, ENCODERS):
        raise ValueError(f"merge: expected the encoder {own!r}, found {others!r}")


def check_mergeable(mine: Estimator, theirs: Estimator) -> None:
    """Raise ValueError for trained models, of one kind, of other frames or with encoders that have
    learned other things."""
    kind = type(mine).__name__
    inputs.check_shape(theirs.frame_shape_, mine.frame_shape_, kind)
    mine._check_columns(theirs._columns)
    own = mine.encoder_
    learned = theirs.encoder_.state()
    for name, tensor in own.state().items():
        if not torch.equal(tensor, learned[name]):
            raise ValueError(
                f"merge: expected two encoders {own!r} that have learned the same, found two that "
                "have learned of different frames; fit anew on all of them"
            )


def _kind(model: Estimator) -> str:
    return f"{type(model).__name__} with read-out {make_readout(model.readout)!r}"


def _encoder_of(model: Estimator) -> Encoder:
    """The trained encoder, or the one that is to be trained."""
    return getattr(model, "encoder_", None) or make_encoder(model.encoder)
