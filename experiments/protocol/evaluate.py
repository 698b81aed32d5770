"""Accuracy of predictions, its interval, and the confusion matrix."""

from hdc.accuracy import accuracy, confusion, wilson

__all__ = ["accuracy", "confusion", "wilson"]
