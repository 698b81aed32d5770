"""The inner loops on the CPU as machine code: encoding frames, counting, distances.

Imported only where it is used, since importing numba takes as long as everything else here. The
results equal those by numpy bit for bit; only weighted sums of numbers that are not whole
(:func:`combine`) may differ in their last digits. The first import on a machine compiles (some
ten seconds) and keeps the code beside these files, in the user's cache folder, or in this process
only; see :mod:`hdc.backends`.
"""

from __future__ import annotations

from hdc.compiled.combine import combine
from hdc.compiled.count import count_into, weighted_hamming
from hdc.compiled.encode import encode
from hdc.compiled.relative import exceed, in_steps, sums

__all__ = [
    "combine",
    "count_into",
    "encode",
    "exceed",
    "in_steps",
    "sums",
    "weighted_hamming",
]
