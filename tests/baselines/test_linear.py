"""What is computed in the space of samples is what is defined on the pixels."""

import numpy as np
import pytest
import torch
from sklearn.neighbors import NearestCentroid

from baselines.bank import KERNELS, Bank
from baselines.mean_image import MeanImage
from baselines.nearest_neighbour import NearestNeighbour
from baselines.pixels import fit_scaling
from baselines.ridge import RidgeReadout
from baselines.softmax import SoftmaxRegression
from baselines.softmax_dual import DualSoftmaxRegression

TRAIN, QUERIES = np.arange(40), np.arange(40, 60)


def scaled(pixels, frames, labels, n_train=40):
    """Scaled pixels of all frames, float64 [N, D], the scaling fitted on the first ones."""
    model = SoftmaxRegression()
    model.start(frames, labels)
    scaling = fit_scaling(pixels, model, frames[:n_train])
    return scaling(model.read(frames, slice(0, len(frames)))).flatten(1).double()


def wide(frames):
    return (frames.to(torch.int32) * 257 + 3).clamp(max=65535).to(torch.uint16)


def test_nearly_equal_frames_keep_ten_digits():
    extra = np.random.default_rng(0).integers(0, 2, (6, 40_000))
    centred = 6 * extra - extra.sum(0)
    exact = centred @ centred.T / (36 * 255.0**2)
    frames = torch.from_numpy((200 + extra).astype(np.uint8))
    gram, _ = Bank(frames, np.arange(6), 6).centred(np.arange(6), np.arange(0))
    np.testing.assert_allclose(gram, exact, atol=1e-10 * np.abs(exact).max())


@pytest.mark.parametrize("sixteen", [False, True])
@pytest.mark.parametrize("pixels", KERNELS)
def test_kernels_are_those_of_scaled_pixels(pixels, sixteen, speckle):
    frames, labels = speckle(60, (20, 15), 5)
    frames = wide(frames) if sixteen else frames
    x = scaled(pixels, frames, labels)
    bank = Bank(frames, labels, 5)
    inside, across = bank.kernel(TRAIN, QUERIES, pixels)
    tolerance = {"rtol": 0, "atol": 1e-6 * float((x @ x.T).abs().max())}
    np.testing.assert_allclose(inside, x[:40] @ x[:40].T, **tolerance)
    np.testing.assert_allclose(across, x[40:] @ x[:40].T, **tolerance)
    centred = bank.centred(TRAIN, QUERIES, pixels)[1]
    x = x - x[:40].mean(0)
    np.testing.assert_allclose(centred, x[40:] @ x[:40].T, **tolerance)


@pytest.mark.parametrize("pixels", ["bits", "raw", "standardised"])
@pytest.mark.parametrize("k", [1, 3, 4])
def test_the_nearest_neighbours_vote(pixels, k, speckle):
    frames, labels = speckle(60, (20, 15), 5)
    x = scaled(pixels, frames, labels).numpy()
    distances = ((x[40:, None] - x[:40]) ** 2).sum(axis=2).round(9)
    near = distances.argsort(axis=1, kind="stable")[:, :k]
    predicted = (
        NearestNeighbour(k=k, pixels=pixels)
        .fit(frames[:40], labels[:40])
        .predict(frames)
    )
    for row, label in zip(labels[near], predicted[40:], strict=True):
        counts = np.bincount(row, minlength=5)
        assert label == next(c for c in row if counts[c] == counts.max())
    with pytest.raises(ValueError, match="k: expected an integer from 1, found 0"):
        NearestNeighbour(k=0).fit(frames, labels)


@pytest.mark.parametrize("pixels", ["unit", "standardised", "bits"])
def test_mean_image_is_the_nearest_centroid(pixels, speckle):
    frames, labels = speckle(60, (6, 5), 5)
    x = scaled(pixels, frames, labels).numpy()
    theirs = NearestCentroid().fit(x[:40], labels[:40]).predict(x[40:])
    ours = MeanImage(pixels=pixels).fit(frames[:40], labels[:40]).predict(frames[40:])
    assert (ours == theirs).all()


def from_old_by_descent(model, x, y, w, b):
    """min over W, b of the model's loss of new frames + its penalty on W − W_old, by Newton's
    method of torch on the weights themselves."""
    old = w.clone()
    w, b = w.clone().requires_grad_(), b.clone().requires_grad_()
    optimizer = torch.optim.LBFGS([w, b], 1, 2000, tolerance_grad=1e-12,
        tolerance_change=0, line_search_fn="strong_wolfe")  # fmt: skip

    def closure():
        optimizer.zero_grad()
        z, penalty = x @ w.T + b, (w - old).square().sum()
        if isinstance(model, RidgeReadout):
            target = 2.0 * torch.nn.functional.one_hot(y, len(b)) - 1
            loss = (z - target).square().sum() + model.alpha * penalty
        else:
            loss = torch.nn.functional.cross_entropy(z, y, reduction="sum")
            loss = model.C * loss + 0.5 * penalty
        loss.backward()
        return loss

    optimizer.step(closure)
    return w.detach(), b.detach()


@pytest.mark.parametrize("pixels", ["unit", "standardised"])
@pytest.mark.parametrize("kind", [RidgeReadout, DualSoftmaxRegression])
def test_an_update_from_old_weights_is_the_optimum_near_them(kind, pixels, speckle):
    frames, labels = speckle(60, (5, 4), 3)
    model, new, queries = kind(pixels=pixels), np.arange(40, 46), np.arange(46, 60)
    x = scaled(pixels, frames, labels)
    old = kind(pixels=pixels).fit(frames[:40], labels[:40])
    # The old weights on scaled pixels, from the coefficients.
    w = old.coefficients_.T @ x[:40]
    asked = torch.as_tensor(frames[40:])
    b = (old.scores(asked).double() - x[40:] @ w.T).mean(0)
    w, b = from_old_by_descent(model, x[new], torch.from_numpy(labels[new]), w, b)
    bank, expected = Bank(frames, labels, 3), x[queries] @ w.T + b
    scores = model.scores_from_old(bank, TRAIN, new, queries)
    torch.testing.assert_close(scores, expected, rtol=1e-4, atol=1e-4)
    predicted = model.predict_from_old(bank, TRAIN, new, queries)
    assert (predicted == expected.argmax(1).numpy()).all()
