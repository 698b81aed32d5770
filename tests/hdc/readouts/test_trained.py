"""Prototypes corrected by their mistakes, against plain loops."""

import numpy as np
import pytest
import torch

from hdc import bits
from hdc.readouts import Trained
from tests.hdc.own import BACKENDS, by, fitted


def plain_prototypes(x, rows, n_classes, margin, passes):
    """Signs of counters of ±1 hypervectors, corrected by 1/p after pass p, frame by frame."""
    counters = np.stack([x[rows == c].sum(0) for c in range(n_classes)]).astype(float)
    for number in range(1, passes + 1):
        prototypes = np.where(counters > 0, 1, -1)
        steps = np.zeros_like(counters)
        for frame, row in zip(x, rows, strict=True):
            distances = (frame != prototypes).sum(1)
            others = [c for c in range(n_classes) if c != row]
            rival = min(others, key=distances.__getitem__)  # the first of equal ones
            if distances[rival] - distances[row] < margin * len(frame):
                steps[row] += frame
                steps[rival] -= frame
        counters += steps / number
    return np.where(counters > 0, 1, -1)


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("passes", [0, 1, 2, 5, 12])
@pytest.mark.parametrize("margin", [0, 0.02, 0.3])
def test_the_rule_by_plain_loops(margin, passes, backend):
    rng = np.random.default_rng(passes)
    rows = np.arange(17) % 3
    share = 0.5 + 0.3 * (rng.random((3, 90)) - 0.5)
    x = np.where(rng.random((17, 90)) < share[rows], 1, -1)
    words = bits.pack(torch.from_numpy(x > 0))
    given = Trained(margin, passes), words, torch.from_numpy(rows), 3, 90
    model = by(backend, fitted, *given)
    expected = plain_prototypes(x, rows, 3, margin, passes)
    found = 2 * bits.unpack(model.prototypes_, 90).long() - 1
    assert found.tolist() == expected.tolist()
    scores = model.scores(words)
    assert torch.equal(scores, -bits.hamming(words, model.prototypes_))
