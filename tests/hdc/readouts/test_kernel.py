"""Discriminant analysis with a kernel of Hamming distances: against its definition, in floats."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
import torch

from hdc import bits
from hdc.readouts import Kernel
from hdc.readouts.kernel import median_of_pairs
from tests.hdc import own
from tests.hdc.definition import discriminants, scatter


def problem(n: int, d: int, n_classes: int, seed: int = 0):
    """Bits bool [n, d] of classes of unequal size, and the classes [n]."""
    rng = np.random.default_rng(seed)
    rows = np.concatenate(
        [np.arange(n_classes), rng.integers(0, n_classes, n - n_classes)]
    )
    share = rng.random((n_classes, d)) * 0.4 + 0.3
    return rng.random((n, d)) < share[rows], rows


def likeness(a: np.ndarray, b: np.ndarray, reach: float) -> np.ndarray:
    return np.exp(-(a[:, None] != b).sum(2) / reach)


def median(masks: np.ndarray) -> int:
    pairs = itertools.combinations(masks, 2)
    return sorted(int((a != b).sum()) for a, b in pairs)[
        (len(masks) * (len(masks) - 1) // 2 - 1) // 2
    ]


def coordinates(masks: np.ndarray, asked: np.ndarray, reach: float):
    """Those of frames and of queries, of which the kernel is the product."""
    whole = likeness(np.concatenate([masks, asked]), masks, reach)
    values, vectors = np.linalg.eigh(whole[: len(masks)])
    kept = values > 1e-12
    found = whole @ vectors[:, kept] / np.sqrt(values[kept])
    return found[: len(masks)], found[len(masks) :]


def scores_of(masks, rows, asked, reach, penalty) -> np.ndarray:
    x, queries = coordinates(masks, asked, reach)
    return discriminants(x, rows, queries, penalty)


def strength(masks, rows, reach, factor) -> float:
    """ℓ = λ·tr(K)/N: a share of the mean square distance from the mean of a class."""
    x, _ = coordinates(masks, masks, reach)
    return factor * scatter(x, rows) / len(masks)


def fitted(masks, rows, n_classes=None, **parameters):
    words = bits.pack(torch.from_numpy(masks))
    count = n_classes or rows.max() + 1
    rows = torch.from_numpy(rows)
    return own.fitted(Kernel(**parameters), words, rows, count, masks.shape[1])


@pytest.mark.parametrize("d", [65, 1000])
@pytest.mark.parametrize("scale", [0.25, 1, 2])
@pytest.mark.parametrize("factor", [0.03, 0.3])
def test_scores_are_those_of_the_primal_form(d, scale, factor):
    masks, rows = problem(40, d, 4)
    asked, _ = problem(30, d, 4, seed=1)
    model = fitted(masks, rows, scales=[scale], penalties=[factor])
    reach = scale * median(masks)
    assert float(model.reach_) == reach
    penalty = strength(masks, rows, reach, factor)
    expected = scores_of(masks, rows, asked, reach, penalty)
    found = model.scores(bits.pack(torch.from_numpy(asked))).numpy()
    assert found.dtype == np.float64
    np.testing.assert_allclose(found, expected, atol=1e-8)
    assert np.array_equal(found.argmax(1), expected.argmax(1))


def test_factors_have_the_fewest_errors_on_frames_left_out():
    """Each of the frames trained without, with distance and penalty of all."""
    masks, rows = problem(45, 65, 5, seed=3)
    several = np.bincount(rows)[rows] > 1
    errors = {}
    for scale, factor in itertools.product([0.25, 0.5, 1, 2, 8], [0.03, 0.3, 3]):
        reach = scale * median(masks)
        penalty = strength(masks, rows, reach, factor)
        wrong = 0
        for i in np.flatnonzero(several):
            others = np.arange(45) != i
            found = scores_of(masks[others], rows[others], masks[[i]], reach, penalty)
            wrong += int(found.argmax() != rows[i])
        errors[scale, factor] = wrong
    assert len(set(errors.values())) > 3
    factors = list(errors)
    model = fitted(masks, rows, scales=[0.25, 0.5, 1, 2, 8], penalties=[0.03, 0.3, 3])
    best = min(factors, key=errors.__getitem__)  # the first of equal ones
    assert (float(model.scale_), float(model.penalty_)) == best
    held_out = model.held_out()
    wrong = held_out.scores.argmax(1) != held_out.rows
    assert int(wrong.sum()) == errors[best]


@pytest.mark.parametrize("n", [1, 2, 3, 4, 9])
def test_the_median_is_that_of_pairs(n):
    masks = np.random.default_rng(n).random((n, 300)) < 0.3
    words = bits.pack(torch.from_numpy(masks))
    if n > 1:
        assert median_of_pairs(bits.hamming(words, words)) == median(masks)
    assert median_of_pairs(torch.zeros(n, n, dtype=torch.int64)) == 1


def test_one_frame_a_class_is_the_nearest_mean():
    masks = np.random.default_rng(0).random((4, 65)) < 0.5
    with pytest.warns(UserWarning, match="kernel: no class has two different frames"):
        model = fitted(masks, np.arange(4))
    asked, _ = problem(9, 65, 4, seed=1)
    found = model.scores(bits.pack(torch.from_numpy(asked))).numpy()
    expected = scores_of(masks, np.arange(4), asked, median(masks), None)
    np.testing.assert_allclose(found, expected, atol=1e-8)
    assert len(model.held_out().rows) == 0


@pytest.mark.parametrize("share", [0.0, 0.25, 1.0])
def test_discriminants_of_new_frames_are_mixed_in_by_their_lengths(share):
    """Each in units of its length in the space of the kernel; of new frames as if not learnt."""
    first, rows = problem(40, 300, 3)
    second, others = problem(30, 300, 3, seed=1)
    old = fitted(first, rows)
    reach, penalty = float(old.reach_), float(old.penalty_)
    scale = reach / median(second)
    new = fitted(second, others, scales=[scale], penalties=[penalty])
    lengths = []
    for masks, model in ((first, old), (second, new)):
        dual = model.dual_.numpy()
        products = likeness(masks, masks, reach) @ dual
        lengths.append(np.sqrt((dual * products).sum()))
    before, after = (1 - share) / lengths[0], share / lengths[1]
    asked = bits.pack(torch.from_numpy(problem(20, 300, 3, seed=2)[0]))
    expected = before * old.scores(asked) + after * new.scores(asked)
    words = bits.pack(torch.from_numpy(second))
    left_out = new.held_out()
    among = before * old.scores(words) + after * left_out.scores
    adapted = old.adapted(words, torch.from_numpy(others), share)
    torch.testing.assert_close(adapted.scores(asked), expected, rtol=1e-9, atol=1e-9)
    found = adapted.held_out()
    torch.testing.assert_close(found.scores, among, rtol=1e-9, atol=1e-9)
    assert torch.equal(found.rows, torch.from_numpy(others))
