"""Nearest training frames, against plain loops."""

import numpy as np
import pytest
import torch

from hdc import HDCClassifier, bits
from hdc.readouts import Neighbours
from tests.hdc.net.frames import frames_of
from tests.hdc.own import BACKENDS, by, fitted


def plain_winner(distances, rows, k):
    """The class of most of the k nearest frames; equal distances go by class, equal votes by
    distance."""
    nearest = sorted(zip(distances, rows, strict=True))[:k]
    votes = [row for _, row in nearest]
    best = max(votes.count(row) for row in votes)
    closest = {row: d for d, row in reversed(nearest) if votes.count(row) == best}
    return min(closest, key=lambda row: (closest[row], row))


@pytest.mark.parametrize("k", [1, 2, 3, 4, 7, 100])
@pytest.mark.parametrize("backend", BACKENDS)
def test_the_vote_by_plain_loops_in_any_order_of_training(k, backend):
    """Few bits, so that distances are often equal."""
    rng = np.random.default_rng(k)
    words = torch.from_numpy(rng.integers(0, 2**7, (40, 1)))
    rows = torch.from_numpy(rng.integers(0, 4, 40))
    queries = torch.from_numpy(rng.integers(0, 2**7, (90, 1)))
    distances = bits.hamming(queries, words).tolist()
    expected = [plain_winner(row, rows.tolist(), k) for row in distances]
    for _ in range(4):
        order = torch.from_numpy(rng.permutation(40))
        model = fitted(Neighbours(k), words[order], rows[order], 4, 7)
        found = by(backend, model.scores, queries)
        assert found.argmax(1).tolist() == expected


def test_neighbours_of_a_class_are_replaced():
    (frames, labels), (queries, _) = frames_of("uint8", 30), frames_of("uint8", 15, 1)
    model = HDCClassifier(readout="neighbours").fit(frames, labels)
    new = labels[:15] == 2
    model.recalibrate(queries[new], labels[:15][new])
    assert len(model.state_.frames) == 20 + 5
    assert model.counts_.tolist() == [10, 10, 5]
    assert (model.predict(queries[new]) == 2).all()


def test_a_frame_that_differs_in_every_bit_votes_like_any_other():
    words = torch.tensor([[0b0111111], [0b1111111], [0b1111111], [0b1111111]])
    model = fitted(Neighbours(4), words, torch.tensor([0, 1, 1, 1]), 2, 7)
    assert model.scores(torch.zeros(1, 1, dtype=torch.int64)).argmax(1).tolist() == [1]
