"""Read-outs: hypervectors to classes or numbers, one idea a file."""

from __future__ import annotations

from typing import Any

from hdc.parameters import make_part
from hdc.readouts.base import Readout, Updatable
from hdc.readouts.counts import Counts
from hdc.readouts.kernel import Kernel
from hdc.readouts.lda import LDA
from hdc.readouts.majority import Counting, Majority
from hdc.readouts.neighbours import Neighbours
from hdc.readouts.ridge import Ridge, RidgeValues
from hdc.readouts.trained import Trained
from hdc.readouts.values import NeighbourValues, ValueReadout

__all__ = [
    "LDA",
    "READOUTS",
    "VALUE_READOUTS",
    "Counting",
    "Counts",
    "Kernel",
    "Majority",
    "NeighbourValues",
    "Neighbours",
    "Readout",
    "Ridge",
    "RidgeValues",
    "Trained",
    "Updatable",
    "ValueReadout",
    "make_readout",
    "make_value_readout",
]

READOUTS: dict[str, type[Readout]] = {
    "majority": Majority,
    "counts": Counts,
    "ridge": Ridge,
    "neighbours": Neighbours,
    "lda": LDA,
    "trained": Trained,
    "kernel": Kernel,
}
"""Our own read-outs of classes by name."""

VALUE_READOUTS: dict[str, type[ValueReadout]] = {
    "ridge": RidgeValues,
    "neighbours": NeighbourValues,
}
"""Our own read-outs of numbers by name."""


def make_readout(part: Any) -> Readout:
    """A read-out of classes of a name, a dotted name ``"module.Class"``, or an object.

    Raises:
        ValueError, TypeError: as of :func:`hdc.parameters.make_part`.
    """
    return make_part(part, "readout", READOUTS, Readout)  # type: ignore[return-value]


def make_value_readout(part: Any) -> ValueReadout:
    """A read-out of numbers, as :func:`make_readout`."""
    return make_part(part, "readout", VALUE_READOUTS, ValueReadout)  # type: ignore[return-value]
