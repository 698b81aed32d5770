"""Error against run time: explicit, adaptive, quasi-Newton and Newton methods, one objective.

All minimise the mean cross-entropy of softmax regression on pixels in 0…1 with the penalty of
scikit-learn's LogisticRegression, F(W, b) = mean loss + ‖W‖²/(2CN). The error of a method is
F − F*, F* from the dual Newton method at its tightest tolerance; F is evaluated in float64 with the
clock stopped, on the weights that a prediction would use (float32).

======================  ==========================================================================
``GD``                  explicit: full-batch gradient descent at 0.9 × 2/λ_max, on ``pixels``
``GD dual``             the same steps in the space of samples, pixels centred: a thousand times
                        cheaper each, and as many as stability allows
``Adam``                adaptive: minibatches of 20, at each of several rates
``L-BFGS``              quasi-Newton, with line search
``Newton dual``         second order: baselines.softmax_dual, no limit of stability
======================  ==========================================================================

``unit`` and ``unit_centred`` pixels have the same optimum (baselines.pixels), not the same
stiffness.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
from rich.console import Console
from torch import Tensor
from torch.nn import functional as F

from baselines.base import Classifier
from baselines.dual import DualLinearClassifier
from baselines.pixels import PixelScaling
from baselines.softmax import SoftmaxRegression
from baselines.softmax_dual import DualSoftmaxRegression
from experiments.protocol import data
from experiments.protocol.clock import Clock
from experiments.protocol.scenes import scene_at
from experiments.records.measurement import Row, measure
from experiments.studies.stiffness import softmax as dual

SAFETY = 0.9  # of the stability limit
_GROWTH = 1.5  # ratio of the times of two evaluations, at least
_WARM_UP = 40  # frames
_FRAMES = 20  # that are float64 at a time

Part = tuple[Tensor, np.ndarray]  # frames uint8 [N, H, W] and labels [N]


def run(
    scene: Mapping[str, Any],
    split: Mapping[str, Any],
    seed: int,
    force: bool = False,
    cache: bool = True,
    **settings: Any,
) -> Path:
    """The task of configs/experiment/softmax_methods.yaml: ``measured/softmax_methods-HASH/``.

    Args:
        scene, split: as in the configuration of a run.
        seed: of scene, split and minibatches.
        force: measure again.
        cache: keep made frames.
        settings: arguments of :func:`rows`.
    """
    console = Console(highlight=False)
    config = {
        "_target_": f"{__name__}.run",
        "scene": scene,
        "split": split,
        "seed": seed,
        **settings,
    }

    def compute() -> Iterator[Row]:
        made = scene_at(scene, seed, cache, console)
        train, test = (
            (made.frames(part), made.labels[part]) for part in data.choose(made, split, seed)
        )
        return rows(train, test, seed=seed, **settings)

    return measure("softmax_methods", config, compute, force=force, console=console)


def rows(
    train: Part,
    test: Part,
    *,
    C: float,
    budget_s: float,
    pixels: Sequence[str],
    adam_rates: Sequence[float],
    batch: int,
    dual_steps: Sequence[int],
    newton_steps: int,
    seed: int = 0,
) -> Iterator[Row]:
    """One row an evaluation: method, pixels, rate, work, seconds, loss_gap, errors.

    Args:
        train, test: frames uint8 [N, H, W] and labels [N].
        C: inverse strength of the penalty.
        budget_s: seconds of training of each method that goes on by itself.
        pixels: scalings for gradient descent and L-BFGS, of one optimum: unit, unit_centred.
        adam_rates: learning rates of Adam, on unit pixels.
        batch: its frames a step.
        dual_steps: numbers of steps of gradient descent in the dual, each a run of its own.
        newton_steps: most steps of the dual Newton method, one run each.
        seed: of the minibatches.
    """
    objective = Objective(train, test, C)
    # Every method sets out from the same point, the one at which the dual ones must start.
    common: dict[str, Any] = {"C": C, "seed": seed, "init": "zeros"}

    def iterate(method: str, model: SoftmaxRegression, **more: Any) -> Iterator[Row]:
        for seconds, report in timed_reports(model, train, budget_s):
            yield {
                "method": method,
                "pixels": model.pixels,
                **more,
                "epochs": report["epoch"],
                "seconds": seconds,
                **objective(model),
            }

    for name in pixels:
        curvature = dual.start_spectrum(dual.problem(name, *train, batch, seed))[0]
        rate = SAFETY * 2 / (float(curvature) + objective.penalty)
        model = SoftmaxRegression(
            pixels=name, optimizer="SGD", lr=rate, batch_size=None, max_epochs=10**6, **common
        )
        yield from iterate("GD", model, rate=rate)
    for rate in adam_rates:
        model = SoftmaxRegression(lr=rate, batch_size=batch, max_epochs=10**6, **common)
        yield from iterate("Adam", model, rate=rate)
    for name in pixels:
        model = SoftmaxRegression(
            pixels=name, optimizer="LBFGS", lr=1.0, batch_size=None, max_epochs=10**6, **common
        )
        yield from iterate("L-BFGS", model)
    makers: list[tuple[str, Sequence[int], Callable[[int], DualLinearClassifier]]] = [
        ("GD dual", dual_steps, lambda steps: DualDescent(C=C, steps=steps)),
        (
            "Newton dual",
            range(1, newton_steps + 1),
            lambda steps: DualSoftmaxRegression(C=C, tol=1e-12, max_iter=steps),
        ),
    ]
    for method, steps, make in makers:
        for count in steps:
            machine = make(count)
            clock = Clock()
            with clock.running():
                machine.fit(*train)
            yield {
                "method": method,
                "pixels": "centred",
                "steps": count,
                "seconds": clock.seconds,
                **({"rate": machine.rate_} if isinstance(machine, DualDescent) else {}),
                **objective(machine),
            }


def timed_reports(
    model: SoftmaxRegression, train: Part, budget_s: float
) -> Iterator[tuple[float, Mapping[str, float]]]:
    """Seconds of training and report, at times that grow geometrically, until the budget is used.

    The model is as trained until then; what the caller does in between does not count.
    """
    frames, labels = train
    dataclasses.replace(model, max_epochs=1).fit(frames[:_WARM_UP], labels[:_WARM_UP])
    clock, due = Clock(), 0.0
    with clock.running():
        reports = iter(model.train(frames, labels))
    while True:
        with clock.running():
            report = next(reports, None)
        if report is None:
            return
        if clock.seconds >= due or clock.seconds >= budget_s:
            due = _GROWTH * clock.seconds
            yield clock.seconds, report
        if clock.seconds >= budget_s:
            return


@dataclass(kw_only=True, eq=False)
class DualDescent(DualLinearClassifier):
    """Gradient descent on F in the space of samples, at :data:`SAFETY` of its stability limit.

    Args:
        C: inverse strength of the penalty.
        steps: of the full batch.

    Attributes:
        rate_: the learning rate.
    """

    C: float = 1.0
    steps: int = 1000

    def solve(self, gram: Tensor, targets: Tensor) -> tuple[Tensor, Tensor, float]:
        problem = dual.Problem(gram, targets, np.inf)
        penalty = 1 / (self.C * len(targets))
        self.rate_ = SAFETY * 2 / (float(dual.start_spectrum(problem)[0]) + penalty)
        for last in dual.descend(problem, self.rate_, self.steps, penalty=penalty):
            loss, state = last
        return state.a, state.b, loss


class Objective:
    """F − F* and the errors of a softmax regression on unit pixels.

    Args:
        train, test: frames uint8 [N, H, W] and labels [N].
        C: inverse strength of the penalty.

    Attributes:
        penalty: 1/(CN).
        optimum: F*.
    """

    def __init__(self, train: Part, test: Part, C: float):
        self._parts = train, test
        self.penalty = 1 / (C * len(train[1]))
        best = DualSoftmaxRegression(C=C, tol=1e-15).fit(*train)
        self.optimum = best.objective_ * self.penalty

    def __call__(self, model: Classifier) -> Row:
        weight, bias = unit_weights(model)
        loss, errors = 0.0, []
        for k, (frames, labels) in enumerate(self._parts):
            logits = torch.cat(
                [
                    frames[first : first + _FRAMES].flatten(1).double() @ weight.T / 255 + bias
                    for first in range(0, len(frames), _FRAMES)
                ]
            )
            targets = torch.from_numpy(np.searchsorted(model.classes_, labels))
            errors.append(float((logits.argmax(dim=1) != targets).double().mean()))
            if k == 0:
                loss = F.cross_entropy(logits, targets).item()
        loss += 0.5 * self.penalty * float(weight.square().sum())
        return {
            "loss": loss,
            "loss_gap": loss - self.optimum,
            "train_error": errors[0],
            "test_error": errors[1],
        }


def unit_weights(model: Classifier) -> tuple[Tensor, Tensor]:
    """W float64 [L, D] for pixels in 0…1, and b [L], of a softmax regression of this module.

    Raises:
        ValueError: for pixels of another scale, whose weights have another penalty.
    """
    if isinstance(model, DualLinearClassifier):
        return model.weight_.double() * 255, model.bias_.double()
    assert isinstance(model, SoftmaxRegression)
    scaling: PixelScaling = model.scaling_
    if scaling.scale != 1 / 255:
        raise ValueError(f"pixels: expected unit or unit_centred, found {model.pixels!r}")
    weight, bias = (p.detach().double() for p in model.network_.parameters())
    return weight, bias - weight.sum(dim=1) * scaling.offset / 255
