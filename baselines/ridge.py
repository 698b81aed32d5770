"""Ridge regression on the speckle itself: the read-out of an optical extreme learning machine.

The scattering medium is the random hidden layer, its camera image the features, and only a linear
read-out is learnt (Saade et al., ICASSP 2016; Sunada et al., Opt. Express 28, 30349 (2020)):

    min over W, b of Σᵢ ‖W·xᵢ + b − yᵢ‖² + α ‖W‖²,    yᵢ = +1 at the class of frame i, −1 elsewhere.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import torch
from torch import Tensor
from torch.nn import functional as F

from baselines.linear import PenalisedClassifier


@dataclass(kw_only=True, eq=False)
class RidgeReadout(PenalisedClassifier):
    """Ridge classifier with the weights of scikit-learn's RidgeClassifier, from one N×N solve.

    Args:
        alpha: strength of the penalty, above zero.

    For others see :class:`baselines.linear.DualLinearClassifier`.
    """

    alpha: float = 1.0

    revision: ClassVar[int] = 1

    def solve(
        self, gram: Tensor, targets: Tensor, before: Tensor | None = None
    ) -> tuple[Tensor, Tensor, float]:
        """(K + α)·A = Y − mean(Y), b = mean(Y), Y in ±1 minus the scores before: A [N, L], b [L]
        and the mean squared error."""
        if not self.alpha > 0:
            raise ValueError(f"alpha: expected a number above zero, found {self.alpha}")
        onehot = F.one_hot(targets, len(self.classes_))
        y = 2 * onehot.double() - 1
        if before is not None:
            y = y - before
        mean = y.mean(dim=0)
        system = gram.clone()
        system.diagonal().add_(self.alpha)
        factor = torch.linalg.cholesky(system)
        a = torch.cholesky_solve(y - mean, factor)
        residual = self.alpha * a  # Y − K·A − b
        return a, mean, float(residual.square().mean())
