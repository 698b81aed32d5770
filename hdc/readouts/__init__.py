"""Read-outs: classes or numbers from hypervectors, one method per file."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from hdc.parameters import Family
from hdc.readouts.base import HeldOut, Readout, State, Updatable
from hdc.readouts.majority import Counting
from hdc.readouts.values import ValueReadout, ValueState

if TYPE_CHECKING:
    from hdc.readouts.counts import Counts
    from hdc.readouts.kernel import Kernel
    from hdc.readouts.lda import LDA
    from hdc.readouts.majority import Majority
    from hdc.readouts.neighbours import Neighbours
    from hdc.readouts.ridge import Ridge, RidgeValues
    from hdc.readouts.trained import Trained
    from hdc.readouts.values import NeighbourValues

__all__ = [
    "LDA",
    "READOUTS",
    "VALUE_READOUTS",
    "Counting",
    "Counts",
    "HeldOut",
    "Kernel",
    "Majority",
    "NeighbourValues",
    "Neighbours",
    "Readout",
    "Ridge",
    "RidgeValues",
    "State",
    "Trained",
    "Updatable",
    "ValueReadout",
    "ValueState",
    "make_readout",
]

READOUTS = Family(
    "readout",
    Readout,
    {
        "majority": "hdc.readouts.majority.Majority",
        "counts": "hdc.readouts.counts.Counts",
        "ridge": "hdc.readouts.ridge.Ridge",
        "neighbours": "hdc.readouts.neighbours.Neighbours",
        "lda": "hdc.readouts.lda.LDA",
        "trained": "hdc.readouts.trained.Trained",
        "kernel": "hdc.readouts.kernel.Kernel",
    },
)
"""Our own read-outs of classes by name."""
VALUE_READOUTS = Family(
    "readout",
    ValueReadout,
    {
        "ridge": "hdc.readouts.ridge.RidgeValues",
        "neighbours": "hdc.readouts.values.NeighbourValues",
    },
)
"""Our own read-outs of numbers by name."""
make_readout: Callable[..., Readout] = READOUTS
"""A read-out of classes from a name, a dotted name ``"module.Class"``, or an object; see
:class:`hdc.parameters.Family`."""


def __getattr__(name: str) -> Any:
    """The read-outs, imported when asked for."""
    of = VALUE_READOUTS if name.endswith("Values") else READOUTS
    return of.attribute(__name__, name)
