"""Shrinkage discriminant analysis: against the primal form, in floats, and scikit-learn."""

from __future__ import annotations

import warnings

import numpy as np
import pytest
import torch
from sklearn.covariance import OAS, LedoitWolf

from hdc import backends, bits
from hdc.bits import combinations, gram
from hdc.hypervectors import Hypervectors
from hdc.readouts import LDA, among_bits
from hdc.readouts.among_bits import ProblemAmongBits, scatter
from hdc.readouts.discriminant import Problem
from hdc.readouts.discriminant import discriminants as left_out
from hdc.readouts.lda import shrunken
from tests.hdc.definition import discriminants
from tests.hdc.definition import scatter as scatter_trace
from tests.hdc.own import by, fitted


def problem(
    n: int, d: int, n_classes: int, seed: int
) -> tuple[np.ndarray, torch.Tensor, torch.Tensor]:
    """Bits in ±1 [n, d], packed ones, and classes of unequal size, the last of one frame."""
    rng = np.random.default_rng(seed)
    rows = np.concatenate(
        [np.arange(n_classes), rng.integers(0, n_classes - 1, n - n_classes)]
    )
    share = rng.random((n_classes, d))
    x = np.where(rng.random((n, d)) < share[rows], 1.0, -1.0)
    x[:, 5] = 1  # a pixel that is the same in all frames
    return x, bits.pack(torch.from_numpy(x > 0)), torch.from_numpy(rows)


def dual(words: torch.Tensor, rows: torch.Tensor, d: int, shrinkage):
    """α and what is learned by the dual form."""
    return shrunken(Problem.of(gram(words, words, d), rows), d, shrinkage)


def by_definition(x, rows, asked, alpha) -> np.ndarray:
    penalty = None
    if alpha < 1:
        penalty = alpha / (1 - alpha) * scatter_trace(x, rows) / x.shape[1]
    return discriminants(x, rows, asked, penalty)


@pytest.mark.parametrize("alpha", [0.01, 0.3, 0.9, 0.999, 1.0])
@pytest.mark.parametrize(("n", "d"), [(40, 130), (200, 65), (12, 1000)])
def test_the_dual_form_is_the_primal_one(n, d, alpha):
    x, words, rows = problem(n, d, 4, 1)
    asked, _, _ = problem(30, d, 4, 2)
    used, learned = dual(words, rows, d, alpha)
    assert used == alpha
    found = asked @ (x.T @ learned.dual.numpy()) + learned.offsets.numpy()
    expected = by_definition(x, rows.numpy(), asked, alpha)
    np.testing.assert_allclose(found, expected, atol=1e-9 * np.abs(expected).max())


def test_scores_are_the_stated_function_of_the_stored_integers():
    x, words, rows = problem(60, 333, 4, 3)
    model = fitted(LDA(), words, rows, 4, 333)
    planes = bits.unpack(model.weights_, 333).long()
    q = sum(planes[:, p] << p for p in range(4)) - 8
    assert q.min() >= -7
    assert q.max() == 7
    assert (q[:, 5] == 0).all()  # the pixel that never changes says nothing
    products = torch.from_numpy(x).long() @ q.T
    expected = products * model.scales_ + model.offsets_
    assert torch.equal(model.scores(words), expected)
    assert model.scales_.max() == 2**20


# Among the bits, where these are fewer than the frames --------------------------------------------


@pytest.mark.parametrize("shrinkage", ["ledoit_wolf", "oas", 0.01, 1.0])
@pytest.mark.parametrize(("n", "d"), [(200, 65), (40, 130)])
def test_among_frames_and_among_bits_it_is_the_same(n, d, shrinkage, monkeypatch):
    """Weights, offsets and scores of left-out frames."""
    monkeypatch.setattr(among_bits, "_SIGNS", 7 * d)
    x, words, rows = problem(n, d, 4, 1)
    alpha, frames = dual(words, rows, d, shrinkage)
    given = ProblemAmongBits.of(Hypervectors(words, d), rows)
    other, bits_ = shrunken(given, d, shrinkage)
    assert other == pytest.approx(alpha, rel=1e-12)
    close = {"rtol": 1e-7, "atol": 1e-9}
    weights = torch.from_numpy(x.T @ frames.dual.numpy())
    torch.testing.assert_close(bits_.dual, weights, **close)
    torch.testing.assert_close(bits_.offsets, frames.offsets, **close)
    for found, expected in zip(
        left_out(bits_.products, rows), left_out(frames.products, rows), strict=True
    ):
        torch.testing.assert_close(found, expected, **close)


def inside(x: np.ndarray, rows: torch.Tensor) -> np.ndarray:
    """Frames minus the mean of their class."""
    of = rows.numpy()
    means = np.stack([x[of == c].mean(0) for c in range(of.max() + 1)])
    return x - means[of]


def test_scatter_is_exact(monkeypatch):
    """That of frames which differ from their class in one bit, too, and of one frame a class."""
    monkeypatch.setattr(among_bits, "_SIGNS", 3 * 40)
    x = np.ones((64, 40))
    x[:, ::3] = -1
    x[5, 7] = -1
    rows = torch.arange(64) % 2
    rows[0] = 2
    words = Hypervectors(bits.pack(torch.from_numpy(x > 0)), 40)
    found, means = scatter(words, rows)
    expected = np.zeros((40, 40))
    expected[7, 7] = 4 - 4 / 32  # n·v − s²/n of one −1 among 32
    assert (found.numpy() == expected).all()
    assert (means[2].numpy() == x[0]).all()
    assert means[1, 7] == 30 / 32


# Shrinkage ----------------------------------------------------------------------------------------


@pytest.mark.parametrize(("n", "d"), [(12, 30), (30, 200), (300, 65)])
def test_shrinkage_by_its_definition_and_that_of_scikit_learn(n, d):
    """Share of the squared distance from the mean variance that is chance, among the D pixels.

    Frames less the mean of their class have L degrees of freedom less than frames.
    """
    x, words, rows = problem(n, d, 5, 8)
    alpha, _ = dual(words, rows, d, "ledoit_wolf")
    within = inside(x, rows)
    degrees = n - 5
    covariance = within.T @ within / degrees
    fourth = (within**2).sum(1) ** 2
    chance = (fourth.sum() / degrees - (covariance**2).sum()) / degrees
    spread = (covariance**2).sum() - np.trace(covariance) ** 2 / d
    assert alpha == pytest.approx(min(1.0, max(0.0, chance / spread)))
    if n > 100:
        for name, estimator in (("ledoit_wolf", LedoitWolf), ("oas", OAS)):
            alpha, _ = dual(words, rows, d, name)
            expected = estimator(assume_centered=True).fit(within).shrinkage_
            assert alpha == pytest.approx(expected, rel=0.1)


# Edges --------------------------------------------------------------------------------------------


def test_without_two_different_frames_of_a_class_it_is_the_nearest_mean():
    rng = np.random.default_rng(8)
    means = np.where(rng.random((4, 700)) < 0.5, 1.0, -1.0)
    rows = torch.arange(4).repeat(3)
    words = bits.pack(torch.from_numpy(means > 0))[rows]
    with pytest.warns(UserWarning, match="lda: no class has two different frames"):
        model = fitted(LDA(), words, rows, 4, 700)
    assert float(model.shrinkage_) == 1
    flips = np.where(rng.random((99, 700)) < 0.3, -1, 1)
    queries = means[rng.integers(0, 4, 99)] * flips
    found = model.scores(bits.pack(torch.from_numpy(queries > 0))).argmax(1)
    nearest = ((queries[:, None] - means) ** 2).sum(2).argmin(1)
    assert found.tolist() == nearest.tolist()


def test_frames_that_are_all_equal_give_equal_scores():
    words = torch.full((6, 2), 7)
    with pytest.warns(UserWarning, match="no class has two different frames"):
        model = fitted(LDA(), words, torch.arange(6) % 3, 3, 100)
    assert len(set(model.scores(words).flatten().tolist())) == 1


def test_no_shrinkage_of_fewer_frames_than_bits_is_finite():
    _, words, rows = problem(30, 2000, 4, 9)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        model = fitted(LDA(0), words, rows, 4, 2000)
    assert (model.scores(words).argmax(1) == rows).all()


@pytest.mark.parametrize("backend", backends.BACKENDS)
def test_weights_are_sums_of_hypervectors(backend):
    if backend == "compiled":
        pytest.importorskip("numba")
    x, words, _ = problem(50, 333, 4, 11)
    rng = np.random.default_rng(0)
    for factors in (rng.normal(size=(50, 3)), rng.integers(-9, 10, (50, 3))):
        found = by(backend, combinations, torch.from_numpy(factors), words)[:, :333]
        np.testing.assert_allclose(found, (x.T @ factors).T, atol=1e-4)


@pytest.mark.parametrize("share", [0.0, 0.25, 1.0])
def test_discriminants_of_new_frames_are_mixed_in_by_their_lengths(share):
    """Up to rounding to four bits; of new frames as if not learnt."""
    _, words, rows = problem(60, 700, 3, seed=0)
    _, added, others = problem(40, 700, 3, seed=1)
    others[1] = 2  # the last class has two
    old, new = (
        fitted(LDA(0.5), w, r, 3, 700) for w, r in ((words, rows), (added, others))
    )
    before, after = (
        part / float(model.state.floats(700).norm())
        for part, model in ((1 - share, old), (share, new))
    )
    _, asked, _ = problem(50, 700, 3, seed=2)
    expected = before * old.scores(asked) + after * new.scores(asked)
    among = before * old.scores(added) + after * new.held_out(added, others).scores
    adapted = old.adapted(added, others, share)
    found, held_out = adapted.scores(asked), adapted.held_out(added, others)
    spread = float(expected.std())
    unit = float(found.double().std()) / spread  # all are whole numbers
    assert float((found / unit - expected).abs().max()) < 0.15 * spread
    assert torch.equal(held_out.rows, others)
    torch.testing.assert_close(
        held_out.scores / unit, among, rtol=1e-2, atol=1e-2 * spread
    )
