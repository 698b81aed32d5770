"""Nearest class mean of grey values: HDC's average over a class, without its bits.

A frame is of the class whose mean training frame is nearest in Euclidean distance (nearest
centroid), ‖x − t_c‖² = ‖x‖² − 2·(x·t_c − ½‖t_c‖²), which is linear in the frame.
:mod:`baselines.correlation` standardises frames and means instead.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import torch
from torch import Tensor
from torch.nn import functional as F

from baselines.linear import DualLinearClassifier


@dataclass(kw_only=True, eq=False)
class MeanImage(DualLinearClassifier):
    """Nearest mean frame.

    For arguments and attributes see :class:`baselines.linear.DualLinearClassifier`. A class
    without training frames is never predicted.
    """

    revision: ClassVar[int] = 1

    def solve(
        self,
        gram: Tensor,
        targets: Tensor,
    ) -> tuple[Tensor, Tensor, float]:
        """A averages the frames of each class, b = −½‖t_c‖²; the loss is the mean squared distance
        of a frame to the mean of its class."""
        member = F.one_hot(targets, len(self.classes_)).double()
        counts = member.sum(dim=0)
        a = member / counts.clamp(min=1)
        squares = torch.einsum("ic,ij,jc->c", a, gram, a)
        within = gram.diagonal().sum() - counts @ squares
        bias = torch.where(counts > 0, -0.5 * squares, -torch.inf)
        return a, bias, float(within) / len(gram)
