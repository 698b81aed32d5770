"""What is computed in the space of samples is what is defined on the pixels."""

import numpy as np
import pytest
import torch
from sklearn.neighbors import NearestCentroid
from torch.nn import functional as F

from baselines.bank import KERNELS, Bank
from baselines.mean_image import MeanImage
from baselines.nearest_neighbour import NearestNeighbour
from baselines.ridge import RidgeReadout
from baselines.softmax_dual import DualSoftmaxRegression
from tests.baselines.scaled import scaled

TRAIN, QUERIES = np.arange(40), np.arange(40, 60)


def test_nearly_equal_frames_keep_ten_digits():
    extra = np.random.default_rng(0).integers(0, 2, (6, 40_000))
    centred = 6 * extra - extra.sum(0)
    exact = centred @ centred.T / (36 * 255.0**2)
    frames = torch.from_numpy((200 + extra).astype(np.uint8))
    gram, _ = Bank(frames, np.arange(6), 6).centred(np.arange(6), np.arange(0))
    np.testing.assert_allclose(gram, exact, atol=1e-10 * np.abs(exact).max())


@pytest.mark.parametrize("sixteen", [False, True])
@pytest.mark.parametrize("pixels", KERNELS)
def test_products_are_those_of_scaled_pixels_less_their_mean(pixels, sixteen, speckle):
    frames, labels = speckle(60, (20, 15), 5)
    if sixteen:
        frames = (frames.to(torch.int32) * 257 + 3).clamp(max=65535).to(torch.uint16)
    bank, x = Bank(frames, labels, 5), scaled(frames, pixels)
    rows, bound = x - x[:40].mean(0), 1e-6 * np.abs(x @ x.T).max()
    found = torch.cat(bank.centred(TRAIN, QUERIES, pixels))
    np.testing.assert_allclose(found, rows @ rows[:40].T, rtol=0, atol=bound)


@pytest.mark.parametrize("k", [1, 3, 4])
def test_the_nearest_neighbours_vote(k, speckle):
    frames, labels = speckle(60, (20, 15), 5)
    x = scaled(frames, "raw")
    distances = ((x[40:, None] - x[:40]) ** 2).sum(axis=2).round(9)
    near = distances.argsort(axis=1, kind="stable")[:, :k]
    model = NearestNeighbour(k=k).fit(frames[:40], labels[:40])
    for row, label in zip(labels[near], model.predict(frames[40:]), strict=True):
        counts = np.bincount(row, minlength=5)
        assert label == next(c for c in row if counts[c] == counts.max())
    with pytest.raises(ValueError, match="k: expected an integer from 1, found 0"):
        NearestNeighbour(k=0).fit(frames, labels)


@pytest.mark.parametrize("pixels", ["unit", "standardised"])
def test_mean_image_is_the_nearest_centroid(pixels, speckle):
    frames, labels = speckle(60, (6, 5), 5)
    x = scaled(frames, pixels)
    theirs = NearestCentroid().fit(x[:40], labels[:40]).predict(x[40:])
    ours = MeanImage(pixels=pixels).fit(frames[:40], labels[:40]).predict(frames[40:])
    assert (ours == theirs).all()


@pytest.mark.parametrize("pixels", ["unit", "standardised"])
@pytest.mark.parametrize("kind", [RidgeReadout, DualSoftmaxRegression])
def test_an_update_from_old_weights_is_the_optimum_near_them(kind, pixels, speckle):
    """The loss of the new frames and the penalty on W − W_old have no slope there."""
    frames, labels = speckle(60, (5, 4), 3)
    x, new = torch.from_numpy(scaled(frames, pixels)), np.arange(40, 46)
    model, bank = kind(pixels=pixels), Bank(frames, labels, 3)
    old = kind(pixels=pixels).fit(frames[:40], labels[:40])
    scores = model.scores_from_old(bank, TRAIN, new, np.arange(60))
    with_one = F.pad(x, (0, 1), value=1.0)  # scores are linear in pixels and one
    # Standardised pixels sum to zero, so this matrix is singular. PyTorch's usual driver does not
    # always notice; gelsd decomposes into singular values and does.
    solved = torch.linalg.lstsq(with_one, scores, rcond=1e-5, driver="gelsd")
    weights = solved.solution.requires_grad_()
    change = (weights[:-1] - x[:40].T @ old.coefficients_).square().sum()
    z, y = with_one[new] @ weights, torch.from_numpy(labels[new])
    if kind is RidgeReadout:
        loss = (z - 2 * F.one_hot(y, 3) + 1).square().sum() + model.alpha * change
    else:
        loss = model.C * F.cross_entropy(z, y, reduction="sum") + change / 2
    loss.backward()
    assert weights.grad.abs().max() < 1e-3
    predicted = model.predict_from_old(bank, TRAIN, new, QUERIES)
    assert (predicted == scores[40:].argmax(1).numpy()).all()
