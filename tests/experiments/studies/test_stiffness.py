"""Stiffness: the problem is what it says, and every method ends for the reason that it gives."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest
import torch
from torch.nn import functional as F

from experiments.protocol.task import Context
from experiments.studies.limits.stiffness import measure, newton, view
from experiments.studies.limits.stiffness.problem import Problem, condition
from scenes.frames import Frames
from tests.experiments import composed

pytestmark = pytest.mark.usefixtures("one_thread")
ARRIVING = ["gradient descent", "momentum", "Adam, rate 1", "L-BFGS", "Newton"]


def problem_of(strength=1e-2, n=20, d=6, contrast=1.0):
    rng = np.random.default_rng(0)
    frames = rng.integers(0, 190, (n, d)) + 60 * np.eye(3)[np.arange(n) % 3][:, :1]
    onehot = np.eye(3)[np.arange(n) % 3]
    return Problem(measure.of_contrast(frames, contrast), onehot, strength)


def loss_of(problem):
    """The penalised loss of a flat tensor of weights, by torch."""
    x, onehot = torch.from_numpy(problem.x), torch.from_numpy(problem.onehot)

    def loss(flat):
        w = flat.view(onehot.shape[1], x.shape[1])
        fit = F.cross_entropy(x @ w.T, onehot)
        return fit + problem.strength / 2 * w.square().sum()

    return loss


def eigenvalues(problem, weights):
    """Of the Hessian at some weights, by torch."""
    flat = torch.from_numpy(weights.ravel())
    hessian = torch.autograd.functional.hessian(loss_of(problem), flat)
    return torch.linalg.eigvalsh(hessian).numpy()


def test_loss_and_gradient_are_those_of_torch():
    problem = problem_of()
    weights = np.random.default_rng(1).standard_normal((3, 6))
    flat = torch.from_numpy(weights.ravel()).requires_grad_()
    expected = loss_of(problem)(flat)
    expected.backward()
    loss, gradient = problem.evaluate(weights)
    assert loss == pytest.approx(expected.item(), rel=1e-14)
    np.testing.assert_allclose(gradient.ravel(), flat.grad.numpy(), rtol=1e-12)


def test_the_condition_number_is_that_of_the_hessian_where_frames_tell_something():
    problem = problem_of(strength=1e-3, n=5)  # fewer frames than pixels
    weights = newton.optimum(problem).astype(float)
    values = eigenvalues(problem, weights)
    # Two contrasts of classes, five directions of frames; the others have the penalty alone.
    told = values[-2 * 5 :]
    assert values[-2 * 5 - 1] == pytest.approx(1e-3, rel=1e-9)
    assert condition(problem, weights) == pytest.approx(told[-1] / told[0], rel=1e-6)


def test_the_bound_is_above_every_eigenvalue():
    problem = problem_of()
    for scale in (0, 1, 10):
        weights = scale * np.random.default_rng(2).standard_normal(18)
        assert eigenvalues(problem, weights)[-1] <= problem.bound * (1 + 1e-12)


def test_the_optimum_has_digits_that_float64_has_not():
    best = newton.optimum(problem_of())
    _, gradient = problem_of().evaluate(best)
    assert best.dtype == np.longdouble
    assert np.linalg.norm(gradient) < 1e-12


def test_less_contrast_and_a_weaker_penalty_are_stiffer():
    def kappa(**how):
        problem = problem_of(**how)
        return condition(problem, newton.optimum(problem).astype(float))

    assert kappa() < kappa(contrast=0.1) < kappa(contrast=0.1, strength=1e-4)


@pytest.mark.parametrize("dtype", [np.float64, np.longdouble])
def test_a_system_is_solved_in_its_own_precision(dtype):
    root = np.random.default_rng(3).standard_normal((6, 6)).astype(dtype)
    matrix, exact = root @ root.T + np.eye(6, dtype=dtype), np.arange(6, dtype=dtype)
    error = np.abs(newton.solve(matrix, matrix @ exact) - exact).max()
    assert error < 1e3 * np.finfo(dtype).eps
    with pytest.raises(np.linalg.LinAlgError):
        newton.solve(-matrix, exact)


def followed(name, problem, budget_s=60.0, least=None):
    """The points of a method; `least` is the loss of the optimum, if that is known."""
    if least is None:
        least, _ = problem.evaluate(newton.optimum(problem))
    watch = measure.Watch(problem, least, budget_s, goal=1e-6)
    return watch.follow(measure.named_methods([1])[name])


@pytest.mark.parametrize("name", ARRIVING)
def test_every_method_arrives_where_nothing_is_stiff(name):
    points = followed(name, problem_of())
    assert [point["ended"] for point in points[:-1]] == [""] * (len(points) - 1)
    end = points[-1]
    assert end["ended"] == "arrived"
    assert end["gradient"] <= 1e-6
    assert 0 <= end["error"] < 1e-10
    assert end["error"] < 1e-6 * points[0]["error"]


def test_out_of_time_is_said():
    end = followed("gradient descent", problem_of(), budget_s=0.0)[-1]
    assert end["ended"] == "out of time"


def test_newton_fails_where_rounding_makes_the_hessian_indefinite():
    problem = problem_of(strength=1e-22, contrast=1e-9, n=40)
    end = followed("Newton", problem, least=0.0)[-1]
    assert end["ended"].startswith("failed: ")


@pytest.mark.filterwarnings("ignore:overflow encountered")
def test_a_descent_that_diverges_fails(monkeypatch):
    monkeypatch.setattr(Problem, "bound", 1e-3)
    # A quadratic penalty grows without end where the rate is too large.
    end = followed("gradient descent", problem_of(strength=10.0))[-1]
    assert end["ended"] == "failed: not a number"


def test_a_gradient_that_is_wrong_does_not_arrive_at_the_optimum(monkeypatch):
    true = Problem.evaluate
    least, _ = true(problem_of(), newton.optimum(problem_of()))

    def wrong(problem, weights):
        loss, gradient = true(problem, weights)
        return loss, gradient + 1e-3

    monkeypatch.setattr(Problem, "evaluate", wrong)
    end = followed("L-BFGS", problem_of(), least=least)[-1]
    assert end["error"] > 1e-8


def test_a_line_is_a_point_of_a_method_on_a_problem_and_the_best_rate_of_adam_counts():
    class OnFrames(Context):
        def scene(self, config, seed):
            rng = np.random.default_rng(0)
            labels = np.arange(60) % 3
            frames = rng.integers(0, 60, (3, 8, 8))[labels]
            frames += rng.integers(0, 190, (60, 8, 8))
            images = torch.from_numpy(frames).byte()
            return Frames(images, labels, ("a", "b", "c"), origin="simulated")

    task = composed.task("stiffness") | {"seed": 0, "side": 4, "budget_s": 0.1}
    task["problems"] = [
        {"contrast": 1, "strength": 0.01},
        {"contrast": 0.01, "strength": 1e-8},
    ]
    del task["_target_"]
    frame = pd.DataFrame(composed.made(measure.Stiffness, **task).rows(OnFrames()))
    ends = view.ends(frame)
    assert frame.kappa.nunique() == ends.kappa.nunique() == 2
    assert len(ends) == 2 * 5
    of_adam = ends[ends.method.str.startswith("Adam, rate")]
    assert len(of_adam) == 2
    last = frame[frame.ended != ""]
    for end in of_adam.itertuples():
        rates = last[(last.kappa == end.kappa) & last.method.str.startswith("Adam")]
        arrived = rates[rates.ended == "arrived"]
        assert end.error == (arrived if len(arrived) else rates).error.min()
