"""Experiments: compose a scene and a model, time the run, write the record, draw the results."""

REVISION = 2
"""Code version of :mod:`experiments.protocol`: raised when its numbers change."""
