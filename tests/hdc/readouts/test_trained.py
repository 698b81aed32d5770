"""Prototypes corrected by their mistakes, against plain loops."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from hdc import bits
from hdc.readouts import Trained
from tests.hdc.own import by, fitted


def plain_prototypes(
    x: list[list[int]], rows: list[int], n_classes: int, margin: float, passes: int
) -> list[list[int]]:
    """Signs of counters of ±1 hypervectors, corrected by 1/p after pass p, by loops."""
    d = len(x[0])
    counters = [[0.0] * d for _ in range(n_classes)]
    for frame, row in zip(x, rows, strict=True):
        for j in range(d):
            counters[row][j] += frame[j]

    def prototypes() -> list[list[int]]:
        return [[1 if count > 0 else -1 for count in counter] for counter in counters]

    for number in range(1, passes + 1):
        current = prototypes()
        changes = []
        for frame, row in zip(x, rows, strict=True):
            distances = [
                sum(a != b for a, b in zip(frame, p, strict=True)) for p in current
            ]
            others = [c for c in range(n_classes) if c != row and c in rows]
            rival = min(others, key=lambda c: (distances[c], c))
            if distances[rival] - distances[row] < margin * d:
                changes.append((frame, row, rival))
        steps = [[0] * d for _ in range(n_classes)]
        for frame, row, rival in changes:
            for j in range(d):
                steps[row][j] += frame[j]
                steps[rival][j] -= frame[j]
        for c in range(n_classes):
            for j in range(d):
                counters[c][j] += steps[c][j] / number
        if not changes:
            break
    return prototypes()


def problem(n: int, d: int, seed: int) -> tuple[np.ndarray, torch.Tensor, torch.Tensor]:
    rng = np.random.default_rng(seed)
    rows = np.arange(n) % 3
    share = 0.5 + 0.3 * (rng.random((3, d)) - 0.5)
    x = np.where(rng.random((n, d)) < share[rows], 1, -1)
    return x, bits.pack(torch.from_numpy(x > 0)), torch.from_numpy(rows)


@pytest.mark.parametrize("backend", ["numpy", "compiled"])
@pytest.mark.parametrize("passes", [0, 1, 2, 5, 12])
@pytest.mark.parametrize("margin", [0, 0.02, 0.3])
def test_the_rule_by_plain_loops(margin, passes, backend):
    if backend == "compiled":
        pytest.importorskip("numba")
    x, words, rows = problem(17, 90, passes)
    # The last class has no frames.
    model = by(backend, fitted, Trained(margin, passes), words, rows, 4, 90)
    expected = plain_prototypes(x.tolist(), rows.tolist(), 4, margin, passes)
    found = 2 * bits.unpack(model.prototypes_, 90).long() - 1
    assert found[:3].tolist() == expected[:3]
    scores = model.scores(words)
    assert torch.equal(scores[:, :3], -bits.hamming(words, model.prototypes_[:3]))
    assert (scores.argmax(1) < 3).all()
