"""Random streams that are addressed, not consumed.

A stream is named by a seed, a purpose and counters such as (session, sample). Whoever asks for the
noise of sample 17 of session 1 gets the same numbers, whatever was asked before, in whatever batch
and by however many threads. ``SeedSequence`` hashes the address into independent 128-bit states
(O'Neill's seed_seq_fe, https://numpy.org/doc/stable/reference/random/parallel.html); SFC64 is the
fastest of numpy's generators.
"""

from __future__ import annotations

import zlib

import numpy as np


def stream(seed: int, purpose: str, *counters: int) -> np.random.Generator:
    """The generator at the address (seed, purpose, counters)."""
    key = (zlib.crc32(purpose.encode()), *(int(c) for c in counters))
    return np.random.Generator(np.random.SFC64(np.random.SeedSequence(seed, spawn_key=key)))
