"""Discriminant analysis with a kernel of Hamming distances: against its definition, in floats."""

import itertools

import numpy as np
import pytest
import torch

from hdc import bits
from hdc.readouts import Kernel
from hdc.readouts.kernel import median_of_pairs
from tests.hdc import own
from tests.hdc.definition import discriminants, inside


def problem(n, d, n_classes, seed=0):
    """Bits bool [n, d] of classes of unequal size, and the classes [n]."""
    rng = np.random.default_rng(seed)
    others = rng.integers(0, n_classes, n - n_classes)
    rows = np.concatenate([np.arange(n_classes), others])
    share = rng.random((n_classes, d)) * 0.4 + 0.3
    return rng.random((n, d)) < share[rows], rows


def packed(masks):
    return bits.pack(torch.from_numpy(masks))


def likeness(a, b, reach):
    return np.exp(-(a[:, None] != b).sum(2) / reach)


def median(masks):
    """The lower median of the distances of pairs."""
    pairs = itertools.combinations(masks, 2)
    distances = sorted(int((a != b).sum()) for a, b in pairs)
    return distances[(len(distances) - 1) // 2]


def scores_of(masks, rows, asked, reach, penalty):
    """In coordinates of which the kernel is the product."""
    whole = likeness(np.concatenate([masks, asked]), masks, reach)
    values, vectors = np.linalg.eigh(whole[: len(masks)])
    kept = values > 1e-12
    found = whole @ vectors[:, kept] / np.sqrt(values[kept])
    return discriminants(found[: len(masks)], rows, found[len(masks) :], penalty)


def strength(masks, rows, reach, factor):
    """ℓ = λ·tr(K)/N: a share of the mean square distance from the mean of a class.

    Of frames of one class the squares are those of the kernel minus its mean.
    """
    kernel = likeness(masks, masks, reach)
    centred = inside(kernel, rows)
    return factor * centred.diagonal().sum() / len(masks)


def fitted(masks, rows, **parameters):
    given = packed(masks), torch.from_numpy(rows), int(rows.max()) + 1
    return own.fitted(Kernel(**parameters), *given, masks.shape[1])


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
    found = model.scores(packed(asked)).numpy()
    np.testing.assert_allclose(found, expected, atol=1e-8)


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
    model = fitted(masks, rows, scales=[0.25, 0.5, 1, 2, 8], penalties=[0.03, 0.3, 3])
    best = min(errors, key=errors.__getitem__)  # the first of equal ones
    assert (float(model.scale_), float(model.penalty_)) == best
    held_out = model.held_out()
    wrong = held_out.scores.argmax(1) != held_out.rows
    assert int(wrong.sum()) == errors[best]


@pytest.mark.parametrize("n", [1, 2, 3, 4, 9])
def test_the_median_is_that_of_pairs(n):
    masks = np.random.default_rng(n).random((n, 300)) < 0.3
    words = packed(masks)
    if n > 1:
        assert median_of_pairs(bits.hamming(words, words)) == median(masks)
    assert median_of_pairs(torch.zeros(n, n, dtype=torch.int64)) == 1
