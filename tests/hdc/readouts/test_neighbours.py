"""Nearest training frames, against plain loops."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from hdc import HDCClassifier, bits
from hdc.readouts import Neighbours
from tests.hdc.own import by, fitted


def plain_winner(distances: list[int], rows: list[int], k: int) -> int:
    """The class of most of the k nearest frames; equal distances go by class, equal votes by
    distance."""
    nearest = sorted(zip(distances, rows, strict=True))[:k]
    votes = [row for _, row in nearest]
    best = max(votes.count(row) for row in votes)
    closest = {row: min(d for d, r in zip(distances, rows, strict=True) if r == row)
               for row in votes if votes.count(row) == best}  # fmt: skip
    return min(closest, key=lambda row: (closest[row], row))


@pytest.mark.parametrize("k", [1, 2, 3, 4, 7, 100])
@pytest.mark.parametrize("backend", ["numpy", "compiled"])
def test_the_vote_by_plain_loops_in_any_order_of_training(k, backend):
    """Few bits, so that distances are often equal."""
    if backend == "compiled":
        pytest.importorskip("numba")
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
        parts = fitted(Neighbours(k), words[order[:9]], rows[order[:9]], 4, 7)
        parts = parts.added(words[order[9:]], rows[order[9:]])
        assert torch.equal(parts.scores(queries), model.scores(queries))


def test_neighbours_of_a_class_are_replaced(frames_and_labels):
    (frames, labels), queries = frames_and_labels(40, 4), frames_and_labels(60, 4)[0]
    whole = HDCClassifier(readout="neighbours").fit(frames, labels)
    with pytest.raises(
        ValueError, match=r"with read-out Neighbours\(.*found .*Majority\("
    ):
        whole.merge(HDCClassifier().fit(frames, labels))
    new = labels[:20] == 2
    whole.recalibrate(queries[:20][new], labels[:20][new])
    assert len(whole.state_.frames) == 30 + 5
    assert whole.counts_.tolist() == [10, 10, 5, 10]
    assert (whole.predict(queries[:20][new]) == 2).all()


def test_rows_follow_their_classes_of_which_there_may_be_none():
    none = torch.empty(0, 1, dtype=torch.int64), torch.empty(0, dtype=torch.int64)
    model = fitted(Neighbours(), *none, 0, 7)
    model = model.arranged([], 2).merged(fitted(Neighbours(), *none, 0, 7), [])
    model = model.added(torch.tensor([[1], [127]]), torch.tensor([1, 0]))
    other = fitted(Neighbours(), torch.tensor([[6]]), torch.tensor([0]), 1, 7)
    model = model.arranged([2, 0], 3).merged(other, [1])
    assert model.rows_.tolist() == [0, 2, 1]
    assert model.frames_.tolist() == [[1], [127], [6]]
    # Of 3 bits and 7 bits: distances to 1, to 6 and to 127.
    assert model.scores(torch.tensor([[7], [0]])).tolist() == [
        [-2, -1, -4],
        [-1, -2, -7],
    ]


def test_a_frame_that_differs_in_every_bit_votes_like_any_other():
    words = torch.tensor([[0b0111111], [0b1111111], [0b1111111], [0b1111111]])
    model = fitted(Neighbours(4), words, torch.tensor([0, 1, 1, 1]), 2, 7)
    assert model.scores(torch.zeros(1, 1, dtype=torch.int64)).argmax(1).tolist() == [1]
