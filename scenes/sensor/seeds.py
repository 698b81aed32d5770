"""Random streams that have addresses.

A stream is named by a seed, a purpose and counters such as (session, sample). The noise of sample
17 of session 1 is the same in any order, in any batch and with any number of threads.
``SeedSequence`` hashes the address into independent 128-bit states (O'Neill's seed_seq_fe,
https://numpy.org/doc/stable/reference/random/parallel.html); SFC64 is the fastest generator of
numpy.
"""

from __future__ import annotations

import zlib

import numpy as np


def stream(seed: int, purpose: str, *counters: int) -> np.random.Generator:
    """The generator at the address (seed, purpose, counters)."""
    key = [zlib.crc32(purpose.encode())]
    key += [int(counter) for counter in counters]
    address = np.random.SeedSequence(seed, spawn_key=tuple(key))
    return np.random.Generator(np.random.SFC64(address))
