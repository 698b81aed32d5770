"""The Pareto front of training time and error."""

from __future__ import annotations

import numpy as np
import pandas as pd


def is_on_front(times: pd.Series, errors: pd.Series) -> np.ndarray:
    """Whether no other point has less time and less error, or as much of one and less of the other,
    bool [N]; of equal points all are on it."""
    points = np.column_stack([times, errors])
    no_worse = (points[:, None] <= points).all(axis=2)
    better = (points[:, None] < points).any(axis=2)
    beaten: np.ndarray = np.any(no_worse & better, axis=0)
    return ~beaten
