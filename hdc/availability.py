"""Why a classifier lacks a method, by its encoder and its read-out; None where it has it."""

from __future__ import annotations

from hdc.encoders import Encoder, RelativeEncoder, make_encoder
from hdc.estimator import Estimator
from hdc.readouts import Counting, Readout, Updatable, make_readout


def whole_only(model: Estimator) -> str | None:
    """Why a model does not learn batch by batch."""
    readout, wrong = _readout_of(model)
    if isinstance(readout, Updatable):
        return None
    return wrong or (
        f"expected a read-out that learns batch by batch, found {readout!r}, which needs all "
        "frames at once; fit anew"
    )


def without_held_out(model: Estimator) -> str | None:
    """Why a model has no probabilities."""
    readout, wrong = _readout_of(model)
    if readout is None:
        return wrong
    own = type(readout).held_out is not Readout.held_out
    if own or not isinstance(readout, Updatable):
        return None
    return f"expected a read-out with a method held_out, found {readout!r}"


def not_compared(model: Estimator) -> str | None:
    """Why a model has no frames to compare new ones with."""
    readout, _ = _readout_of(model)
    return None if isinstance(readout, Counting) else without_held_out(model)


def fixed(model: Estimator) -> str | None:
    """Why a model does not adapt to labelled frames."""
    readout, wrong = _readout_of(model)
    if hasattr(readout, "adapt"):
        return None
    return wrong or f"expected a read-out that adapts, found {readout!r}; fit anew"


def without_reference(model: Estimator) -> str | None:
    """Why a model has no reference to move."""
    try:
        encoder: Encoder = make_encoder(model.encoder)
    except (TypeError, ValueError) as error:
        return str(error)
    if isinstance(encoder, RelativeEncoder):
        return None
    return (
        f"expected an encoder with a reference, such as 'reference', found {encoder!r}"
    )


def _readout_of(model: Estimator) -> tuple[Readout | None, str | None]:
    """The read-out of a model, or what is wrong with it."""
    try:
        return make_readout(model.readout), None
    except (TypeError, ValueError) as error:
        return None, str(error)
