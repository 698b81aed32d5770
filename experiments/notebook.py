"""Records from Python: as a data frame, and two models compared."""

from __future__ import annotations

import os
import warnings
from pathlib import Path

import numpy as np
import pandas as pd

from experiments.records.files import results_dir
from experiments.records.results import Results
from experiments.records.rows import pack_labels, unpack_labels
from experiments.reporting.estimates import Estimate, difference, mean_interval

_PACKED = ("labels", "predicted")


def results(folder: str | os.PathLike[str] | None = None) -> pd.DataFrame:
    """Every finished training of a folder of results, a line each.

    Args:
        folder: with ``records.jsonl``; None for that of own results.

    Returns:
        DataFrame: ``scene`` and ``model`` with what was changed of them in brackets, every key of
        the config by its dotted name, every result of the training (``test_accuracy_final``,
        ``training_time_s``, ``model_bytes``, ``predict_single_s`` …), and the classes of the test
        frames: ``labels`` and ``predicted``, arrays int64 [Q].

    Warns:
        UserWarning: of each record that cannot be used.
    """
    found = Results(results_dir() if folder is None else Path(folder))
    for problem in found.problems:
        warnings.warn(problem, stacklevel=2)
    lines = found.trainings()
    for name in _PACKED:
        if name in lines:
            lines[name] = lines[name].map(unpack_labels)
    return lines


def compare(
    a: pd.DataFrame, b: pd.DataFrame, groups: np.ndarray | None = None
) -> Estimate:
    """How much more accurate one model is than another on the same test frames: the difference of
    their shares of right answers, and its 95 % interval.

    Args:
        a, b: lines of :func:`results`, of one model each; paired by their seeds and test frames.
        groups: of each test frame, [Q]: the units are groups (objects, sessions), where a single
            recording gives no interval over seeds. Without, the units are seeds.

    Raises:
        ValueError: the two have no test frames in common, or `groups` is of another length.
    """
    if groups is None:
        found = difference(*(of.assign(**_packed(of)) for of in (a, b)))
    else:
        pairs = a.merge(b, on=["seeds", "test_set"], suffixes=("", "_of_b"))
        found = _by_group(pairs, np.asarray(groups)) if len(pairs) else None
    if found is None:
        raise ValueError("a, b: expected seeds and test frames in common, found none")
    return found


def _packed(lines: pd.DataFrame) -> dict[str, pd.Series]:
    return {name: lines[name].map(pack_labels) for name in _PACKED}


def _by_group(pairs: pd.DataFrame, groups: np.ndarray) -> Estimate:
    """The mean over groups of what is gained in each, over all pairs."""
    labels, *predicted = (
        np.stack(pairs[name]) for name in ("labels", "predicted", "predicted_of_b")
    )
    if groups.shape != labels.shape[1:]:
        expected = f"{labels.shape[1]}, one a test frame"
        raise ValueError(f"groups: expected {expected}, found {len(groups)}")
    right, of_b = (each == labels for each in predicted)
    mean = (right.astype(int) - of_b).mean(axis=0)
    return mean_interval([float(mean[groups == g].mean()) for g in np.unique(groups)])
