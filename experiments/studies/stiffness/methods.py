"""Error against run time: explicit, adaptive, quasi-Newton and Newton methods, one objective.

All minimise the mean cross-entropy of softmax regression on pixels in 0…1 with the penalty of
scikit-learn's LogisticRegression, F(W, b) = mean loss + ‖W‖²/(2CN). The error of a method is F −
F*, F* from the dual Newton method at its tightest tolerance; F is evaluated in float64 with the
clock stopped, on the weights that a prediction would use (float32).

Gradient descent takes 0.9 of the largest stable rate, on pixels and, a thousand times cheaper, in
sample space. ``unit`` and ``unit_centred`` pixels have the same optimum but not the same stiffness.
"""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
from torch import Tensor
from torch.nn import functional as F

from baselines.dual import Descent, DualLinearClassifier
from baselines.pixels import PixelScaling
from baselines.softmax import SoftmaxRegression
from baselines.softmax_dual import DualSoftmaxRegression
from experiments.protocol import data
from experiments.protocol.clock import Clock
from experiments.protocol.experiment import Row, Run, experiment
from experiments.studies.stiffness import softmax

SAFETY = 0.9  # of the stability limit
_GROWTH = 1.5  # least ratio of the times of two evaluations
_WARM_UP = 40  # frames
_FRAMES = 20  # in float64 at a time

Part = tuple[Tensor, np.ndarray]  # frames uint8 [N, H, W] and labels [N]


@experiment
def softmax_methods(
    run: Run,
    scene: Mapping[str, Any],
    split: Mapping[str, Any],
    seed: int,
    C: float,
    budget_s: float,
    pixels: Sequence[str],
    adam_rates: Sequence[float],
    batch: int,
    dual_steps: Sequence[int],
    newton_steps: int,
) -> Iterator[Row]:
    """One row: an evaluation of a method. Columns: ``method``, ``pixels``, ``rate``, ``epochs`` or
    ``steps``, ``seconds`` of training, ``loss``, ``loss_gap`` (F − F*), ``train_error``,
    ``test_error``. Arguments: configs/experiment/softmax_methods.yaml.
    """
    made = run.scene(scene, seed)
    train, test = (
        (made.frames(part), made.labels[part]) for part in data.choose(made, split, seed)
    )
    objective = Objective(train, test, C)
    # The dual methods can start from zero weights only; so do the others.
    make = functools.partial(SoftmaxRegression, C=C, seed=seed, init="zeros", max_epochs=10**6)
    models = []
    for name in pixels:
        gram, targets = softmax.kernel(name, *train)
        curvature = float(softmax.start_spectrum(gram, int(targets.max()) + 1)[0])
        rate = SAFETY * 2 / (curvature + objective.penalty)
        models.append(("GD", make(pixels=name, optimizer="SGD", lr=rate, batch_size=None)))
    models += [("Adam", make(lr=rate, batch_size=batch)) for rate in adam_rates]
    quasi = {"optimizer": "LBFGS", "lr": 1.0, "batch_size": None}
    models += [("L-BFGS", make(pixels=name, **quasi)) for name in pixels]  # type: ignore[arg-type]
    for method, model in models:
        run.note(f"{method}, {model.pixels} pixels")
        for seconds, epochs in timed_epochs(model, train, budget_s):
            yield {
                "origin": made.origin, "method": method, "pixels": model.pixels, "steps": None,
                "rate": None if method == "L-BFGS" else model.lr, "epochs": epochs,
                "seconds": seconds, **objective(model),
            }  # fmt: skip
    counts = [("GD dual", n) for n in dual_steps]
    counts += [("Newton dual", n) for n in range(1, newton_steps + 1)]
    for method, steps in counts:
        solver: DualLinearClassifier = DualDescent(C=C, steps=steps)
        if method == "Newton dual":
            solver = DualSoftmaxRegression(C=C, tol=1e-12, max_iter=steps)
        clock = Clock()
        with clock.running():
            solver.fit(*train)
        yield {
            "origin": made.origin, "method": method, "pixels": "centred", "steps": steps,
            "rate": getattr(solver, "rate_", None), "epochs": None, "seconds": clock.seconds,
            **objective(solver),
        }  # fmt: skip


def timed_epochs(
    model: SoftmaxRegression, train: Part, budget_s: float
) -> Iterator[tuple[float, float]]:
    """Seconds of training and epochs, at times that grow geometrically, until the budget is used.

    The model is as trained until then; time spent by the caller does not count.
    """
    frames, labels = train
    dataclasses.replace(model, max_epochs=1).fit(frames[:_WARM_UP], labels[:_WARM_UP])
    clock, due = Clock(), 0.0
    with clock.running():
        reports = iter(model.train(frames, labels))
    while clock.seconds < budget_s:
        with clock.running():
            report = next(reports, None)
        if report is None:
            return
        if clock.seconds >= min(due, budget_s):
            due = _GROWTH * clock.seconds
            yield clock.seconds, report["epoch"]


@dataclass(kw_only=True, eq=False)
class DualDescent(DualLinearClassifier):
    """Gradient descent on F in sample space, `steps` at :data:`SAFETY` of its stability limit."""

    C: float = 1.0
    steps: int = 1000

    def solve(self, gram: Tensor, targets: Tensor) -> tuple[Tensor, Tensor, float]:
        penalty, classes = 1 / (self.C * len(targets)), len(self.classes_)
        curvature = float(softmax.start_spectrum(gram, classes)[0])
        self.rate_ = SAFETY * 2 / (curvature + penalty)
        descent = Descent(gram, targets, classes, self.rate_, decay=penalty)
        for _ in range(self.steps):
            descent.step()
        loss = descent.losses(penalty=True).item()
        return descent.coefficients[:, :, 0], descent.intercepts[:, 0], loss


class Objective:
    """F − F* and the errors of a softmax regression on unit pixels; ``penalty`` is 1/(CN)."""

    def __init__(self, train: Part, test: Part, C: float):
        self._parts = train, test
        self.penalty = 1 / (C * len(train[1]))
        best = DualSoftmaxRegression(C=C, tol=1e-15).fit(*train)
        self.optimum = best.objective_ * self.penalty

    def __call__(self, model: DualLinearClassifier | SoftmaxRegression) -> Row:
        weight, bias = unit_weights(model)
        losses, errors = [], []
        for frames, labels in self._parts:
            parts = (part.flatten(1).double() / 255 for part in frames.split(_FRAMES))
            logits = torch.cat([part @ weight.T + bias for part in parts])
            targets = torch.from_numpy(np.searchsorted(model.classes_, labels))
            errors.append(float((logits.argmax(dim=1) != targets).double().mean()))
            losses.append(F.cross_entropy(logits, targets).item())
        loss = losses[0] + 0.5 * self.penalty * float(weight.square().sum())
        gap = loss - self.optimum
        return {"loss": loss, "loss_gap": gap, "train_error": errors[0], "test_error": errors[1]}


def unit_weights(model: DualLinearClassifier | SoftmaxRegression) -> tuple[Tensor, Tensor]:
    """W float64 [L, D] for pixels in 0…1, and b [L].

    Raises:
        ValueError: for pixels of another scale, whose weights have another penalty.
    """
    if isinstance(model, DualLinearClassifier):
        return model.weight_.double() * 255, model.bias_.double()
    scaling = model.scaling_
    if not isinstance(scaling, PixelScaling) or scaling.scale != 1 / 255:
        raise ValueError(f"pixels: expected unit or unit_centred, found {model.pixels!r}")
    weight, bias = (p.detach().double() for p in model.network_.parameters())
    return weight, bias - weight.sum(dim=1) * scaling.offset / 255
