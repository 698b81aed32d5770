"""Softmax regression: one optimum by every road, and what each step and report is."""

import itertools

import numpy as np
import pytest
import torch
from sklearn.linear_model import LogisticRegression

from baselines import optimisers
from baselines.softmax import SoftmaxRegression
from baselines.softmax_dual import DualSoftmaxRegression
from tests.baselines.scaled import scaled

C = 0.1


def objective(weight, bias, x, labels):
    """C Σ log-loss + ½‖W‖², in float64."""
    logits, truth = torch.from_numpy(x @ weight.T + bias), torch.from_numpy(labels)
    loss = torch.nn.functional.cross_entropy(logits, truth, reduction="sum")
    return C * loss.item() + 0.5 * (weight**2).sum()


def reference(x, labels):
    best = LogisticRegression(C=C, tol=1e-12, max_iter=100_000, solver="newton-cg")
    best.fit(x, labels)
    return objective(best.coef_, best.intercept_, x, labels)


@pytest.mark.filterwarnings(
    "ignore:.*[Ll]ine [Ss]earch"
)  # scikit-learn at the end of float64
@pytest.mark.parametrize("pixels", ["unit", "raw", "standardised"])
def test_dual_reaches_the_optimum_of_scikit_learn(pixels, speckle):
    frames, labels = speckle(60, (20, 15), 5)
    model = DualSoftmaxRegression(C=C, pixels=pixels).fit(frames, labels)
    x = scaled(frames, pixels)
    weight = model.coefficients_.T.numpy() @ x
    logits = model.scores(frames).double().numpy()
    bias = (logits - x @ weight.T).mean(axis=0)
    best = reference(x, labels)
    assert model.objective_ == pytest.approx(best, rel=1e-6)
    assert objective(weight, bias, x, labels) == pytest.approx(best, rel=1e-6)


@pytest.mark.parametrize(
    ("c", "pixels", "grey"),
    [(1.0, "unit", 255), (1e8, "raw", None), (1e-12, "unit", None)],
    ids=["constant", "huge C", "tiny C"],
)
def test_dual_at_the_limits_stays_finite(c, pixels, grey, speckle):
    frames, labels = speckle(24, (8, 8), 3)
    if grey:
        frames = torch.full_like(frames, grey)
    model = DualSoftmaxRegression(C=c, pixels=pixels).fit(frames, labels)
    for numbers in (torch.tensor(model.objective_), model.weight_, model.bias_):
        assert numbers.isfinite().all()
    assert set(model.predict(frames)) <= set(labels)
    if grey:  # nothing to see but how often each class occurs
        share = model.scores(frames[:1]).softmax(dim=1)
        torch.testing.assert_close(share, torch.full((1, 3), 1 / 3), atol=1e-4, rtol=0)


@pytest.mark.parametrize("pixels", ["unit", "raw", "standardised"])
def test_a_step_of_gradient_descent_goes_down_the_mean_loss(pixels, speckle):
    """From W = 0, where each class has the same probability."""
    frames, labels = speckle(80, (3, 4), 4)
    settings = {"optimizer": "SGD", "batch_size": None, "lr": 0.1, "max_epochs": 1}
    model = SoftmaxRegression(pixels=pixels, init="zeros", **settings)
    weight, bias = model.fit(frames, labels).state_tensors().values()
    surplus = 1 / 4 - np.eye(4)[labels]
    expected = -0.1 * surplus.T @ scaled(frames, pixels) / 80
    bound = 1e-5 * np.abs(expected).max()
    np.testing.assert_allclose(weight, expected, rtol=0, atol=bound)
    np.testing.assert_allclose(bias, -0.1 * surplus.mean(0), rtol=0, atol=1e-6)


def test_a_diverging_run_yields_a_loss_that_is_not_finite(small):
    model = SoftmaxRegression(optimizer="SGD", pixels="raw", lr=1e38, max_epochs=5)
    losses = [row["loss"] for row in model.train(*small)]
    assert len(losses) == 5
    assert not np.isfinite(losses[-1])
    assert set(model.predict(small[0])) <= {0, 1, 2, 3}


def test_a_batch_in_parts_is_the_batch(small):
    settings = {"optimizer": "SGD", "lr": 0.1, "max_epochs": 3}
    whole = SoftmaxRegression(**settings).fit(*small).state_tensors()
    parts = SoftmaxRegression(micro_batch=3, **settings).fit(*small).state_tensors()
    torch.testing.assert_close(whole, parts)


def test_reports_come_as_often_as_asked(speckle):
    frames, labels = speckle(50, (6, 6), 2)
    model = SoftmaxRegression(reports_per_epoch=2, max_epochs=2)  # of three steps
    rows = [*model.train(frames, labels)]
    assert [row["samples_seen"] for row in rows] == [40, 50, 90, 100]
    assert [row["steps"] for row in rows] == [2, 3, 5, 6]
    assert [row["epoch"] for row in rows] == [0.8, 1.0, 1.8, 2.0]


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"optimizer": "LBFGS"}, "optimizer: expected one of Adam, SGD, found 'LBFGS'"),
        ({"pixels": "bits"}, "pixels: expected one of unit, raw, standardised, found"),
    ],
)
def test_unknown_choices_list_the_valid_ones(small, given, message):
    with pytest.raises(ValueError, match=message):
        SoftmaxRegression(**given).fit(*small)


def test_the_accuracy_of_minibatches_is_that_since_the_last_report(frames_and_labels):
    """Each before it was learnt from."""
    frames, labels = frames_and_labels(60, 3, 8)
    frames = torch.from_numpy(frames)

    def reported(number, count, batch_size=10):
        model = SoftmaxRegression(
            batch_size=batch_size, lr=1e-2, seed=3, reports_per_epoch=number
        )
        rows = itertools.islice(model.train(frames, labels), count)
        return [
            (row["batch_accuracy"], np.mean(model.predict(frames) == labels))
            for row in rows
        ]

    single = np.reshape([share for share, _ in reported(6, 12)], (4, 3))
    found = [share for share, _ in reported(2, 4)]
    assert found == pytest.approx(single.mean(axis=1))
    before, after = zip(*reported(1, 8, None), strict=True)
    assert before[1:] == after[:-1]
    assert len(set(before)) > 2


@pytest.mark.parametrize("name", ["Adam", "SGD"])
def test_our_optimisers_are_those_of_pytorch(name):
    def after_three_steps(kind):
        x = torch.nn.Parameter(torch.tensor([3.0, -2.0]))
        optimiser = kind([x], lr=0.1, fused=True)
        for _ in range(3):
            optimiser.zero_grad()
            (x.square() * torch.tensor([1.0, 10.0])).sum().backward()
            optimiser.step()
        return x.tolist()

    ours, theirs = getattr(optimisers, name), getattr(torch.optim, name)
    assert after_three_steps(ours) == after_three_steps(theirs)
