"""For tests: read-outs on bare words, one backend or the other, and a read-out of one's own."""

from __future__ import annotations

from dataclasses import dataclass
from importlib.util import find_spec
from typing import Any

import pytest
import torch
from torch import Tensor

from hdc import backends, bits
from hdc.hypervectors import Hypervectors
from hdc.readouts import Readout, State

KERNELS = find_spec("numba") is not None
needs_numba = pytest.mark.skipif(not KERNELS, reason="numba is not installed")
BACKENDS = ["numpy", pytest.param("compiled", marks=needs_numba)]


def by(backend, call, *arguments):
    """A call by a backend."""
    with backends.computing(backend):
        return call(*arguments)


@dataclass
class Learned:
    """A read-out with its state, asked with packed words of D bits."""

    readout: Any
    state: Any
    dimension: int

    def scores(self, packed):
        return self.readout.scores(self.state, Hypervectors(packed, self.dimension))

    def held_out(self, packed=None, rows=None):
        words = None if packed is None else Hypervectors(packed, self.dimension)
        return self.readout.held_out(self.state, words, rows)

    def adapted(self, packed, *given):
        words = Hypervectors(packed, self.dimension)
        state = self.readout.adapt(self.state, words, *given)
        return Learned(self.readout, state, self.dimension)

    def __getattr__(self, name):
        return getattr(self.state, name.removesuffix("_"))


def fitted(readout, packed, *given):
    """A read-out that has learned packed words of rows, or values; D stands last."""
    *others, dimension = given
    state = readout.fit(Hypervectors(packed, dimension), *others)
    return Learned(readout, state, dimension)


@dataclass(frozen=True, kw_only=True, eq=False)
class Means(State):
    means: Tensor


class Nearest(Readout):
    """The nearest mean hypervector of a class, without scores in closed form."""

    State = Means

    def fit(self, words, rows, n_classes):
        ones = bits.unpack(words.packed, words.dimension).double()
        means = [ones[rows == c].mean(0) for c in range(n_classes)]
        return Means(means=torch.stack(means))

    def scores(self, state, words):
        ones = bits.unpack(words.packed, words.dimension).double()
        return -(torch.cdist(ones, state.means) ** 2)
