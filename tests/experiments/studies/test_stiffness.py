"""Stiffness: the problem is what it says, and methods take the steps that theory gives them."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
import torch
from torch.nn import functional as F

from experiments.protocol.evaluate import bank_of
from experiments.studies.limits.stiffness import measure, methods, newton
from experiments.studies.limits.stiffness.problem import Problem, condition
from scenes.frames import Frames
from tests.experiments import composed

pytestmark = pytest.mark.usefixtures("one_thread")
METHODS = measure.named_methods([1], 2000, {"lr": 0.1, "batch_size": None})


def problem_of(apart=1.0, strength=1e-2, n=30, d=6):
    rng = np.random.default_rng(0)
    frames = rng.integers(0, 190, (n, d)) + 60 * np.eye(3)[np.arange(n) % 3][:, :1]
    return Problem.of(frames, np.eye(3)[np.arange(n) % 3], strength, apart, 2)


def loss_of(problem):
    """The penalised loss of a flat tensor of weights, by torch; the intercept stands last."""
    x, onehot = torch.from_numpy(problem.x), torch.from_numpy(problem.onehot)

    def loss(flat):
        w = flat.view(onehot.shape[1], x.shape[1])
        fit = F.cross_entropy(x @ w.T, onehot)
        return fit + problem.strength / 2 * w[:, :-1].square().sum()

    return loss


def eigenvalues(problem, weights, of=slice(None)):
    """Of the Hessian at some weights, or of the part `of` some weights of a class, by torch."""
    flat = torch.from_numpy(weights.ravel())
    hessian = torch.autograd.functional.hessian(loss_of(problem), flat)
    places = torch.arange(weights.size).view(*weights.shape)[:, of].flatten()
    return torch.linalg.eigvalsh(hessian[places][:, places]).numpy()


def optimum_of(problem):
    best = newton.optimum(problem)
    return best.astype(float), float(problem.evaluate(best)[0])


def followed(name, problem, budget_s=60.0, least=None):
    """The points of a method; `least` is the loss of the optimum, if that is known."""
    least = optimum_of(problem)[1] if least is None else least
    return methods.Watch(problem, least, budget_s, goal=1e-6).follow(METHODS[name])


# The problem --------------------------------------------------------------------------------------


def test_loss_and_gradient_are_those_of_torch_and_the_bound_is_above_every_eigenvalue():
    problem = problem_of()
    for scale in (0, 1, 10):
        weights = scale * np.random.default_rng(1).standard_normal((3, 7))
        flat = torch.from_numpy(weights.ravel()).requires_grad_()
        expected = loss_of(problem)(flat)
        expected.backward()
        loss, gradient = problem.evaluate(weights)
        assert loss == pytest.approx(expected.item(), rel=1e-14)
        np.testing.assert_allclose(gradient.ravel(), flat.grad.numpy(), atol=1e-14)
        assert eigenvalues(problem, weights)[-1] <= problem.bound * (1 + 1e-12)


def test_the_condition_number_is_that_of_the_hessian_where_frames_tell_something():
    problem = problem_of(strength=1e-3, n=5)  # fewer frames than pixels
    weights, _ = optimum_of(problem)
    values = eigenvalues(problem, weights)
    # Two contrasts of classes; four directions of centred frames, and the intercept.
    told = values[-2 * 5 :]
    assert values[-2 * 5 - 1] == pytest.approx(1e-3, rel=1e-9)
    assert condition(problem, weights) == pytest.approx(told[-1] / told[0], rel=1e-6)


def test_the_condition_number_of_frames_is_that_of_the_hessian_of_the_solver_that_we_ship():
    rng = np.random.default_rng(0)
    labels = np.arange(30) % 3
    images = torch.from_numpy(rng.integers(0, 255, (30, 2, 3))).byte()
    scene = Frames(images, labels, tuple("abc"), origin="simulated")
    x = images.flatten(1).double().numpy() / 255
    centred = np.column_stack([x - x.mean(0), np.ones(30)])
    problem = Problem(centred, np.eye(3)[labels], 1 / 30)  # C = 1
    without_intercept = slice(0, -1)
    *_, largest = eigenvalues(problem, optimum_of(problem)[0], without_intercept)
    found = measure.condition_of(bank_of(scene))
    assert found == pytest.approx(largest * 30, rel=1e-3)


def test_a_scene_may_set_a_part_of_the_split():
    """Scenes that leave groups out state no share of test frames, and ended the whole study."""
    rng = np.random.default_rng(0)
    frames = rng.integers(0, 256, (24, 4, 5), dtype=np.uint8)
    groups = {"group": np.arange(24) // 2 % 4}
    images = torch.from_numpy(frames)
    scene = Frames(images, np.arange(24) % 2, ("a", "b"), samples=groups)
    context = SimpleNamespace(scene=lambda *_: scene)
    own = {"scene": {}, "split": {"kind": "leave_group_out", "group": "group"}}
    config = composed.task("stiffness") | {"real": {"mine": own}}
    (row,) = composed.made(measure.Stiffness, **config).real_problems(context)
    assert (row["real"], row["n"]) == ("mine", 18)


def test_the_optimum_has_digits_that_float64_has_not():
    best = newton.optimum(problem_of())
    assert best.dtype == np.longdouble
    assert np.linalg.norm(problem_of().evaluate(best)[1]) < 1e-12


# The methods --------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", METHODS)
def test_every_method_arrives_where_nothing_is_stiff(name):
    *before, end = followed(name, problem_of())
    assert {point["ended"] for point in before} == {""}
    assert 1e-3 < before[0]["error"] < 1 + 1e-9
    assert end["ended"] == "arrived"
    assert -1e-12 < end["error"] <= 1e-6


@pytest.mark.parametrize(
    ("name", "power"), [("gradient descent", 1.0), ("momentum", 0.5)]
)
def test_steps_grow_with_the_condition_number_as_predicted(name, power):
    kappas, steps = [], []
    for apart in (0.1, 0.05, 0.025):
        problem = problem_of(apart, apart**2)
        best, least = optimum_of(problem)
        kappas.append(condition(problem, best))
        steps.append(followed(name, problem, least=least)[-1]["evaluations"])
    observed, _ = np.polyfit(np.log(kappas), np.log(steps), 1)
    assert observed == pytest.approx(power, abs=0.1)


def wrong_gradient(problem, weights, true=Problem.evaluate):
    loss, gradient = true(problem, weights)
    return loss, gradient + 1e-3


@pytest.mark.filterwarnings("ignore:overflow encountered", "ignore:invalid value")
@pytest.mark.parametrize(
    ("name", "given", "budget_s", "changed", "ended"),
    [
        ("gradient descent", {}, 0.0, {}, "out of time"),
        # Rounding makes the Hessian indefinite.
        ("Newton", {"apart": 1e-9, "strength": 1e-22}, 60, {}, "failed: Hessian not"),
        # A quadratic penalty grows without end where the rate is too large.
        ("gradient descent", {"strength": 10.0}, 60, {"bound": 1e-3}, "failed: not a"),
        ("L-BFGS", {}, 60, {"evaluate": wrong_gradient}, "goes no further"),
    ],
)  # fmt: skip
def test_a_method_that_does_not_arrive_says_why(
    monkeypatch, name, given, budget_s, changed, ended
):
    problem = problem_of(**given)
    least = 0.0 if given else optimum_of(problem)[1]
    for attribute, value in changed.items():
        monkeypatch.setattr(Problem, attribute, value)
    end = followed(name, problem, budget_s, least)[-1]
    assert end["ended"].startswith(ended)
