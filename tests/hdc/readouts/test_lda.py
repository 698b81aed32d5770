"""Shrinkage discriminant analysis: against the primal form, in floats, and scikit-learn."""

import warnings

import numpy as np
import pytest
import torch
from sklearn.covariance import LedoitWolf

from hdc.hypervectors import Hypervectors
from hdc.readouts import LDA, among_bits
from hdc.readouts.discriminant import discriminants as left_out
from hdc.readouts.lda import problem_of, shrunken
from tests.hdc.definition import bits_of_classes, discriminants, inside
from tests.hdc.own import fitted


def problem(n, d, n_classes, seed):
    x, words, rows = bits_of_classes(n, d, n_classes, seed)
    return x, words, torch.from_numpy(rows)


@pytest.mark.parametrize("alpha", [0.01, 0.3, 0.999, 1.0])
@pytest.mark.parametrize(("n", "d"), [(40, 130), (12, 500), (70, 65)])
def test_discriminants_and_those_without_each_frame_by_their_definition(
    n, d, alpha, monkeypatch
):
    """Solved among frames, or among bits where these are fewer; ℓ stays that of all frames."""
    monkeypatch.setattr(among_bits, "_SIGNS", 7 * d)
    x, words, rows = bits_of_classes(n, d, 4, 1)
    asked, *_ = bits_of_classes(30, d, 4, 2)
    used, learned = shrunken(
        problem_of(Hypervectors(words, d), torch.from_numpy(rows)), d, alpha
    )
    assert used == alpha
    penalty = None
    if alpha < 1:
        penalty = alpha / (1 - alpha) * (inside(x, rows) ** 2).sum() / d
    weights = learned.dual.numpy()
    if n < d:
        weights = x.T @ weights
    found = asked @ weights + learned.offsets.numpy()
    expected = discriminants(x, rows, asked, penalty)
    np.testing.assert_allclose(found, expected, atol=1e-8 * np.abs(expected).max())
    scores, places = left_out(learned.products, torch.from_numpy(rows))
    assert places.tolist() == [i for i in range(n) if (rows == rows[i]).sum() > 1]
    for found, i in zip(scores, places.tolist(), strict=True):
        rest = np.arange(n) != i
        expected = discriminants(x[rest], rows[rest], x[i], penalty)
        np.testing.assert_allclose(found, expected, atol=1e-6 * np.abs(expected).max())


@pytest.mark.parametrize(("n", "d"), [(12, 30), (30, 200), (300, 65)])
def test_shrinkage_by_its_definition_and_that_of_scikit_learn(n, d):
    """Share of the squared distance from the mean variance that is chance, among the D pixels.

    Frames less the mean of their class have L degrees of freedom less than frames.
    """
    x, words, rows = bits_of_classes(n, d, 5, 8)
    given = Hypervectors(words, d), torch.from_numpy(rows)
    alpha, _ = shrunken(problem_of(*given), d, "ledoit_wolf")
    within = inside(x, rows)
    degrees = n - 5
    covariance = within.T @ within / degrees
    fourth = (within**2).sum(1) ** 2
    chance = (fourth.sum() / degrees - (covariance**2).sum()) / degrees
    spread = (covariance**2).sum() - np.trace(covariance) ** 2 / d
    assert alpha == pytest.approx(min(1.0, max(0.0, chance / spread)))
    if n > 100:
        expected = LedoitWolf(assume_centered=True).fit(within).shrinkage_
        assert alpha == pytest.approx(expected, rel=0.1)


@pytest.mark.parametrize("packed", [[7, 7], [1, 7]])
def test_without_two_different_frames_of_a_class_it_is_the_nearest_mean(packed):
    rows = torch.arange(6) % 2
    words = torch.tensor(packed)[rows, None]
    with pytest.warns(UserWarning, match="lda: no class has two different frames"):
        model = fitted(LDA(), words, rows, 2, 64)
    assert float(model.shrinkage_) == 1
    scores = model.scores(words)
    if packed == [7, 7]:
        assert len(scores.unique()) == 1
    else:
        assert (scores.argmax(1) == rows).all()


def test_no_shrinkage_of_fewer_frames_than_bits_is_finite():
    _, words, rows = problem(30, 2000, 4, 9)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        model = fitted(LDA(0), words, rows, 4, 2000)
    assert (model.scores(words).argmax(1) == rows).all()


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
