"""Draws: which frames of a scene train and which test, in one repetition of an experiment."""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from experiments.protocol import data
from scenes.frames import Scene


def draw_split(
    scene: Scene,
    split: Mapping[str, Any],
    seed: tuple[int, int],
    most_test: int,
) -> tuple[np.ndarray, np.ndarray]:
    """(pool, test) of one draw: frames that may train, and at most so many that test."""
    random = np.random.default_rng(seed)
    drawn = int(random.integers(2**31))
    config = {"group": None, **split, "n_train": None}
    # A random split of a recording leaks on purpose.
    with warnings.catch_warnings(action="ignore"):
        pool, test = data.choose(scene, config, drawn)
    if len(test) > most_test:
        shuffled = np.random.default_rng(drawn).permutation(test)
        test = np.sort(shuffled[:most_test])
    return pool, test


def nested(
    pool: np.ndarray,
    labels: np.ndarray,
    sizes: Sequence[int],
    seed: tuple[int, int],
) -> tuple[list[np.ndarray], list[int]]:
    """Frames of each class in random order, and the sizes that every class can fill."""
    random = np.random.default_rng((*seed, 1))
    shuffled = random.permutation(pool)
    class_of = labels[shuffled]
    order = [shuffled[class_of == c] for c in np.unique(class_of)]
    least = min(map(len, order))
    return order, [n for n in sizes if n <= least]
