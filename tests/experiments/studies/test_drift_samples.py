"""Which new samples recalibrate: the first in time of each class, in turn."""

from __future__ import annotations

import numpy as np

from experiments.studies.drift.measure import Choice, subsets


def test_the_first_samples_of_each_class_come_before_the_second():
    """A session that begins with one class only: n samples have all classes nevertheless."""
    labels = np.array([0, 0, 0, 0, 1, 2, 1, 2, 2])
    pool = np.arange(9)  # in time order
    choice = Choice(np.array([]), pool, {})
    found = subsets(choice, labels, [3, 6])
    assert found[3].tolist() == [0, 4, 5]
    assert found[6].tolist() == [0, 4, 5, 1, 6, 7]
