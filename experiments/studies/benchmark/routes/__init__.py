"""Routes of the benchmark: the same operation on the same bytes, ours and the peers' ways.

A file an operation, a small function a peer: a new peer is a new function there.
"""

from experiments.studies.benchmark.route import ROUTES
from experiments.studies.benchmark.routes import (
    bundle,
    encode,
    folder,
    hamming,
    predict,
    read,
    train,
)

__all__ = ["ROUTES", "bundle", "encode", "folder", "hamming", "predict", "read", "train"]
