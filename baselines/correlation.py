"""The image-correlation classifier: each class is its mean frame, and the best correlated one wins.

    r_c(x) = Σ (x − x̄)(t_c − t̄_c) / √(Σ (x − x̄)² Σ (t_c − t̄_c)²)

the zero-mean normalised cross-correlation at zero shift, as in correlation-based speckle sensors
(Fujiwara et al., Opt. Laser Technol. (2017)).
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
import torch
from torch import Tensor
from torch.nn import functional as F

from baselines.bank import Bank
from baselines.base import Classifier, FrameSource, first_of_the_best

CHUNK = 20  # frames; float32 sums of 20 16-bit pixels are exact
REPORT = 100  # frames between two yields


@dataclass(kw_only=True, eq=False)
class CorrelationClassifier(Classifier):
    """Nearest mean template by zero-mean normalised correlation.

    A frame or template without contrast correlates with nothing: its r is taken as 0.

    Attributes:
        templates_: float32 [L, D], zero mean and unit length.
    """

    revision: ClassVar[int] = 1

    def train(
        self, frames: FrameSource, labels: np.ndarray
    ) -> Iterator[dict[str, float]]:
        """One pass; yields samples_seen every :data:`REPORT` frames."""
        targets, n = self.start(frames, labels), len(frames)
        onehot = F.one_hot(targets, len(self.classes_)).float()
        shape = len(self.classes_), math.prod(self.shape_)
        # Exact for any number of frames.
        sums = torch.zeros(shape, dtype=torch.float64, device=self.device)
        for start in range(0, n, CHUNK):
            last = min(start + CHUNK, n)
            rows = slice(start, last)
            sums += onehot[rows].T @ self.read(frames, rows).flatten(1).float()
            if last % REPORT == 0 or last == n:
                self.templates_ = _normalise(sums).float()
                self._counts = onehot[:last].sum(dim=0)
                yield {"samples_seen": last}

    def scores(self, batch: Tensor) -> Tensor:
        """r of each frame with each class, float32 [n, L]; −∞ for a class not seen yet."""
        images = _normalise(batch.flatten(1).float())
        r = images @ self.templates_.T
        return r.masked_fill(self._counts == 0, -torch.inf)

    @property
    def scale_(self) -> float:
        """Templates of equal frames are computed alike, and equal up to the last bit."""
        return 0.3

    def predict_from(
        self, bank: Bank, train: np.ndarray, queries: np.ndarray
    ) -> np.ndarray:
        """See :func:`experiments.protocol.evaluate.evaluate`."""
        model = replace(self)
        targets = model.start(bank.at(train), bank.labels[train])
        member = F.one_hot(targets).double()
        member /= member.sum(dim=0)
        inside = _covariances(bank, train, train)
        across = _covariances(bank, queries, train)
        square = torch.einsum("kc,kj,jc->c", member, inside, member)
        length = square.clamp(min=0).sqrt()
        r = across @ member
        r /= torch.where(length > 0, length, 1.0)
        # The best class does not depend on the lengths of the frames; the size of rounding does.
        own = bank.moments.of(queries)
        contrast = own.second - own.first**2 / bank.dimension
        own_length = torch.where(contrast > 0, contrast, 1.0).sqrt()
        r /= own_length[:, None]
        best = first_of_the_best(r, self.scale_)
        return model.classes_[best.numpy(force=True)]

    def state_tensors(self) -> dict[str, Tensor]:
        """templates [L, D]."""
        return {"templates": self.templates_}


def _normalise(x: Tensor) -> Tensor:
    """Rows of zero mean and unit length; a constant row becomes zero."""
    x = x - x.mean(dim=1, keepdim=True)
    length = x.norm(dim=1, keepdim=True)
    return x.div_(torch.where(length > 0, length, 1.0))


def _covariances(
    bank: Bank,
    rows: np.ndarray,
    columns: np.ndarray,
) -> Tensor:
    """Σ (x − x̄)(y − ȳ) over the pixels of two frames, float64 [n, m]."""
    sums = bank.moments.of(rows).first
    means = bank.moments.of(columns).first / bank.dimension
    return bank.greys[np.ix_(rows, columns)] - torch.outer(sums, means)
