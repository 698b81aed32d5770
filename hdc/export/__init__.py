"""A trained classifier as one header of C99, in integers alone, for a robot or a small board.

The header encodes a frame as the model does, in the same order of ties, and has the same scores,
bit for bit. It allocates nothing, calls no library, and keeps what it works with in a structure of
the caller's. docs/export.md shows it at work.
"""

from hdc.export.header import header
from hdc.export.plan import Plan
from hdc.export.vectors import test_vectors

__all__ = ["Plan", "header", "test_vectors"]
