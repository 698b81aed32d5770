"""Circular values, such as angles, by their cosine and sine."""

from __future__ import annotations

import numpy as np


def to_plane(values: np.ndarray, period: float) -> np.ndarray:
    """Cosines and sines float64 [N, 2·T] of values [N, T]."""
    angles = 2 * np.pi / float(period) * values
    return np.concatenate([np.cos(angles), np.sin(angles)], axis=1)


def from_plane(plane: np.ndarray, period: float) -> np.ndarray:
    """Values [N, T] from 0 to the period of points of the plane, whatever their distance from 0."""
    cosines, sines = np.split(plane, 2, axis=1)
    values: np.ndarray = np.arctan2(sines, cosines) * period / (2 * np.pi) % period
    return values


def errors(found: np.ndarray, truth: np.ndarray, period: float | None) -> np.ndarray:
    """Absolute errors; with a period, along the shorter arc."""
    away = np.abs(found - truth)
    if period is None:
        return away
    away = away % period
    return np.minimum(away, period - away)
