"""Hyperdimensional classification on packed bit tensors; needs torch and numpy only."""

from hdc.classifier import HDCClassifier

__all__ = ["HDCClassifier"]
