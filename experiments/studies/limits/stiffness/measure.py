"""Softmax regression as a stiff problem: how methods fare as the condition number rises.

The same frames become stiffer the more nearly they repeat each other, under a weaker penalty. Each
method runs until it arrives, can go no further, or has used its time.

The problem and the methods have a file each, and so has Newton's method, which also finds the
optimum in extended precision.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from typing import Any, ClassVar

import msgspec
import numpy as np
import torch
from scipy.sparse.linalg import LinearOperator, eigs

from baselines.bank import Bank
from baselines.softmax_dual import DualSoftmaxRegression
from experiments.protocol.evaluate import bank_of
from experiments.protocol.settings import Split, checked
from experiments.protocol.splits import choose
from experiments.protocol.task import Context, Row, Task
from experiments.studies.limits.stiffness import methods
from experiments.studies.limits.stiffness.newton import optimum
from experiments.studies.limits.stiffness.problem import Array, Problem, condition
from scenes.frames import Scene


class Stiffness(Task, frozen=True):
    """One row: a point of the curve of a method on a problem, or the κ of a real problem.

    Columns: ``problem``, counted from 0; its ``apart``, ``strength`` and ``kappa``; ``method``;
    ``evaluations`` of the loss and ``fit_s`` until then; ``error``, the loss minus the least loss,
    in units of the first; and in the last row of a method ``ended``, why it ended: ``arrived``,
    ``out of time``, or what failed. A ``real`` problem has the name of its scene, ``kappa`` and no
    ``problem``. Arguments: configs/experiment/stiffness.yaml.
    """

    revision: ClassVar = 3
    uses: ClassVar = ("baselines.softmax.SoftmaxRegression",)
    timed: ClassVar = True

    scene: Mapping[str, Any]
    split: Split
    seed: int
    side: int
    originals: int
    problems: Sequence[Mapping[str, float | int]]
    adam: Mapping[str, Any]
    softmax: Mapping[str, Any]
    budget_s: float | int
    goal: float | int
    real: Mapping[str, Mapping[str, Any]]
    most: int

    def rows(self, context: Context) -> Iterator[Row]:
        made = context.scene(self.scene, self.seed)
        train, _ = choose(made, self.split, self.seed)
        frames, onehot = pixels_of(made, train, self.side)
        every = named_methods(self.adam["rates"], self.adam["steps"], self.softmax)
        # Run each method for a moment: its first steps load parts of libraries.
        for method in every.values():
            methods.Watch(
                Problem.of(frames, onehot, 1.0, 1.0, 1), 0.0, 0.0, 0.0
            ).follow(method)
        for number, how in enumerate(self.problems):
            problem = Problem.of(frames, onehot, **how, originals=self.originals)
            best = optimum(problem)
            least, _ = problem.evaluate(best)
            same = {"problem": number, **how, "origin": made.origin}
            same["kappa"] = condition(problem, best.astype(np.float64))
            for name, method in every.items():
                context.note(f"κ = {same['kappa']:.1e}, {name}")
                watch = methods.Watch(problem, float(least), self.budget_s, self.goal)
                for point in watch.follow(method):
                    yield same | {"method": name, **point}
        yield from self.real_problems(context)

    def real_problems(self, context: Context) -> Iterator[Row]:
        """κ of converged softmax on training frames of each real scene: at most `most`, evenly
        spread, by `split` with what the scene sets of it. A scene without files is left out."""
        for name, part in self.real.items():
            try:
                scene = context.scene(part["scene"], self.seed)
            except (ValueError, OSError) as error:
                context.note(f"{name} left out: {str(error).partition(';')[0]}")
                continue
            given = msgspec.to_builtins(self.split) | part.get("split", {})
            train, _ = choose(scene, checked(given, Split, "split"), self.seed)
            some = train[:: -(-len(train) // self.most)]
            kappa = condition_of(bank_of(scene, some))
            yield {"real": name, "kappa": kappa, "n": len(some), "origin": scene.origin}


def condition_of(bank: Bank) -> float:
    """κ of converged softmax on frames, from their products: the largest eigenvalue of the Hessian
    at the optimum over the penalty, below which no eigenvalue is."""
    model = DualSoftmaxRegression()
    every = np.arange(len(bank))
    targets = model.start(bank.at(every), bank.labels)
    gram, _ = bank.centred(every, every[:0], model.pixels)
    dual, intercepts, _ = model.solve(gram, targets)
    p = (gram @ dual + intercepts).softmax(1)

    def product(logits: np.ndarray) -> np.ndarray:
        """The product with the Hessian, which has the same eigenvalues among the logits."""
        moved = torch.from_numpy(logits.reshape(p.shape))
        changed = p * (moved - (p * moved).sum(1, keepdim=True))
        return (gram @ changed).numpy().ravel()

    of_logits = LinearOperator((p.numel(), p.numel()), product, dtype=np.float64)
    (largest,) = eigs(of_logits, 1, tol=1e-3, return_eigenvectors=False)
    return 1 + model.C * float(largest.real)


def pixels_of(scene: Scene, train: Array, side: int) -> tuple[Array, Array]:
    """Frames float64 [N, D] of side × side pixels, evenly spread, and their classes [N, L]."""
    frames = scene.frames(train)
    rows, columns = (
        np.linspace(0, length - 1, side).astype(int) for length in frames.shape[1:]
    )
    spread = frames[:, rows][:, :, columns]
    _, classes = np.unique(scene.labels[train], return_inverse=True)
    return spread.flatten(1).double().numpy(), np.eye(classes.max() + 1)[classes]


def named_methods(
    rates: Sequence[float], steps: int, softmax: Mapping[str, Any]
) -> dict[str, methods.Method]:
    """The methods by their names; Adam once per rate."""
    named: dict[str, methods.Method] = {
        "gradient descent": methods.gradient_descent,
        "momentum": methods.momentum,
    }
    for rate in rates:
        named[f"Adam, rate {rate:g}"] = partial(methods.adam, rate=rate, steps=steps)
    return named | {
        "L-BFGS": methods.l_bfgs,
        "Newton": methods.newton,
        "SoftmaxRegression": partial(methods.minibatches, **softmax),
        "DualSoftmaxRegression": methods.dual,
    }
